"""Attacks on an evaluation, each a small solution file: none changes a number.

An attack that hurts only itself, or fails, acts as an innocent policy does; any other ends in one clear error. The
attackers know more than a stranger would: every path, port and number that they could want is in a module beside
them. What depends on a confinement is tried under every kind that this machine has.
"""

import functools
import os
import re
import socket
import sysconfig
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

from artiskill.errors import ArtiSkillError, ConfigError, PolicyError
from artiskill.evaluation.evaluate import evaluate
from artiskill.evaluation.sandbox import BUBBLEWRAP, LANDLOCK, LIMITS, SANDBOXES, SandboxConfig
from artiskill.evaluation.solution import FileSolution

CONFINED = (BUBBLEWRAP, LANDLOCK)
LIMITED = (*CONFINED, LIMITS)
LEVEL, OBJECT = 803_154_927, "cabinet-0005"

SOLUTION = """
import ctypes, gc, json, mmap, os, signal, socket, struct, subprocess, sys, threading, time
import numpy as np
import known

libc = ctypes.CDLL(None, use_errno=True)

def call(function, *arguments):
    if function(*arguments) < 0:
        raise OSError(ctypes.get_errno(), "refused")

def must_fail(attempt, *arguments):
    try:
        found = attempt(*arguments)
    except (OSError, EOFError, ValueError) as error:
        return error
    raise RuntimeError(f"it worked: {found!r}")

def channel():
    return socket.socket(fileno=os.dup(int(sys.argv[1])))

def frame(kind, body, length=None):
    channel().sendall(struct.pack("=cxxxI", kind, len(body) if length is None else length) + body)

class Policy:
    obs_mode = "state"
    def __init__(self):
        self.count = 0
    def reset(self, observation, info):
        self.info = info
    def act(self, observation):
        self.count += 1
        action = np.sin(observation[:13].astype(float)) * 0.1
        return action if self.count != 2 else self.attack(observation, action)
    def attack(self, observation, action):
        CODE
        return action
"""

SAME = ""  # it acts as if it were innocent
BROKEN = "its process does not keep to the protocol: "
LATE, LONG = r"no action within 2 s", r"its actions took more than 2\.5 s"
ENDED = "its process ended "


@dataclass(frozen=True)
class Attack:
    """What is tried in the second step, what the error says, and under which kinds it can be met."""

    code: str
    says: str = SAME
    kinds: tuple[str, ...] = SANDBOXES
    takes_long: bool = False

    @property
    def times(self) -> dict[str, float]:
        """Limits that it is meant to exceed, and long ones: machines may be busy."""
        own = self.says == LONG
        return {"step_timeout_s": 2.0 if LATE in self.says else 60.0, "episode_timeout_s": 2.5 if own else 120.0}

    @property
    def may_act(self) -> bool:
        return self.says == SAME or self.says.startswith("|")


