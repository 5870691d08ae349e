"""Where a Ray cluster is, and whether anything can be asked of it; Ray itself is not imported here."""

import importlib.util
import socket
from dataclasses import dataclass

from artiskill.errors import ClusterError, ConfigError, MissingExtraError, UnknownNameError, shown

LOCAL, RUNNING = "local", "auto"
_LEGAL = (LOCAL, RUNNING, "HOST:PORT")
_CLIENT_SCHEME = "ray://"
_MOST_PORT = 65535
_PROBE_S = 5.0


@dataclass(frozen=True)
class RayCluster:
    """A Ray cluster to run jobs on.

    Attributes:
        address: `HOST:PORT` of a cluster that this machine is a node of; `auto`, the cluster that this machine is
            a node of, whatever its address; `local`, one on this machine that is started for the jobs and ended
            with them.
        most_jobs: at a time; None for one per CPU of the cluster, however many that are at the time.

    Raises:
        UnknownNameError: no such address.
        ConfigError: an address of Ray Client, or an illegal number.
    """

    address: str
    most_jobs: int | None = None

    def __post_init__(self) -> None:
        """Check the values."""
        if self.address.startswith(_CLIENT_SCHEME):
            raise ConfigError(
                f"{self.address!r} is an address of Ray Client, which is not supported: run this on a machine "
                f"of the cluster, with {RUNNING!r} as its address"
            )
        if self.address not in (LOCAL, RUNNING) and self.host_and_port is None:
            raise UnknownNameError("address of a Ray cluster", self.address, _LEGAL)
        most = self.most_jobs
        if most is not None and (isinstance(most, bool) or not isinstance(most, int) or most < 1):
            raise ConfigError(f"workers must be a whole number of at least 1, not {shown(most)}")

    @property
    def host_and_port(self) -> tuple[str, int] | None:
        """The parts of an address of that form."""
        host, _, port = self.address.rpartition(":")
        is_port = port.isascii() and port.isdecimal() and len(port) <= 5 and 0 < int(port) <= _MOST_PORT
        return (host.strip("[]"), int(port)) if host and is_port else None

    def check(self) -> None:
        """See whether Ray is installed and, at an address, somebody answers.

        Raises:
            MissingExtraError: Ray is not installed.
            ClusterError: nobody answers.
        """
        if importlib.util.find_spec("ray") is None:
            raise MissingExtraError("work on a Ray cluster", "distributed")
        if self.host_and_port is None:
            return
        try:
            socket.create_connection(self.host_and_port, timeout=_PROBE_S).close()
        except OSError as error:
            raise ClusterError(
                f"no Ray cluster at {self.address!r}: {error.strerror or error}; "
                "its address is what `ray start --head` printed; on a machine of the cluster, --ray auto finds it"
            ) from error
