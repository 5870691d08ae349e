"""A policy behind a WebSocket: the evaluator as client, in openpi's protocol; see `wire` for what passes.

The server is a stranger: it sees observations, and every fault of it is one `PolicyError`.
"""

import logging
import time
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from artiskill.config import check_inside, check_positive, from_mapping
from artiskill.demos.lerobot import instruction_of
from artiskill.envs.control import CONTROL_MODES
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.options import OBSERVATION_MODES
from artiskill.envs.wrappers import Sampling
from artiskill.errors import ArtiSkillError, PolicyError, check_name
from artiskill.evaluation import wire
from artiskill.evaluation.remote_channel import RemoteChannel
from artiskill.evaluation.sandbox import Confinement
from artiskill.evaluation.wire import ObservationWriter, ServerMetadata, WireError
from artiskill.tasks.registry import SEEN_SECTIONS

SCHEMES = ("ws", "wss")
CONNECT_TIMEOUT_S, STEP_TIMEOUT_S = 120.0, 60.0  # a large policy may compile at its first call
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class RemotePolicy:
    """A policy behind a WebSocket, and what is asked of it; None for what its server says.

    Attributes:
        url: `ws://host:port` or `wss://host:port`.
        points: of the clouds that it gets.
        frame: of these points.
        replan_steps: how many actions of an answer are taken before it is asked again; at most all of them.
        connect_timeout_s: the time in which a connection must stand.
        step_timeout_s: the time in which each answer must come.
        expected: what its server said before, and must say again of each connection; None for anything.

    Raises:
        PolicyError: the address is none of a WebSocket, or holds a password.
        ConfigError: an illegal number.
    """

    url: str
    points: int | None = None
    frame: str | None = None
    replan_steps: int | None = None
    connect_timeout_s: float = CONNECT_TIMEOUT_S
    step_timeout_s: float = STEP_TIMEOUT_S
    expected: ServerMetadata | None = None

    def __post_init__(self) -> None:
        try:
            parts = urlsplit(self.url)
            is_address = bool(
                parts.scheme in SCHEMES and parts.hostname and parts.port != 0 and not parts.fragment
            )
        except ValueError:
            is_address = False
        if not is_address:
            raise PolicyError(f"{self.url!r} is no address of a policy's server, such as ws://localhost:8000")
        if parts.username is not None or parts.password is not None:
            where = f"the environment variable {wire.API_KEY}"
            raise PolicyError(f"no passwords in addresses, which reports name: put the server's key into {where}")
        check_positive(self, "connect_timeout_s", "step_timeout_s")
        ServerMetadata(points=self.points)
        if self.replan_steps is not None:
            check_inside("replan_steps", self.replan_steps, (1, wire.MOST_STEPS))
        if self.frame is not None:
            Sampling(frame=self.frame)

    @property
    def steps_of_answer(self) -> int | None:
        """Actions that are taken of each answer, of a policy whose server has been asked; None for all."""
        said = None if self.expected is None else self.expected.replan_steps
        return self.replan_steps or said

    def __str__(self) -> str:
        """Return the address."""
        return self.url


def as_remote(policy: Any) -> RemotePolicy | None:
    """Return the policy behind a WebSocket that is meant; None for any other policy.

    Raises:
        PolicyError: an address that is none.
    """
    if isinstance(policy, RemotePolicy):
        return policy
    is_url = isinstance(policy, str) and policy.lower().startswith(tuple(f"{scheme}://" for scheme in SCHEMES))
    return RemotePolicy(policy) if is_url else None


@dataclass(frozen=True)
class RemotePlan:
    """A remote policy with all that an evaluation needs to know of it.

    Attributes:
        policy: which fixes what its server has said.
        obs_mode, control_mode, sampling: as of `Actor`.
        config: its `observation_config`.
        notes: what is done otherwise than its server says.
    """

    policy: RemotePolicy
    obs_mode: str
    control_mode: str
    sampling: Sampling | None
    config: dict[str, Any] | None
    notes: tuple[str, ...]


def plan_remote(policy: RemotePolicy, obs_mode: str | None, control_mode: str | None) -> RemotePlan:
    """Ask a server what its policy needs; what is given overrides it.

    Args:
        policy: which.
        obs_mode: of the observations; None for what the server says.
        control_mode: of the actions; likewise.

    Raises:
        PolicyError: the server cannot be reached, says what is not legal, or does not say what it must.
    """
    said = ask_metadata(policy)
    asked = {"obs_mode": obs_mode, "control_mode": control_mode}
    chosen = {name: value or getattr(said, name) for name, value in asked.items()}
    _check_modes(policy, said)
    missing = [f"--{name.replace('_', '-')}" for name, value in chosen.items() if value is None]
    if missing:
        clouds = "; for clouds also --points and --frame, else it gets the full ones"
        raise PolicyError(f"{policy} does not say what its policy needs: give {' and '.join(missing)}{clouds}")
    given = asked | {name: getattr(policy, name) for name in ("points", "frame", "replan_steps")}
    notes = tuple(
        f"{name} is {value}, though {policy} says {getattr(said, name)}"
        for name, value in given.items()
        if value is not None and getattr(said, name) not in (None, value)
    )
    sampling = _sampling(policy, said) if chosen["obs_mode"] == "pointcloud" else None
    planned = replace(policy, expected=said)
    return RemotePlan(planned, **chosen, sampling=sampling, config=said.observation_config, notes=notes)