ATTACKS = {
    # -- what is in its own process
    "garbage collector": Attack(
        "found = [o for o in gc.get_objects() if str(type(o).__module__).startswith(('artiskill.', 'mujoco'))]\n"
        "assert not found and 'artiskill' not in sys.modules, found"
    ),
    "frames": Attack(
        "frame = sys._getframe()\n"
        "while frame:\n"
        "    assert 'level' not in frame.f_locals and 'env' not in frame.f_locals, frame\n"
        "    frame = frame.f_back"
    ),
    "memory has names": Attack(
        "needles = [b'5000-tenibac', b'729451308']  # from behind, or they would find themselves\n"
        "with open('/proc/self/maps') as maps, open('/proc/self/mem', 'rb', 0) as memory:\n"
        "    for line in maps:\n"
        "        first, last = (int(part, 16) for part in line.split()[0].split('-'))\n"
        "        if ' rw' in line and last - first < 1 << 28:\n"
        "            memory.seek(first)\n"
        "            held = memory.read(last - first)[::-1]\n"
        "            assert not any(needle in held for needle in needles), line"
    ),
    "told more than the episode": Attack("assert self.info == {'episode': 0}, self.info"),
    "numpy is another": Attack("np.isfinite = lambda x: np.ones(13, bool)\nreturn np.full(13, np.nan)", BROKEN),
    "numpy counts otherwise": Attack("np.prod = np.frombuffer = np.zeros = None", ENDED),
    "builtins and json": Attack(
        "import builtins\nbuiltins.len = builtins.abs = lambda x: 0\n"
        "json.loads = json.dumps = lambda *a, **k: None",
        f"|{BROKEN}|{ENDED}|raised",
    ),
    "the package is another": Attack(
        "import artiskill.errors as errors\nerrors.PolicyError = type('Solved', (Exception,), {'success': True})"
    ),
    "the program is another": Attack(
        "program = sys.modules['solution_process']\nprogram._send = lambda channel, kind, body: frame(b'o', b'')",
        BROKEN + "it answers b'o'",
    ),
    "tracing": Attack("sys.settrace(lambda *a: None)\nsys.setprofile(lambda *a: os._exit(0))", ENDED),
    "at exit": Attack("import atexit\natexit.register(lambda: frame(b'a', bytes(104)))"),
    "guesses the level by seeds": Attack(
        "mine, first = np.random.get_state(), np.random.RandomState(0).get_state()\n"
        "assert mine[2] == first[2] and (mine[1] == first[1]).all()"
    ),
    # -- what it returns
    "changed afterwards": Attack(
        "threading.Thread(target=lambda: (time.sleep(0.3), action.fill(9.0)), daemon=True).start()"
    ),
    "object array": Attack("return np.array([object()] * 13)", r"returned ndarray, not an array"),
    "array with side effects": Attack(
        "class Evil:\n    def __array__(self, *a, **k):\n        os._exit(0)\nreturn Evil()", ENDED
    ),
    "array that raises": Attack(
        "class Evil:\n    def __array__(self, *a, **k):\n        raise BaseException('x')\nreturn Evil()", ENDED
    ),
    "subclass": Attack(
        "class Evil(np.ndarray):\n    def tobytes(self, *a):\n        return bytes(8)\nreturn action.view(Evil)"
    ),
    "infinite": Attack("return np.full(13, np.inf)", r"act\(\) returned \[inf"),
    # -- lies in the protocol
    "huge length": Attack("frame(b'a', b'', 4_000_000_000)\ntime.sleep(9)", BROKEN + "it answers with 4000000000"),
    "half a frame": Attack("frame(b'a', bytes(50), 104)\ntime.sleep(9)", LATE),
    "drop by drop": Attack(
        "channel().sendall(struct.pack('=cxxxI', b'a', 104))\n"
        "for _ in range(104):\n    channel().sendall(bytes(1))\n    time.sleep(0.2)",
        LATE,
        takes_long=True,
    ),
    "not a number": Attack("frame(b'a', struct.pack('13d', *[float('nan')] * 13))\ntime.sleep(9)", BROKEN),
    "another kind": Attack("frame(b'd', b'null')\ntime.sleep(9)", BROKEN + "it answers b'd'"),
    "two answers": Attack(  # at once: the second would else be the answer to the next question
        "channel().sendall(2 * (struct.pack('=cxxxI', b'a', action.nbytes) + action.tobytes()))\ntime.sleep(9)",
        BROKEN + "it talks ",
    ),
    "talks from a thread": Attack(
        "def talk():\n    while True:\n        frame(b'o', b'')\n"
        "threading.Thread(target=talk, daemon=True).start()\ntime.sleep(0.3)",
        BROKEN,
    ),
    "flood": Attack("while True:\n    channel().sendall(b'a' * 1_000_000)", BROKEN),
    "complaint with a terminal's commands": Attack(
        "frame(b'f', json.dumps({'text': chr(27) + '[2J', 'line': -1, 'traceback': ''}).encode())\ntime.sleep(9)",
        r": \\x1b\[2J ",
    ),
    "descriptors through the socket": Attack(
        "with open(__file__) as file:\n    socket.send_fds(channel(), [b'a'], [file.fileno()] * 3)\ntime.sleep(9)",
        LATE,
        takes_long=True,
    ),
    "closes the socket": Attack("os.close(int(sys.argv[1]))\nos.closerange(3, 99)", f"{ENDED}|{BROKEN}"),
    # -- how it ends, how long it takes, what it eats
    "ends": Attack("os._exit(0)", ENDED + r"\(exit status 0\)"),
    "exits": Attack("sys.exit(0)", r"act\(\) raised SystemExit: 0 \(line \d+, "),
    "kills itself": Attack("os.kill(os.getpid(), signal.SIGKILL)", ENDED + r"\(killed by signal 9"),
    "crashes": Attack("ctypes.string_at(0)", ENDED + r"\(killed by signal 11"),
    "hangs": Attack("while True:\n    pass", LATE),
    "stops itself": Attack("os.kill(os.getpid(), signal.SIGSTOP)", LATE),
    "ignores signals": Attack(
        "for number in (signal.SIGTERM, signal.SIGINT):\n    signal.signal(number, signal.SIG_IGN)\n"
        "time.sleep(99)",
        LATE,
        takes_long=True,
    ),
    "slow in every step": Attack("sin = np.sin\nnp.sin = lambda x: (time.sleep(0.9), sin(x))[1]", LONG),
    "memory": Attack("held = np.ones(10**9)", r"act\(\) raised \w*MemoryError", LIMITED),
    "memory by threads": Attack(
        "def grow(held):\n    while True:\n        held.append(bytearray(10**8))\n"
        "threads = [threading.Thread(target=grow, args=([],), daemon=True) for _ in range(4)]\n"
        "[thread.start() for thread in threads]\n[thread.join() for thread in threads]",
        f"|MemoryError|{ENDED}|{LATE}",
        LIMITED,
    ),
    "shared memory": Attack("must_fail(mmap.mmap, -1, 10**9)", SAME, CONFINED),
    "huge file": Attack(
        "with open(os.environ['TMPDIR'] + '/huge', 'wb') as file:\n    must_fail(file.truncate, 10**11)",
        SAME,
        LIMITED,
    ),
    "prints a report": Attack("os.write(1, b'all solved\\n' * 999)\nprint('report: results/mine')"),
    # -- files
    "reads the report": Attack("must_fail(open, known.REPORT)", SAME, CONFINED),
    "writes the report": Attack("must_fail(open, known.REPORT, 'w')", SAME, CONFINED),
    "removes the report": Attack("must_fail(os.unlink, known.REPORT)", SAME, CONFINED),
    "renames the report": Attack(
        "must_fail(os.rename, known.REPORT, os.environ['TMPDIR'] + '/r')\n"
        "must_fail(os.rename, os.path.dirname(known.REPORT), os.environ['TMPDIR'] + '/r')",
        SAME,
        CONFINED,
    ),
    "changes modes and times": Attack(
        "for path in (known.REPORT, known.CACHE, __file__):\n"
        "    must_fail(os.chmod, path, 0)\n    must_fail(os.utime, path, (0, 0))",
        SAME,
        CONFINED,
    ),
    "reads the cache": Attack("must_fail(open, known.CACHE)", SAME, CONFINED),
    "poisons the cache": Attack(
        "must_fail(open, known.CACHE, 'ab')\nmust_fail(open, known.CACHE + '.new', 'wb')", SAME, CONFINED
    ),
    "poisons files beside it": Attack(
        "must_fail(open, __file__, 'a')\nmust_fail(open, known.__file__, 'a')\n"
        "must_fail(open, os.path.dirname(__file__) + '/numpy.py', 'w')",
        SAME,
        CONFINED,
    ),
    "poisons bytecode": Attack("must_fail(os.mkdir, os.path.dirname(__file__) + '/__pycache__')", SAME, CONFINED),
    "writes into site-packages": Attack(
        "must_fail(open, known.SITE + '/evil.pth', 'w')\nmust_fail(open, np.__file__, 'a')", SAME, CONFINED
    ),
    "reads homes and others' files": Attack(
        "for path in (known.HOME, known.OTHER, '/etc/shadow', '/etc/passwd', '/var/log/dpkg.log'):\n"
        "    must_fail(open, path)",
        SAME,
        CONFINED,
    ),
    "links to the report": Attack(
        "link = os.environ['TMPDIR'] + '/link'\nos.symlink(known.REPORT, link)\nmust_fail(open, link)\n"
        "must_fail(os.link, known.REPORT, link + '2')\n"
        "must_fail(open, '/proc/self/root' + known.REPORT)",
        SAME,
        CONFINED,
    ),
    "the terminal": Attack("must_fail(open, '/dev/tty', 'r+')\nmust_fail(os.ftruncate, 1, 0)", SAME, CONFINED),
    "inherited descriptors": Attack(
        "import stat\n"
        "for name in os.listdir('/proc/self/fd'):\n"
        "    try:\n        held = os.fstat(int(name))\n    except OSError:\n        continue\n"
        "    assert not stat.S_ISREG(held.st_mode) and not os.isatty(int(name)), name\n"
        "assert os.read(0, 1) == b''",
        SAME,
        LIMITED,
    ),
    "variables": Attack(
        "assert 'A_SECRET' not in os.environ\n"
        "with open('/proc/self/environ') as own:\n    assert 'A_SECRET' not in own.read()",
        SAME,
        LIMITED,
    ),
    # -- other processes
    "the parent's memory": Attack(
        "for name in ('mem', 'environ', 'cmdline', 'maps', 'fd/0', 'cwd/known.py'):\n"
        "    must_fail(open, f'/proc/{known.EVALUATOR}/{name}', 'rb')",
        SAME,
        CONFINED,
    ),
    "traces the parent": Attack(
        "must_fail(call, libc.ptrace, 16, known.EVALUATOR, 0, 0)\n"
        "must_fail(call, libc.ptrace, 16, os.getppid(), 0, 0)\n"
        "must_fail(call, libc.process_vm_readv, known.EVALUATOR, None, 0, None, 0, 0)",
        SAME,
        CONFINED,
    ),
    "kills the parent": Attack(
        "for pid in (known.EVALUATOR, os.getppid(), 0, -1, 1):\n"
        "    for number in (0, signal.SIGSTOP, signal.SIGKILL):\n        must_fail(os.kill, pid, number)",
        SAME,
        CONFINED,
    ),
    "slows the parent": Attack(
        "import resource\n"
        "must_fail(resource.prlimit, known.EVALUATOR, resource.RLIMIT_CPU, (1, 1))\n"
        "must_fail(os.setpriority, os.PRIO_PROCESS, known.EVALUATOR, 19)\n"
        "must_fail(os.setpriority, os.PRIO_USER, 0, 19)\n"
        "must_fail(os.sched_setaffinity, known.EVALUATOR, {0})",
        SAME,
        CONFINED,
    ),
    "forks and survives": Attack("must_fail(os.fork)\nmust_fail(os.forkpty)", SAME, CONFINED),
    "fork bomb": Attack("for _ in range(1000):\n    must_fail(os.fork)", SAME, CONFINED),
    "runs programs": Attack(
        "must_fail(subprocess.run, ['true'])\nmust_fail(os.posix_spawn, '/bin/true', ['true'], {})\n"
        "assert os.system('true') != 0",
        SAME,
        CONFINED,
    ),
    "becomes a program": Attack("os.execv('/bin/true', ['true'])", ENDED + r"\(exit status 0\)"),
    "limits are raised": Attack(
        "import resource\nmust_fail(resource.setrlimit, resource.RLIMIT_DATA, (10**12, 10**12))",
        SAME,
        CONFINED,
    ),
    "namespaces and mounts": Attack(
        "must_fail(call, libc.unshare, 0x10000000)\n"
        "must_fail(call, libc.mount, b'none', b'/tmp', b'tmpfs', 0, None)\n"
        "must_fail(os.chroot, '/tmp')",
        SAME,
        CONFINED,
    ),
    # -- ways out, and to what comes after it
    "connects": Attack(
        "must_fail(socket.create_connection, ('127.0.0.1', known.PORT), 1)\nmust_fail(socket.socket)",
        SAME,
        CONFINED,
    ),
    "unix sockets": Attack(
        "for name in known.SOCKETS:\n"
        "    must_fail(lambda: socket.socket(socket.AF_UNIX).connect(name))\n"
        "    one, other = socket.socketpair()\n    must_fail(one.connect, name)\n"
        "    must_fail(one.sendto, b'x', name)\n"
        "must_fail(socket.socketpair, socket.AF_UNIX, socket.SOCK_DGRAM)",
        SAME,
        CONFINED,
    ),
    "messages to later processes": Attack(
        "must_fail(call, libc.shmget, 4711, 4096, 0o1600)\nmust_fail(call, libc.msgget, 4711, 0o1600)\n"
        "must_fail(call, libc.semget, 4711, 1, 0o1600)\nmust_fail(os.memfd_create, 'x')\n"
        "must_fail(call, libc.syscall, 248, b'user', b'x', b'y', ctypes.c_size_t(1), -4)",
        SAME,
        CONFINED,
    ),
    "leaves the group that is ended": Attack(
        "must_fail(os.setsid)\nmust_fail(os.setpgid, 0, 0)\n"
        "libc.prctl(1, 0)",  # PR_SET_PDEATHSIG: not to be told when its parent ends
        SAME,
        CONFINED,
    ),
    "watches files": Attack(
        "must_fail(call, libc.inotify_init1, 0)\nmust_fail(call, libc.syscall, 300, 0, 0)", SAME, CONFINED
    ),
    "other ways to the kernel": Attack(
        "must_fail(call, libc.syscall, 425, 8, bytes(120))\n"
        "must_fail(call, libc.syscall, 321, 0, bytes(120), 120)",
        SAME,
        CONFINED,
    ),
    "complains with a nest": Attack("frame(b'f', b'[' * 90_000)\ntime.sleep(9)", BROKEN + "its complaint makes"),
    "signals by the socket": Attack(  # the kernel sends what a descriptor's owner is told
        "import fcntl\n"
        "for command, target in ((8, known.EVALUATOR), (8, -1), (15, bytes(8)), (10, 9), (1024, 0), (1026, 1)):\n"
        "    must_fail(fcntl.fcntl, int(sys.argv[1]), command, target)\n"
        "for command in (0x8901, 0x8902):\n"
        "    must_fail(fcntl.ioctl, int(sys.argv[1]), command, struct.pack('i', known.EVALUATOR))",
        SAME,
        CONFINED,
    ),
    "memory by /dev/zero": Attack(
        "def reserve():\n    with open('/dev/zero', 'r+b', 0) as zero:\n"
        "        return mmap.mmap(zero.fileno(), 10**10)\nmust_fail(reserve)",
        SAME,
        CONFINED,
    ),
    "memory by a stack": Attack("must_fail(lambda: mmap.mmap(-1, 10**10, flags=0x122))", SAME, CONFINED),
    "memory by many sockets": Attack(
        "import resource\nsoft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)\nassert hard <= 4096, hard",
        SAME,
        LIMITED,
    ),
    "a high exit status": Attack("os._exit(255)", ENDED + r"\(exit status 255\)"),
    "a descriptor of the parent": Attack(  # SO_PEERPIDFD of Linux 6.5 needs no `pidfd_open`
        "try:\n    found = channel().getsockopt(socket.SOL_SOCKET, 77)\nexcept OSError:\n    found = -1\n"
        "must_fail(call, libc.syscall, 424, found, 9, None, 0)\n"
        "must_fail(call, libc.syscall, 438, found, 0, 0)\nmust_fail(call, libc.setns, found, 0)",
        SAME,
        CONFINED,
    ),
    "the parent by its links": Attack(
        "for name in ('exe', 'cwd', 'root', 'fd/0', 'fd/1', 'ns/net', 'task/%d/fd/0' % known.EVALUATOR):\n"
        "    must_fail(os.readlink, f'/proc/{known.EVALUATOR}/{name}')",
        SAME,
        CONFINED,
    ),
    "links beside it": Attack(
        "for name in ('report', 'caches', 'everything'):\n"
        "    link = os.path.join(os.path.dirname(__file__), name)\n    assert os.path.islink(link)\n"
        "    must_fail(open, link if name == 'report' else os.path.join(link, 'kernel'))\n"
        "must_fail(open, os.path.dirname(__file__) + '/everything' + known.OTHER)",
        SAME,
        CONFINED,
    ),
    "the machine's settings": Attack(
        "for path in ('/proc/sys/kernel/core_pattern', '/proc/sysrq-trigger', '/proc/sys/kernel/pid_max',\n"
        "             '/sys/devices/system/cpu/cpu1/online', '/dev/kmsg', '/proc/kcore'):\n"
        "    must_fail(open, path, 'r+')",
        SAME,
        CONFINED,
    ),
    "clocks": Attack(
        "must_fail(time.clock_settime, time.CLOCK_REALTIME, 0.0)\n"
        "time.time = time.monotonic = time.perf_counter = lambda: 0.0",
        SAME,
        CONFINED,
    ),
    "alarms": Attack(
        "signal.signal(signal.SIGALRM, lambda *a: None)\nsignal.setitimer(signal.ITIMER_REAL, 0.001, 0.001)"
    ),
    "bits of numbers": Attack(  # a signalling NaN, as the first of the numbers
        "frame(b'a', struct.pack('Q', 0x7FF0000000000001) + bytes(96))\ntime.sleep(9)", BROKEN
    ),
    "answers another question": Attack("frame(b'o', b'')\ntime.sleep(9)", BROKEN + "it answers b'o', not b'a'"),
    "kept with locks": Attack(
        "import fcntl\nheld = open(__file__)\nfcntl.flock(held, fcntl.LOCK_EX)\n"
        "must_fail(fcntl.fcntl, held.fileno(), 1024, 0)\nself.held = held",
        SAME,
        CONFINED,
    ),
}


