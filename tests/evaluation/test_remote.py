"""A policy behind a WebSocket: what its server is asked, and each fault of it in one line with object and step."""

import csv
import shutil
import socket
import ssl
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import pytest
from websockets.sync.server import serve

from artiskill.errors import ArtiSkillError, ConfigError, MissingExtraError, PolicyError
from artiskill.evaluation import wire
from artiskill.evaluation.evaluate import evaluate, run_evaluation
from artiskill.evaluation.plan import plan_evaluation
from artiskill.evaluation.policies import trained_task
from artiskill.evaluation.remote import RemotePolicy, ask_metadata
from artiskill.evaluation.report import Report, write_report
from artiskill.evaluation.verify import verify_policy, verify_report
from artiskill.evaluation.wire import pack, unpack

TASK, OBJECTS = "OpenCabinetDrawer", ["cabinet-0005", "cabinet-0010"]
SHORT = {"episode_steps": 5}
STATE = {"obs_mode": "state", "control_mode": "joint"}
ZEROS = np.zeros(13, np.float32)
Answer = Callable[[dict[str, Any]], Any]


class ScriptedServer:
    """A server that keeps what it is sent, and answers as it is told.

    Args:
        answer: observation -> the message to send; bytes and text go out as they are; None closes the connection.
        metadata: the first message; None for none.
    """

    def __init__(self, answer: Answer, metadata: Any, **options: Any) -> None:
        self.received: list[list[dict[str, Any]]] = []
        self.headers: list[Any] = []
        self._answer, self._metadata = answer, metadata
        self._server = serve(
            self._handle,
            "127.0.0.1",
            0,
            **{"compression": None, "max_size": None, "ping_interval": None, **options},
        )
        self.url = f"ws://127.0.0.1:{self._server.socket.getsockname()[1]}"
        self._thread = threading.Thread(target=self._server.serve_forever)
        self._thread.start()

    def _handle(self, connection: Any) -> None:
        self._connection = connection
        self.headers.append(connection.request.headers)
        self.received.append([])
        mine = self.received[-1]
        if self._metadata is not None:
            connection.send(self._metadata if isinstance(self._metadata, bytes | str) else pack(self._metadata))
        for message in connection:
            mine.append(unpack(message))
            answer = self._answer(mine[-1])
            if answer is None:
                connection.socket.shutdown(socket.SHUT_RDWR)
                return
            connection.send(answer if isinstance(answer, bytes | str) else pack(answer))

    def end(self) -> None:
        self._server.shutdown()
        self._thread.join()


@contextmanager
def server(
    answer: Answer = lambda seen: {"actions": ZEROS}, metadata: Any = STATE, **options: Any
) -> Iterator[Any]:
    made = ScriptedServer(answer, metadata, **options)
    try:
        yield made
    finally:
        made.end()


def play(policy: Any, objects: list[str] = OBJECTS[:1], episodes: int = 1, **options: Any) -> Report:
    return evaluate(TASK, policy, objects, episodes, config=SHORT, **options)


# -- what passes --------------------------------------------------------------------------------------------------


def test_each_object_has_a_connection_and_each_episode_a_reset() -> None:
    with server() as made:
        report = play(made.url, OBJECTS, 2)
    first, *connections = made.received
    assert first == [], "the first look"
    assert len(connections) == 2
    for messages in connections:
        assert [message["step"] for message in messages] == [0, 1, 2, 3, 4] * 2
        assert [message.get("reset") for message in messages] == ([True] + [None] * 4) * 2
        assert {message["prompt"] for message in messages} == {"Open the marked drawer of the cabinet."}
        sizes = {(len(m["observation/state"]), len(m["observation/environment_state"])) for m in messages}
        assert sizes == {(38, 49)}
        assert not [name for name in (*OBJECTS, "link_", "level") if name in repr(messages)]
    assert report.total.episodes == 4
    assert report.policy == made.url
    assert report.policy_sha256 is None
    assert all(headers.get("Sec-WebSocket-Extensions") is None for headers in made.headers)


def test_the_actions_are_those_of_the_server() -> None:
    rows = np.random.default_rng(0).uniform(-1, 1, (3, 13)).astype(np.float32)

    def local(observation: Any) -> np.ndarray:
        local.count += 1  # type: ignore[attr-defined]
        return rows[(local.count - 1) % 5 % 3]  # type: ignore[attr-defined]

    local.count = 0  # type: ignore[attr-defined]
    with server(lambda seen: {"actions": rows}) as made:
        remote = play(made.url, episodes=2)
    assert [len(messages) for messages in made.received] == [0, 4], "rows 0 to 2, then 0 and 1: no more is needed"
    mine = play(local, episodes=2)
    for one, other in zip(remote.episodes, mine.episodes, strict=True):
        assert one == other
        assert one.actions.tobytes() == other.actions.tobytes()


