"""A Ray cluster of two nodes on this machine, in a process of its own, which Ray may take over."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path


class TwoNodes:
    """The cluster, from outside.

    Args:
        root: the checkout; nodes find modules with tests in it.
        head_cpus: of the first node; the second one has one.

    Attributes:
        address: of the cluster.
    """

    def __init__(self, root: Path, head_cpus: int = 1) -> None:
        command = [sys.executable, __file__, str(head_cpus)]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
        environment = os.environ | {"PYTHONPATH": str(root)}
        self._process = subprocess.Popen(command, text=True, env=environment, **pipes)
        self.address = self._read()
        self.raylets = [int(number) for number in self._read().split()]

    def kill(self, node: int) -> None:
        """Have all processes of a node killed at once when a job is under way there; does not wait for it."""
        assert self._process.stdin is not None
        print(node, file=self._process.stdin, flush=True)

    def wait_until_killed(self) -> None:
        """Until a `kill` has happened."""
        assert self._read() == "killed"

    def close(self) -> None:
        """End the cluster."""
        self._process.communicate()

    def _read(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline().strip()


def main() -> None:
    """Start the cluster, kill the nodes whose numbers are read, end what is left at the end of the input."""
    from ray.cluster_utils import Cluster

    head = {"num_cpus": int(sys.argv[1]), "include_dashboard": False}
    cluster = Cluster(initialize_head=True, head_node_args=head)
    nodes = [cluster.head_node, cluster.add_node(num_cpus=1)]
    raylets = [node.all_processes["raylet"][0].process.pid for node in nodes]
    print(cluster.address, flush=True)
    print(*raylets, flush=True)
    for line in sys.stdin:
        kill(raylets[int(line)])
        print("killed", flush=True)
    cluster.shutdown()


def kill(raylet: int) -> None:
    """Kill a node that is at work."""
    while True:
        processes = dict(children(raylet))
        if any(title.startswith(b"ray::artiskill") for title in processes.values()):
            break
        time.sleep(0.01)
    for process in (raylet, *processes):
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)


def children(parent: int) -> Iterator[tuple[int, bytes]]:
    """Ids and titles of a process's children; Ray says in a title what the process is at."""
    for path in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # it has just ended
            if f"PPid:\t{parent}\n" in (path / "status").read_text():
                yield int(path.name), (path / "cmdline").read_bytes()


if __name__ == "__main__":
    main()