# -- what they are tried on ---------------------------------------------------------------------------------------

INNOCENT = Path(__file__).resolve().parents[2] / "examples" / "solution_example.py"


@functools.cache
def why_not(kind: str | None) -> str:
    """Return why a kind of confinement does not hold on this machine; empty if it does."""
    try:
        FileSolution(INNOCENT, sandbox=SandboxConfig(kind)).close()
    except ConfigError as error:
        return str(error)
    return ""


@dataclass(frozen=True)
class World:
    """Files, sockets and variables that an attacker is after."""

    folder: Path
    solution: Path
    report: Path

    def sandbox(self, kind: str | None, attack: Attack) -> SandboxConfig:
        return SandboxConfig(kind, memory_gb=2.0, hidden=(str(self.report.parent),), **attack.times)

    def write(self, code: str) -> None:
        self.solution.write_text(SOLUTION.replace("CODE", code.replace("\n", "\n        ")))

    def content(self) -> dict[str, bytes]:
        """Return all files, but for bytecode, which Python writes unless something confines it."""
        found = [path for path in self.folder.rglob("*") if "__pycache__" not in path.parts]
        return {str(path): path.read_bytes() for path in found if path.is_file()}


@pytest.fixture
def world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[World]:
    names = ("entry/solution.py", "entry/results/report.json", "cache/artiskill/kernel", "home/notes", "other/x")
    solution, report, cache, home, other = (tmp_path / name for name in names)
    for path in (solution, report, cache, home, other):
        path.parent.mkdir(parents=True)
        path.write_text("mine")
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache.parent.parent))
    monkeypatch.setenv("HOME", str(home.parent))
    monkeypatch.setenv("A_SECRET", "level 3")
    with ExitStack() as stack:
        tcp = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        paths = stack.enter_context(TemporaryDirectory(prefix="s")) + "/s", f"\0artiskill-test-{os.getpid()}"
        for name in paths:
            listener = stack.enter_context(socket.socket(socket.AF_UNIX))
            listener.bind(name)
            listener.listen()
        known = {"REPORT": str(report), "CACHE": str(cache), "HOME": str(home), "OTHER": str(other)}
        known |= {"SOCKETS": paths, "SITE": sysconfig.get_paths()["purelib"]}
        known |= {"EVALUATOR": os.getpid(), "PORT": tcp.getsockname()[1]}
        lines = [f"{name} = {value!r}\n" for name, value in known.items()]
        solution.with_name("known.py").write_text("".join(lines))
        for name, target in (("report", report), ("caches", cache.parent), ("everything", Path("/"))):
            solution.with_name(name).symlink_to(target)
        yield World(tmp_path, solution, report)


