"""A policy of this package as a server in openpi's WebSocket protocol; see `wire` for what passes.

Each connection has a policy of its own: a solution file a process, as in a local evaluation.
"""

import hmac
import http
import logging
import os
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from artiskill.config import check_inside
from artiskill.envs.control import CONTROL_MODES, JOINT
from artiskill.envs.options import OBSERVATION_MODES
from artiskill.errors import ArtiSkillError, ConfigError, MissingExtraError, PolicyError, check_name, shown
from artiskill.evaluation import wire
from artiskill.evaluation.plan import inspect_policy
from artiskill.evaluation.policies import (
    POLICY_NAMES,
    SolutionActor,
    load_policy,
    policy_of_task,
    trained_task,
)
from artiskill.evaluation.remote import as_remote
from artiskill.evaluation.remote_channel import LOOPBACKS
from artiskill.evaluation.sandbox import SandboxConfig
from artiskill.evaluation.solution import ObjectSolution

LOOPBACK, PORT = LOOPBACKS[0], 8000
_DEFAULT_OBS_MODE = "state"
_HEALTH = "/healthz"
_INTERNAL_ERROR, _ENDING = 1011, (1001, "the server ends")  # WebSocket's statuses, RFC 6455, section 7.4.1
_CLOSE_S = 1.0
_in_process = threading.Lock()  # numeric libraries have one number of threads for all that runs in a process


def serve(
    policy: str | Path,
    port: int = PORT,
    host: str = LOOPBACK,
    *,
    task: str | None = None,
    obs_mode: str | None = None,
    control_mode: str | None = None,
    sandbox: str | None = None,
    on_event: Callable[[str], None] = print,
) -> None:
    """Serve a policy until Ctrl-C, for `artiskill evaluate --policy ws://host:port`.

    Args:
        policy: path of a solution file, of the folder of a training run or of a file exported from it, or
            `pretrained`.
        port: 0 for any that is free.
        host: address that is listened to; anybody who reaches it can use the policy.
        task: of `pretrained`, and of other policies that do not say themselves what they are for.
        obs_mode: of a policy that declares none, by default `state`.
        control_mode: likewise, by default `joint`.
        sandbox: one of `sandbox.SANDBOXES`, how a solution file is confined: `none` gives it a GPU; by default
            the best that holds here.
        on_event: is told in one line when the server is ready, and of each connection's beginning, end and fault.

    Raises:
        ConfigError: an address that cannot be listened to.
        PolicyError: a policy that cannot be loaded, or cannot be served.
        MissingExtraError: websockets or msgpack is not installed.
        KeyboardInterrupt: Ctrl-C, after all has ended.
    """
    with PolicyServer(policy, port, host, task, obs_mode, control_mode, on_event, sandbox) as server:
        on_event(f"serving {policy} at {server.url}; Ctrl-C ends")
        if host not in LOOPBACKS:
            key = f"and has the key in {wire.API_KEY} " if os.environ.get(wire.API_KEY) else ""
            on_event(f"whoever reaches {host} {key}can use it")
        server.run()


class PolicyServer:
    """A server that listens from its making to the end of its `with` block; see `serve` for the arguments.

    Attributes:
        url: for clients on this machine, or those that reach `host`.
    """

    def __init__(
        self,
        policy: str | Path,
        port: int = PORT,
        host: str = LOOPBACK,
        task: str | None = None,
        obs_mode: str | None = None,
        control_mode: str | None = None,
        on_event: Callable[[str], None] = print,
        sandbox: str | None = None,
    ) -> None:
        wire.import_msgpack()
        self._sandbox = SandboxConfig(sandbox)
        self._policy, self._task = _checked(policy, task)
        spec = inspect_policy(self._policy, self._task, sandbox=self._sandbox)
        self.obs_mode = _mode("obs_mode", obs_mode, spec.obs_mode, _DEFAULT_OBS_MODE, OBSERVATION_MODES)
        modes = self.obs_mode, _mode("control_mode", control_mode, spec.control_mode, JOINT, CONTROL_MODES)
        said = wire.metadata_of(self._task, *modes, spec.sampling, spec.observation_config)
        self.metadata, self._on_event = wire.pack(said), on_event
        self._open: dict[Any, SolutionActor] = {}
        self._count, self._lock, self._is_ending = 0, threading.Lock(), False
        self._server = _listen(self._handle, host, port)
        shown_host = "localhost" if host in ("0.0.0.0", "::", "") else f"[{host}]" if ":" in host else host
        self.url = f"ws://{shown_host}:{self._server.socket.getsockname()[1]}"

    def run(self) -> None:
        """Answer clients, until `close` or an exception."""
        self._server.serve_forever()

    def close(self) -> None:
        """End all connections, what belongs to them, and the server."""
        self._server.shutdown()
        with self._lock:
            self._is_ending = True
            connections = list(self._open.items())
        for connection, actor in connections:
            actor.close()  # a policy that thinks forever would keep its connection's thread
            connection.close(*_ENDING)

    def __enter__(self) -> "PolicyServer":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _handle(self, connection: Any) -> None:
        """Serve one connection; a fault of its client or policy ends it, and nothing else."""
        from websockets.exceptions import ConnectionClosed

        with self._lock:
            self._count += 1
            number = self._count
        who, calls = f"connection {number}", 0
        self._on_event(f"{who}: from {connection.remote_address[0]}")
        try:
            actor = load_policy(self._policy, self._task, self._sandbox)
            assert isinstance(actor, SolutionActor)
            with self._lock:
                self._open[connection] = actor
                if self._is_ending:
                    return
            session = _Session(actor, self.obs_mode)
            connection.send(self.metadata)
            for message in connection:
                connection.send(session.answer(message))
                calls += 1
            self._on_event(f"{who}: ended after {calls} answers")
        except ConnectionClosed:
            self._on_event(f"{who}: lost after {calls} answers")
        except Exception as error:  # of a policy, anything
            if self._is_ending:  # which ends policies, too
                connection.close(*_ENDING)
                return
            self._on_event(f"{who}: ended by a fault: {_said(error)}")
            with suppress(ConnectionClosed):
                connection.send(_trace(error))
                connection.close(_INTERNAL_ERROR, "the policy failed; the message before says how")
        finally:
            with self._lock:
                left = self._open.pop(connection, None)
            if left is not None:
                left.close()