@pytest.mark.parametrize(
    ("said", "asked", "steps"), [(None, None, [0, 4]), (2, None, [0, 2, 4]), (2, 3, [0, 3]), (9, None, [0, 4])]
)
def test_chunks(said: int | None, asked: int | None, steps: list[int]) -> None:
    metadata = STATE | ({} if said is None else {"replan_steps": said})
    with server(lambda seen: {"actions": np.zeros((4, 13))}, metadata) as made:
        plan = plan_evaluation(TASK, RemotePolicy(made.url, replan_steps=asked), OBJECTS[:1], 1, config=SHORT)
        report = run_evaluation(plan)
    assert [message["step"] for message in made.received[-1]] == steps
    assert np.flatnonzero(np.isfinite(report.episodes[0].act_s)).tolist() == steps
    assert 0 < report.timing["act_ms"]["median"] <= report.timing["act_ms"]["max"], "of answers alone"
    assert plan.notes == ((f"replan_steps is 3, though {made.url} says 2",) if said and asked else ())


def test_what_a_server_says_configures_the_observation() -> None:
    seen_config = {"cameras.width": 40, "cameras": {"height": 32}}
    cloud = {"obs_mode": "pointcloud", "control_mode": "operational_space", "points": 32, "frame": "robot"}
    with server(metadata=cloud | {"method": "voxel", "observation_config": seen_config}) as made:
        plan = plan_evaluation(TASK, made.url, OBJECTS[:1], 1, config=SHORT)
        report = run_evaluation(plan)
        changed = plan_evaluation(
            TASK,
            RemotePolicy(made.url, points=16, frame="world"),
            OBJECTS[:1],
            1,
            config=SHORT,
            control_mode="joint",
        )
    message = made.received[1][0]
    assert message["observation/pointcloud/xyz"].shape == (32, 3)
    assert (report.obs_mode, report.control_mode) == ("pointcloud", "operational_space")
    assert report.sampling is not None
    assert (report.sampling.frame, report.sampling.method) == ("robot", "voxel")
    assert (report.config["cameras"]["width"], report.config["cameras"]["height"]) == (40, 32)
    assert plan.notes == ()
    assert changed.notes == (
        f"control_mode is joint, though {made.url} says operational_space",
        f"points is 16, though {made.url} says 32",
        f"frame is world, though {made.url} says robot",
    )
    sampling = changed.batches[0].sampling
    assert sampling is not None
    assert (sampling.num_points, sampling.frame, sampling.method) == (16, "world", "voxel")


def test_a_server_that_says_nothing_is_told() -> None:
    with server(metadata={}) as made:
        with pytest.raises(
            PolicyError, match="does not say what its policy needs: give --obs-mode and --control-m"
        ):
            play(made.url)
        with pytest.raises(
            PolicyError, match="does not say what its policy needs: give --control-mode; for clouds"
        ):
            play(made.url, obs_mode="state")
        assert play(made.url, obs_mode="state", control_mode="joint").total.episodes == 1
        play(RemotePolicy(made.url, points=8, frame="robot"), obs_mode="pointcloud", control_mode="joint")
        assert made.received[-1][0]["observation/pointcloud/seg"].shape == (8, 3)


def test_the_task_may_be_the_servers() -> None:
    with server(metadata={"task": "PushChair"}) as made:
        assert trained_task(made.url) == "PushChair"


def test_the_key_travels_in_a_header_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(wire.API_KEY, "secret")
    with server() as made:
        report = play(made.url)
    assert {headers["Authorization"] for headers in made.headers} == {"Api-Key secret"}
    assert "secret" not in repr(report.to_mapping())


def test_several_environments_ask_one_server_at_once() -> None:
    together = threading.Barrier(2, timeout=60)

    def answer(seen: dict[str, Any]) -> Any:
        if seen["step"] == 0:
            together.wait()  # fails unless two connections are there
        return {"actions": ZEROS + 0.25}

    with server(answer) as made:
        both = play(made.url, OBJECTS, workers=2)
    assert both.episodes == play(lambda observation: ZEROS + 0.25, OBJECTS).episodes