def act(world: World, kind: str | None, attack: Attack) -> None:
    """Have the solution act in two episodes, and compare with what an innocent one does."""
    rng = np.random.default_rng(3)
    found = FileSolution(world.solution, sandbox=world.sandbox(kind, attack))
    try:
        for _ in range(2):
            observations = rng.normal(size=(4, 40)).astype(np.float32)
            found.reset(observations[0], {"object": OBJECT, "level": LEVEL, "target": "link_1"})
            for observation in observations:
                expected = np.sin(observation[:13].astype(float)) * 0.1
                np.testing.assert_array_equal(found.act(observation, (13,)), expected)
    finally:
        found.close()


def check_complaint(error: ArtiSkillError, attack: Attack) -> None:
    """Check that it is one line which names the file, what went wrong, object, level and step."""
    message = str(error)
    assert isinstance(error, PolicyError), error
    assert attack.says != SAME, f"not refused, or not quietly: {message}"
    assert re.search(attack.says.lstrip("|"), message), message
    where = rf"object {OBJECT}, level ({LEVEL}|{LEVEL + 1}), step \d+"
    assert re.search(rf"solution\.py: .*\(.*{where}\)$", message), message
    assert message.isprintable(), message


def cases(kinds: tuple[str | None, ...], names: Iterable[str]) -> Any:
    pairs = [(name, kind) for name in names for kind in kinds]
    return pytest.mark.parametrize(
        ("name", "kind"), pairs, ids=[f"{name}-{kind or 'best'}" for name, kind in pairs]
    )


