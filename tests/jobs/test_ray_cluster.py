import socket
import sys
from importlib.machinery import ModuleSpec
from types import ModuleType

import pytest

from artiskill.errors import ClusterError, ConfigError, MissingExtraError, UnknownNameError
from artiskill.jobs.ray_cluster import RayCluster


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if Ray were installed."""
    ray = ModuleType("ray")
    ray.__spec__ = ModuleSpec("ray", None)
    monkeypatch.setitem(sys.modules, "ray", ray)


@pytest.mark.parametrize(
    ("address", "parts"),
    [
        ("10.0.0.1:6379", ("10.0.0.1", 6379)),
        ("head.example:1", ("head.example", 1)),
        ("[::1]:6379", ("::1", 6379)),
        ("auto", None),
        ("local", None),
    ],
)
def test_legal_addresses(address: str, parts: tuple[str, int] | None) -> None:
    assert RayCluster(address).host_and_port == parts


@pytest.mark.parametrize(
    "address", ["", "10.0.0.1", ":6379", "head:", "head:0", "head:65536", "head:-1", "head:²"]
)
def test_illegal_addresses(address: str) -> None:
    with pytest.raises(UnknownNameError, match=r"unknown address of a Ray cluster .*HOST:PORT, auto, local"):
        RayCluster(address)


def test_errors_name_what_is_nearest() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'local'"):
        RayCluster("lokal")
    with pytest.raises(
        ConfigError, match="Ray Client, which is not supported: run this on a machine of the cluster"
    ):
        RayCluster("ray://head:10001")


@pytest.mark.parametrize("most", [0, -1, 1.5, True])
def test_illegal_numbers(most: int) -> None:
    with pytest.raises(ConfigError, match="workers must be a whole number of at least 1"):
        RayCluster("auto", most)


def test_without_ray(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'artiskill\[distributed\]'"):
        RayCluster("auto").check()


@pytest.mark.usefixtures("installed")
def test_somebody_must_answer() -> None:
    RayCluster("auto").check()  # only Ray knows
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"127.0.0.1:{server.getsockname()[1]}"
        RayCluster(address).check()
    with pytest.raises(ClusterError, match=rf"no Ray cluster at '{address}': Connection refused"):
        RayCluster(address).check()