class _Session:
    """One connection's policy, and its episodes."""

    def __init__(self, actor: SolutionActor, obs_mode: str) -> None:
        self._solution, self._obs_mode, self._episode = actor.solution, obs_mode, 0
        self._has_begun = False

    def answer(self, data: bytes | str) -> bytes:
        """Return the message that answers an observation.

        Raises:
            PolicyError: the policy fails, or the message is no observation.
        """
        try:
            if isinstance(data, str):
                raise wire.WireError("a text; an observation is a binary message")
            message = wire.unpack(data)
            observation = wire.read_observation(message, self._obs_mode)
            size = wire.action_size(message)
        except wire.WireError as error:
            raise PolicyError(f"the client sends {error}") from error
        begin = time.perf_counter()
        if isinstance(self._solution, ObjectSolution):
            with _in_process:
                action = self._act(message, observation, size)
        else:
            action = self._act(message, observation, size)
        timing = {"infer_ms": 1e3 * (time.perf_counter() - begin)}
        return wire.pack(
            {"actions": action[None], "server_timing": timing}
        )  # (1, A): a chunk, as openpi's clients slice

    def _act(self, message: dict[Any, Any], observation: Any, size: int) -> Any:
        if message.get("reset") or not self._has_begun:
            self._has_begun = True
            self._solution.reset(observation, {"episode": self._episode})
            self._episode += 1
        return self._solution.act(observation, (size,))


def _checked(policy: str | Path, task: str | None) -> tuple[str, str | None]:
    """Return the path of a policy that can be served, and the task that it is for.

    Raises:
        PolicyError: no other program can have what it needs.
        ConfigError: `pretrained` without a task.
        MissingExtraError: websockets is not installed.
    """
    name = str(policy)
    if name == POLICY_NAMES[-1]:
        if task is None:
            raise ConfigError(f"{name} is another policy for each task: give --task, PushChair say")
        name = policy_of_task(name, task)
    elif name in POLICY_NAMES:
        raise PolicyError(
            f"{name} needs the simulation itself, and a server only gets observations: evaluate it here"
        )
    if as_remote(name) is not None:
        raise PolicyError(f"{name} is a server already")
    return name, trained_task(name) or task


def _mode(kind: str, asked: str | None, needed: str | None, default: str, legal: tuple[str, ...]) -> str:
    """Return the mode of a policy, which one that declares none is told."""
    if asked is not None:
        check_name(kind, asked, legal)
    if asked is not None and needed not in (None, asked):
        raise PolicyError(f"the policy needs {kind} {needed!r}, but {asked!r} was asked for")
    return needed or asked or default


def _listen(handler: Callable[[Any], None], host: str, port: int) -> Any:
    """Return websockets' server, which listens.

    Raises:
        ConfigError: it cannot.
        MissingExtraError: websockets is not installed.
    """
    try:
        import websockets.sync.server as websockets
    except ImportError as error:
        raise MissingExtraError("serving a policy", wire.EXTRA) from error
    check_inside("a port", port, (0, 65535))
    log = logging.getLogger(__name__)
    log.addHandler(logging.NullHandler())
    log.propagate = False  # what a port scanner sends is nobody's business
    try:
        return websockets.serve(
            handler,
            host,
            port,
            compression=None,
            origins=[None],  # no page in a browser may use what listens on its user's machine
            process_request=_answer_request,
            ping_interval=None,
            close_timeout=_CLOSE_S,
            max_size=wire.MOST_BYTES,
            logger=log,
        )
    except OSError as error:
        said = error.strerror or error
        raise ConfigError(f"cannot listen to {host}, port {port}: {said}; --port 0 takes a free one") from error


def _answer_request(connection: Any, request: Any) -> Any:
    """Answer a request before it becomes a WebSocket: of the server's health, and without the right key."""
    if request.path == _HEALTH:
        return connection.respond(http.HTTPStatus.OK, "OK\n")
    key = os.environ.get(wire.API_KEY)
    given = request.headers.get("Authorization", "")
    if key and not hmac.compare_digest(given.encode(), f"Api-Key {key}".encode()):
        return connection.respond(http.HTTPStatus.UNAUTHORIZED, "a key is needed\n")
    return None


def _said(error: Exception) -> str:
    """Return an error in one line."""
    text = str(error) if isinstance(error, ArtiSkillError) else f"{type(error).__name__}: {error}"
    return " ".join(wire.printable(text, 500).split()) or shown(error)


def _trace(error: Exception) -> str:
    """Return what a client is told of an error: a traceback, whose last line says what is wrong."""
    lines = "".join(traceback.format_exception(error.__cause__ or error))
    return f"{lines.rstrip()}\n\n{_said(error)}\n"