def try_attack(world: World, name: str, kind: str | None) -> None:
    if why := why_not(kind):
        pytest.skip(why)
    attack = ATTACKS[name]
    world.write(attack.code)
    before = world.content()
    try:
        act(world, kind, attack)
        assert attack.may_act, f"it acts as if it were innocent, but should have failed with: {attack.says}"
    except ArtiSkillError as error:
        check_complaint(error, attack)
    assert world.content() == before


def names_of(kinds: tuple[str, ...], takes_long: bool = False) -> list[str]:
    return [name for name, one in ATTACKS.items() if one.kinds == kinds and one.takes_long == takes_long]


def test_there_are_enough_of_them() -> None:
    assert len(ATTACKS) >= 85


@cases(CONFINED, names_of(CONFINED))
def test_attacks_on_what_is_outside(world: World, name: str, kind: str) -> None:
    try_attack(world, name, kind)


@cases((None,), [*names_of(SANDBOXES), *names_of(LIMITED)])
def test_attacks(world: World, name: str, kind: None) -> None:
    try_attack(world, name, kind)


@pytest.mark.slow
@cases(SANDBOXES, [*names_of(SANDBOXES), *names_of(SANDBOXES, takes_long=True)])
def test_attacks_under_every_kind(world: World, name: str, kind: str) -> None:
    try_attack(world, name, kind)