def test_reports_of_servers_are_verified(tmp_path: Path) -> None:
    with server(lambda seen: {"actions": np.full((2, 13), 0.1)}) as made:
        folder = write_report(play(made.url, OBJECTS, 2), tmp_path)
        assert verify_report(folder).faults == ()
        assert verify_policy(folder, made.url, 1, np.random.default_rng(0)).faults == ()
    with (folder / "latency.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["object"], int(row["step"])) for row in rows] == [(o, s) for o in OBJECTS for s in (0, 2, 4) * 2]
    assert all(0 < float(row["ms"]) < 60_000 for row in rows)
    write_report(play("still"), folder)
    assert not (folder / "latency.csv").exists(), "it was of the report before"


# -- faults -------------------------------------------------------------------------------------------------------

AT = r"\(object cabinet-0005, level 0, step 2\)(\n|$)"
ARRAY = {b"__ndarray__": True, b"data": bytes(8), b"dtype": "|O", b"shape": [1]}
TRACE = "Traceback (most recent call last):\n  File \"p.py\", line 3\nKeyError: 'gripper'\x1b[31m\n"
FAULTS: dict[str, tuple[Any, str]] = {
    "lost": (None, "connection lost"),
    "text": (TRACE, r"the policy failed: KeyError: 'gripper'\\x1b\[31m"),
    "nan": (
        {"actions": np.full((2, 13), np.nan)},
        "actions with nan in row 0, entry 0; an action is 13 finite numb",
    ),
    "shape": (
        {"actions": np.zeros((4, 12))},
        r"actions of shape \(4, 12\); an action is 13 finite numbers in \[-1",
    ),
    "no_msgpack": (b"\xc1", r"it sends a message that is not msgpack \(FormatError\)"),
    "no_map": (b"\x05", "it sends a message that is no map but a int"),
    "objects": (
        msgpack.packb({"actions": ARRAY}),
        r"it sends an array of dtype '\|O'; legal are booleans, integers a",
    ),
    "sizes": (
        msgpack.packb({"actions": ARRAY | {b"dtype": "<f4", b"shape": [13]}}),
        r"it sends an array of shape \(13,\) and dtype <f4 with 8 bytes of data",
    ),
    "missing": ({"action": ZEROS}, r"an answer without 'actions' \(it has \['action'\]\)"),
    "huge": (bytes(70_000), "it sends a message of more than 65536 bytes"),
}


@pytest.mark.parametrize(("kind", "workers"), [*((kind, 1) for kind in FAULTS), ("lost", 2), ("text", 2)])
def test_faults_name_object_and_step(kind: str, workers: int, monkeypatch: pytest.MonkeyPatch) -> None:
    sent, says = FAULTS[kind]
    monkeypatch.setattr(wire, "MOST_BYTES", 65536)
    with (
        server(lambda seen: sent if seen["step"] == 2 else {"actions": ZEROS}) as made,
        pytest.raises(PolicyError, match=f"^{made.url}: {says}.*{AT}") as caught,
    ):
        play(made.url, OBJECTS, workers=workers)
    assert "\n" not in str(caught.value)
    if kind == "text":
        assert any('File "p.py", line 3\nKeyError' in note for note in caught.value.__notes__)


@pytest.mark.parametrize(
    "metadata",
    [
        {"replan_steps": 2, "points": 64, "frame": "robot"},
        {"method": "shares", "settings": {"shares": [1, 1, 1, 1]}},
        {},
    ],
)
def test_a_server_that_was_overridden_is_asked_the_same_again(metadata: dict[str, Any], tmp_path: Path) -> None:
    """Its actions are those of the step and of the points that it sees, so that other options give others."""

    def answer(seen: dict[str, Any]) -> Any:
        cloud = seen["observation/pointcloud/xyz"]
        rows = [np.full(13, (seen["step"] + k) / 100 + len(cloud) / 1e4) for k in range(4)]
        return {"actions": np.array(rows) + cloud.mean() / 1e3}

    said = {"obs_mode": "pointcloud", "control_mode": "joint"} if metadata else {}
    modes = {} if metadata else {"obs_mode": "pointcloud", "control_mode": "joint"}
    with server(answer, said | metadata) as made:
        policy = RemotePolicy(made.url, points=32, frame="world", replan_steps=3)
        report = play(policy, OBJECTS, **modes)
        assert (report.replan_steps, report.sampling and report.sampling.num_points) == (3, 32)
        folder = write_report(report, tmp_path)
        assert verify_report(folder).faults == ()
        assert verify_policy(folder, made.url, 2, np.random.default_rng(0)).faults == ()


def test_a_time_that_was_changed_is_found(tmp_path: Path) -> None:
    with server() as made:
        folder = write_report(play(made.url), tmp_path)
    path = folder / "latency.csv"
    honest = path.read_text()
    path.write_text(honest.replace(",0,", ",9,", 1))
    assert "latency.csv is another one" in verify_report(folder).faults[0]
    path.unlink()
    assert "latency.csv is another one" in verify_report(folder).faults[0]
    path.write_text(honest)
    assert verify_report(folder).faults == ()


def test_an_answer_too_many_is_told() -> None:
    """Taken for the next one, it would shift all that follow; it is seen as soon as it has come when one asks."""

    def answer(seen: dict[str, Any]) -> Any:
        made._connection.send(pack({"actions": ZEROS}))
        return {"actions": ZEROS}

    says = r"an answer that nobody asked for \(object cabinet-0005, level 0, step \d+\)(\n|$)"
    with server(answer) as made, pytest.raises(PolicyError, match=says):
        evaluate(TASK, made.url, OBJECTS[:1], 1)  # 200 steps: a busy machine brings some of them late


def test_a_slow_server() -> None:
    def answer(seen: dict[str, Any]) -> Any:
        time.sleep(9.0 if seen["step"] == 2 else 0.0)
        return {"actions": ZEROS}

    says = rf": no action within 4 s {AT}"
    with server(answer) as made, pytest.raises(PolicyError, match=says):
        play(made.url, step_timeout_s=4)


def test_a_server_that_does_not_read() -> None:
    """A full cloud is larger than what the system keeps for a reader."""
    halt = threading.Event()

    def handle(connection: Any) -> None:
        connection.recv_bufsize = 1
        connection.send(pack({"obs_mode": "pointcloud", "control_mode": "joint"}))
        with connection.recv_flow_control:  # its thread reads no more
            halt.wait(300)

    listening = serve(handle, "127.0.0.1", 0, compression=None, max_size=None)
    thread = threading.Thread(target=listening.serve_forever)
    thread.start()
    url = f"ws://127.0.0.1:{listening.socket.getsockname()[1]}"
    begin = time.monotonic()
    try:
        with pytest.raises(PolicyError, match=r"(does not read an observation|no action) within 1 s \(object cab"):
            evaluate(TASK, url, OBJECTS[:1], 1, step_timeout_s=1.0)
    finally:
        halt.set()
        listening.shutdown()
        thread.join()
    assert time.monotonic() - begin < 120


@pytest.mark.parametrize(
    ("metadata", "says"),
    [
        (None, "no metadata within 0.5 s$"),
        ("Traceback\nOSError: no weights\n", "the policy failed: OSError: no weights(\n|$)"),
        (b"\x93", r"it sends a message that is not msgpack \(ValueError\)$"),
        ({"points": "many"}, "its metadata: 'points' must be int .*'many'"),
        ({"artiskill": 7}, "its metadata: version 7 of our keys; this is version 1"),
        (STATE | {"obs_mode": "clouds"}, "its metadata: unknown obs_mode 'clouds'"),
        (STATE | {"control_mode": "torque"}, "its metadata: unknown control_mode 'torque'"),
        (
            STATE | {"observation_config": {"episode_steps": 9}},
            "its metadata: unknown section of observation_config 'episode_steps'",
        ),
        (STATE | {"obs_mode": "pointcloud", "frame": "moon"}, "its points: unknown frame 'moon'"),
        (
            STATE | {"obs_mode": "pointcloud", "points": 9, "method": "nearest"},
            "its points: unknown sampling method 'nearest'",
        ),
    ],
)
def test_faults_at_the_first_look(metadata: Any, says: str) -> None:
    with server(metadata=metadata) as made, pytest.raises(PolicyError, match=f"^{made.url}: {says}"):
        play(made.url, load_timeout_s=0.5)


def test_another_policy_since() -> None:
    with server() as made:
        plan = plan_evaluation(TASK, made.url, OBJECTS[:1], 1, config=SHORT)
        made._metadata = STATE | {"replan_steps": 2}
        with pytest.raises(PolicyError, match=f"^{made.url}: its metadata changed since the first connection"):
            run_evaluation(plan)


@pytest.fixture
def certified(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ssl.SSLContext:
    """Return what a server needs for TLS, with a certificate that this process trusts."""
    if shutil.which("openssl") is None:
        pytest.skip("openssl makes the certificate")
    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    names = ["-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1"]
    made_by = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", *names]
    subprocess.run([*made_by, "-keyout", key, "-out", certificate], check=True, capture_output=True)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificate, key)
    monkeypatch.setenv("SSL_CERT_FILE", str(certificate))
    return context


def test_over_tls(certified: ssl.SSLContext, monkeypatch: pytest.MonkeyPatch) -> None:
    with server(ssl=certified) as made:
        url = made.url.replace("ws:", "wss:")
        assert play(url).total.episodes == 1
        monkeypatch.delenv("SSL_CERT_FILE")
        with pytest.raises(PolicyError, match=f"^{url}: no connection: .*certificate"):
            play(url)
    assert made.received[-1], "observations came through"


def test_tls_connections_stand_every_time(certified: ssl.SSLContext) -> None:
    certified.num_tickets = 20  # they arrive while the client's request is sent, which OpenSSL does not bear
    with server(ssl=certified) as made, ThreadPoolExecutor(4) as threads:
        url = made.url.replace("ws:", "wss:")

        def ask(_: int) -> str | None:
            return ask_metadata(RemotePolicy(url, connect_timeout_s=10)).obs_mode

        assert list(threads.map(ask, range(100))) == ["state"] * 100


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port: int = probe.getsockname()[1]
        return port


def test_refused() -> None:
    url = f"ws://127.0.0.1:{free_port()}"
    with pytest.raises(PolicyError, match=f"^{url}: no connection: Connection refused$"):
        play(url)
    with server() as made:
        plan = plan_evaluation(TASK, made.url, OBJECTS[:1], 1, config=SHORT)
    with pytest.raises(PolicyError, match=f"^{made.url}: no connection: Connection refused"):
        run_evaluation(plan)


def test_http_says_no() -> None:
    says = "HTTP status 401; its key goes into the environment variable ARTISKILL_API_KEY"
    with (
        server(process_request=lambda connection, request: connection.respond(401, "no\n")) as made,
        pytest.raises(PolicyError, match=says),
    ):
        play(made.url)


@pytest.mark.parametrize("says", [b"SSH-2.0-OpenSSH_9.6\r\n", b"", b"HTTP/1.1 200 OK\r\n\r\n", bytes(5000)])
def test_no_websocket(says: bytes) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def greet() -> None:
            for _ in range(1):
                connection, _address = listening.accept()
                with connection:
                    connection.recv(1000)
                    connection.sendall(says)

        thread = threading.Thread(target=greet)
        thread.start()
        with pytest.raises(
            PolicyError, match=r"no connection: (what answers there speaks no WebS|it answers with HTTP)"
        ):
            play(f"ws://127.0.0.1:{listening.getsockname()[1]}")
        thread.join()


def test_silence() -> None:
    says = r"no connection within 0\.3 s$"
    with socket.create_server(("127.0.0.1", 0)) as listening, pytest.raises(PolicyError, match=says):
        play(f"ws://127.0.0.1:{listening.getsockname()[1]}", load_timeout_s=0.3)


@pytest.mark.parametrize(
    "url", ["ws://", "ws://:8000", "ws://host:port", "ws://host:99999", "ws://host/#a", "WS://[::1"]
)
def test_no_address(url: str) -> None:
    with pytest.raises(PolicyError, match="is no address of a policy's server, such as ws://localhost:8000"):
        play(url)


def test_no_passwords() -> None:
    with pytest.raises(PolicyError, match=r"no passwords in addresses, .* variable ARTISKILL_API_KEY") as caught:
        play("ws://me:secret@host:8000")
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize("wrong", [{"points": 0}, {"replan_steps": 0}, {"frame": "moon"}, {"step_timeout_s": 0.0}])
def test_illegal_wishes(wrong: dict[str, Any]) -> None:
    with pytest.raises(ArtiSkillError):
        RemotePolicy("ws://localhost", **wrong)


def test_illegal_limit() -> None:
    with server() as made, pytest.raises(ConfigError, match="time limit per step must be a positive number"):
        play(made.url, step_timeout_s=-1)


def test_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for library in ("msgpack", "websockets.sync.client"):
        with monkeypatch.context() as patch:
            patch.setitem(__import__("sys").modules, library, None)
            with pytest.raises(MissingExtraError, match=r"pip install 'artiskill\[remote\]'"):
                play("ws://localhost:1")