def ask_metadata(policy: RemotePolicy) -> ServerMetadata:
    """Return what a server says of its policy.

    Raises:
        PolicyError: it cannot be reached, or says what is not legal.
    """
    with closing(RemoteActor(policy)) as actor:
        return actor.metadata


def _check_modes(policy: RemotePolicy, said: ServerMetadata) -> None:
    try:
        if said.obs_mode is not None:
            check_name("obs_mode", said.obs_mode, OBSERVATION_MODES)
        if said.control_mode is not None:
            check_name("control_mode", said.control_mode, CONTROL_MODES)
        seen = said.observation_config or {}
        for section in {str(key).partition(".")[0] for key in seen}:
            check_name("section of observation_config", section, SEEN_SECTIONS)
    except ArtiSkillError as error:
        raise PolicyError(f"{policy}: its metadata: {error}") from error


def _sampling(policy: RemotePolicy, said: ServerMetadata) -> Sampling | None:
    """Return which points a policy sees; its settings are for as many points as it says itself."""
    asked = {"num_points": policy.points, "frame": policy.frame}
    values = (said.sampling or {}) | {name: value for name, value in asked.items() if value is not None}
    points_said = said.points or (Sampling().num_points if said.sampling else None)
    if policy.points not in (None, points_said):
        values = {name: value for name, value in values.items() if name != "settings"}
    try:
        return from_mapping(Sampling, values, "its points") if values else None
    except ArtiSkillError as error:
        raise PolicyError(f"{policy}: {error}") from error


class RemoteActor:
    """A connection to a policy's server, for the episodes on one object; as `Actor` asks.

    Args:
        policy: which.

    Attributes:
        metadata: what the server says of its policy.
        from_chunk: whether the last action was of an earlier answer.

    Raises:
        PolicyError: no connection, or the server says what is not legal, or something else than before.
        MissingExtraError: websockets or msgpack is not installed.
    """

    def __init__(self, policy: RemotePolicy) -> None:
        self.name, self._policy = str(policy), policy
        self._where, self._step, self._first, self.from_chunk = "", 0, True, False
        self.confinement: Confinement | None = None  # who knows what it runs in
        self._chunk: list[np.ndarray] = []
        self._prompt = ""
        self._writer: ObservationWriter | None = None
        try:
            self._channel = RemoteChannel(policy.url, policy.connect_timeout_s, policy.step_timeout_s)
            try:
                self.metadata = wire.read_metadata(self._channel.receive("metadata", policy.connect_timeout_s))
                if policy.expected not in (None, self.metadata):
                    raise WireError("its metadata changed since the first connection: is it another policy?")
                is_cloud = self.metadata.obs_mode == "pointcloud"
                self.sampling = _sampling(policy, self.metadata) if is_cloud else None
            except BaseException:
                self._channel.close()
                raise
        except WireError as error:
            raise self._error(error) from error
        said = self.metadata
        self.obs_mode, self.control_mode = said.obs_mode, said.control_mode
        self.observation_config: Mapping[str, Any] | None = said.observation_config
        self._replan_steps = policy.replan_steps or said.replan_steps

    def reset(self, env: ManipulationEnv, observation: Any, info: Mapping[str, Any]) -> None:
        """Begin an episode; the server hears of it with the first observation."""
        self._where, self._step, self._first = f"object {info['object']}, level {info['level']}", 0, True
        self._chunk = []
        self._writer = ObservationWriter(env.task, env.obs_mode)
        self._prompt = instruction_of(env.task.name)

    def act(self, env: ManipulationEnv, observation: Any) -> np.ndarray:
        """Return the next action (A,) of the last answer, or of a new one.

        Raises:
            PolicyError: the server fails, is too slow, or answers with no legal actions.
        """
        self.from_chunk = bool(self._chunk)
        if not self._chunk:
            try:
                self._chunk = list(self._ask(observation, env.control.size)[: self._replan_steps])
            except WireError as error:
                raise self._error(error, f"{self._where}, step {self._step}") from error
        self._step += 1
        return self._chunk.pop(0)

    def close(self) -> None:
        """End the connection."""
        self._channel.close()

    def _ask(self, observation: Any, size: int) -> np.ndarray:
        assert self._writer is not None, "an actor is reset before it acts"
        message = self._writer.write(observation) | {"prompt": self._prompt, "step": self._step}
        if self._first:
            message["reset"], self._first = True, False
        begin = time.perf_counter()
        self._channel.send(wire.pack(message))
        actions = wire.read_actions(self._channel.receive("action", self._policy.step_timeout_s), size)
        _log.debug("%s: %s, step %d: %.1f ms", self, self._where, self._step, 1e3 * (time.perf_counter() - begin))
        return actions

    def _error(self, error: WireError, where: str = "") -> PolicyError:
        found = PolicyError(f"{self.name}: {error} ({where})" if where else f"{self.name}: {error}")
        if error.details:
            found.add_note(f"the server says:\n{error.details}")
        return found