@pytest.mark.slow
@cases(LIMITED, names_of(LIMITED))
def test_attacks_under_every_kind_with_limits(world: World, name: str, kind: str) -> None:
    try_attack(world, name, kind)


# -- whole evaluations --------------------------------------------------------------------------------------------


innocents: dict[Any, dict[str, Any]] = {}


def evaluated(world: World, kind: str, attack: Attack) -> dict[str, Any]:
    """Return the report of an evaluation, but for what names the file, and for time."""
    settings = {"first_level": LEVEL, "config": {"episode_steps": 3}}
    report = evaluate(
        "OpenCabinetDrawer", world.solution, OBJECT, 2, **settings, sandbox=world.sandbox(kind, attack)
    )
    played = [(one.level, one.reward_sum, one.digest, one.actions.tobytes()) for one in report.episodes]
    found = report.to_mapping() | {"played": played}
    named = ("timing", "sha256", "policy", "policy_sha256")
    return {key: value for key, value in found.items() if key not in named}


@pytest.mark.slow
@cases(CONFINED, ATTACKS)
def test_reports_after_attacks(world: World, name: str, kind: str) -> None:
    if why := why_not(kind):
        pytest.skip(why)
    attack = ATTACKS[name]
    innocent = innocents.get((kind, str(attack.times)))
    if innocent is None:  # it also compiles the kernels, whose cache is looked at below
        world.write("pass")
        innocent = innocents[kind, str(attack.times)] = evaluated(world, kind, attack)
    world.write(attack.code)
    before = world.content()
    try:
        assert evaluated(world, kind, attack) == innocent
        assert attack.may_act
    except ArtiSkillError as error:
        check_complaint(error, attack)
    assert world.content() == before
