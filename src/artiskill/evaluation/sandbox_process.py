"""The program that a solution's process begins with: it confines itself, and says what it can still do.

It is started as a script (`sandbox.SandboxedProcess`), is told on its standard input what to do, and becomes
`solution_process` when it is done. It runs before NumPy is imported, because Landlock holds for one thread only.

Landlock (Linux 5.13) limits files, and later also signals and sockets; a seccomp filter takes away system calls.
Constants are those of the kernel's headers `linux/landlock.h`, `linux/seccomp.h` and `asm/unistd.h`.
"""

import ctypes
import errno
import importlib.util
import json
import mmap
import os
import platform
import resource
import signal
import socket
import struct
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

NETWORK, FILES, MEMORY, PROCESSES, PRIVILEGES = "network", "files", "memory", "processes", "privileges"
_MOST_DESCRIPTORS = 4096  # each may hold memory of the kernel
OPEN = "possible"  # of what a confined process should not be able to do

_PR_SET_SECCOMP, _PR_SET_NO_NEW_PRIVS, _PR_GET_NO_NEW_PRIVS, _SECCOMP_MODE_FILTER = 22, 38, 39, 2
_CAPABILITIES_VERSION = 0x20080522
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446  # of Landlock, the same on every processor
_PATH_BENEATH, _GET_VERSION = 1, 1
_EXECUTE, _WRITE, _READ, _LIST, _TRUNCATE, _IOCTL = 1 << 0, 1 << 1, 1 << 2, 1 << 3, 1 << 14, 1 << 15
_OF_FILES = _EXECUTE | _WRITE | _READ | _TRUNCATE | _IOCTL  # what a rule for one file may say
_RIGHTS = {1: 13, 2: 14, 3: 15, 4: 15, 5: 16}  # version of Landlock -> how many of these bits it knows
_NET_VERSION, _TCP, _SCOPE_VERSION, _SCOPES = 4, 0b11, 6, 0b11  # scopes: abstract sockets, signals

_AUDIT_ARCH = {"x86_64": 0xC000003E, "aarch64": 0xC00000B7}
_X32 = 0x40000000  # numbers from here on are those of the x32 interface
# system call -> its number on x86-64, and on ARM; None where there is none
_CALLS: Mapping[str, tuple[int | None, int | None]] = {
    "clone": (56, 220), "clone3": (435, 435), "mmap": (9, 222), "socketpair": (53, 199), "fcntl": (72, 25),
    "ioctl": (16, 29),
    "kill": (62, 129), "tgkill": (234, 131), "prlimit64": (302, 261), "setpriority": (141, 140),
    "sched_setaffinity": (203, 122), "sched_setparam": (142, 118), "sched_setscheduler": (144, 119),
    "sched_setattr": (314, 274), "socket": (41, 198), "connect": (42, 203), "bind": (49, 200),
    "listen": (50, 201), "fork": (57, None), "vfork": (58, None), "tkill": (200, 130),
    "rt_sigqueueinfo": (129, 138), "rt_tgsigqueueinfo": (297, 240), "pidfd_send_signal": (424, 424),
    "pidfd_open": (434, 434), "pidfd_getfd": (438, 438), "ptrace": (101, 117), "process_vm_readv": (310, 270),
    "process_vm_writev": (311, 271), "kcmp": (312, 272), "ioprio_set": (251, 30), "migrate_pages": (256, 238),
    "move_pages": (279, 239), "process_madvise": (440, 440), "shmget": (29, 194), "semget": (64, 190),
    "msgget": (68, 186), "mq_open": (240, 180), "add_key": (248, 217), "request_key": (249, 218),
    "keyctl": (250, 219), "io_uring_setup": (425, 425), "memfd_create": (319, 279), "memfd_secret": (447, 447),
    "userfaultfd": (323, 282), "bpf": (321, 280), "perf_event_open": (298, 241), "unshare": (272, 97),
    "setns": (308, 268), "mount": (165, 40), "umount2": (166, 39), "open_tree": (428, 428),
    "move_mount": (429, 429), "fsopen": (430, 430), "mount_setattr": (442, 442), "open_by_handle_at": (304, 265),
    "chmod": (90, None), "fchmod": (91, 52), "fchmodat": (268, 53), "fchmodat2": (452, 452), "chown": (92, None),
    "lchown": (94, None), "fchown": (93, 55), "fchownat": (260, 54), "utime": (132, None), "utimes": (235, None),
    "futimesat": (261, None), "utimensat": (280, 88), "setxattr": (188, 5), "lsetxattr": (189, 6),
    "fsetxattr": (190, 7), "removexattr": (197, 14), "lremovexattr": (198, 15), "fremovexattr": (199, 16),
    "setsid": (112, 157), "setpgid": (109, 154), "inotify_init": (253, None), "inotify_init1": (294, 26),
    "fanotify_init": (300, 262),
}  # fmt: skip
_OF_OWN_PROCESS = (
    *("kill", "tgkill", "prlimit64"),
    *("sched_setaffinity", "sched_setparam", "sched_setscheduler", "sched_setattr"),
)
_LOAD, _EQUAL, _AT_LEAST, _ANY_BIT, _AND, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x54, 0x06  # of the filter's machine
_NUMBER, _ARCH, _ARGUMENTS = 0, 4, 16  # offsets in what a filter sees
_ALLOW, _FAIL = 0x7FFF0000, 0x00050000
_CLONE_THREAD, _SHARED_ANONYMOUS, _GROWS_DOWN, _STREAM, _TYPE_BITS = 0x10000, 0x21, 0x100, 1, 0xF
# whom the kernel signals of a descriptor, and with what; leases and watches: F_SETOWN, F_SETSIG, F_SETOWN_EX,
# F_SETLEASE, F_NOTIFY, and a second way to the first of them: FIOSETOWN, SIOCSPGRP
_FCNTL_REFUSED, _IOCTL_REFUSED = (8, 10, 15, 1024, 1026), (0x8901, 0x8902)


def main(handle: int) -> None:
    """Confine this process, look around, and go on as `solution_process`.

    Args:
        handle: of the socket to the evaluator.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the evaluator's business
    spec = json.load(sys.stdin)
    with open(os.devnull) as nothing:
        os.dup2(nothing.fileno(), 0)
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    sys.path[:] = spec["path"]
    failures = confine(spec)
    found = {"found": look_around(spec), "failures": failures}
    program = importlib.util.spec_from_file_location("solution_process", spec["program"])
    assert program is not None
    assert program.loader is not None
    module = importlib.util.module_from_spec(program)
    sys.modules["solution_process"] = module  # dataclasses and pickling look their modules up
    program.loader.exec_module(module)
    module.main(handle, json.dumps(found).encode())


def confine(spec: Mapping[str, Any]) -> list[str]:
    """Do what is asked as far as it can be done, and return what could not.

    Args:
        spec: `memory` and `file_size` in bytes or None, `landlock` with `read`, `list` and `write`, or None, and
            `filter`, whether system calls are taken away.
    """
    failures = []
    steps: list[tuple[str, Callable[[], None]]] = []
    if spec["memory"] is not None:
        steps.append(("limits", lambda: _set_limits(spec["memory"], spec["file_size"])))
    if spec["landlock"] is not None:
        steps += [("capabilities", _drop_capabilities), ("no_new_privs", _forbid_new_privileges)]
        steps.append(("Landlock", lambda: _restrict_files(**spec["landlock"])))
    if spec["filter"]:
        steps += [("no_new_privs", _forbid_new_privileges), ("seccomp", _filter_calls)]
    for name, step in steps:
        try:
            step()
        except OSError as error:
            failures.append(f"{name}: {error.strerror or error}")
    return failures


def _set_limits(memory: int, file_size: int) -> None:
    """Limit this process; `RLIMIT_DATA` counts what it may write to, not what it has reserved, as CUDA does."""
    for kind, most in (
        (resource.RLIMIT_DATA, memory),
        (resource.RLIMIT_FSIZE, file_size),
        (resource.RLIMIT_CORE, 0),
        (resource.RLIMIT_NOFILE, _MOST_DESCRIPTORS),
    ):
        hard = resource.getrlimit(kind)[1]
        most = most if hard == resource.RLIM_INFINITY else min(most, hard)
        try:
            resource.setrlimit(kind, (most, most))
        except ValueError as error:
            raise OSError(errno.EINVAL, str(error)) from error


def _drop_capabilities() -> None:
    header, none = struct.pack("Ii", _CAPABILITIES_VERSION, 0), bytes(24)
    _checked(_libc().capset(header, none))


def _forbid_new_privileges() -> None:
    _checked(_libc().prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0))


def _libc() -> ctypes.CDLL:
    if not sys.platform.startswith("linux"):
        raise OSError(errno.ENOSYS, f"{sys.platform} has no such thing")
    return ctypes.CDLL(None, use_errno=True)


def _checked(result: int) -> int:
    if result < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return result


# -- Landlock -----------------------------------------------------------------------------------------------------


def _restrict_files(read: Sequence[str], names: Sequence[str], write: Sequence[str]) -> None:
    """Let this thread, and those that it will start, use these paths only.

    Args:
        read: files and folders to read and execute, with all that is in them.
        names: folders of which only the names of what is in them may be read.
        write: files and folders for any use, with all that is in them.
    """
    libc = _libc()
    version = _checked(libc.syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), _GET_VERSION))
    every = (1 << _RIGHTS[min(version, max(_RIGHTS))]) - 1
    attributes = struct.pack("QQQ", every, _TCP * (version >= _NET_VERSION), _SCOPES * (version >= _SCOPE_VERSION))
    size = 24 if version >= _SCOPE_VERSION else 16 if version >= _NET_VERSION else 8
    ruleset = _checked(libc.syscall(_CREATE_RULESET, attributes, ctypes.c_size_t(size), 0))
    for paths, rights in ((read, _EXECUTE | _READ | _LIST), (names, _LIST), (write, every)):
        for path in paths:
            _allow(libc, ruleset, path, rights & every)
    _checked(libc.syscall(_RESTRICT_SELF, ruleset, 0))
    os.close(ruleset)


def _allow(libc: ctypes.CDLL, ruleset: int, path: str, rights: int) -> None:
    try:
        handle = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except OSError:  # what is not there needs no leave
        return
    try:
        rights &= ~0 if os.path.isdir(path) else _OF_FILES
        rule = struct.pack("=Qi", rights, handle)
        _checked(libc.syscall(_ADD_RULE, ruleset, _PATH_BENEATH, rule, 0))
    finally:
        os.close(handle)


# -- the filter of system calls -----------------------------------------------------------------------------------


def _filter_calls() -> None:
    """Take away system calls: sockets, other processes, and memory that no limit counts.

    Threads can be started, and `socketpair` makes pairs of streams: they lead to nobody else.
    """
    machine = platform.machine()
    if machine not in _AUDIT_ARCH:
        raise OSError(errno.ENOSYS, f"no filter is known for {machine}")
    program = b"".join(struct.pack("=HBBI", *step) for step in _filter_program(machine, os.getpid()))
    buffer = ctypes.create_string_buffer(program)
    described = struct.pack("HL", len(program) // 8, ctypes.addressof(buffer))
    _checked(_libc().prctl(_PR_SET_SECCOMP, _SECCOMP_MODE_FILTER, described, 0, 0))


def _filter_program(machine: str, pid: int) -> list[tuple[int, int, int, int]]:
    """Return the steps of a filter: operation, how many to jump over if true and if false, and a number."""
    column = list(_AUDIT_ARCH).index(machine)
    numbers = [(name, both[column]) for name, both in _CALLS.items()]
    refuse, ignore = (_RETURN, 0, 0, _FAIL | errno.EPERM), (_RETURN, 0, 0, _ALLOW)
    special: dict[str, list[tuple[int, int, int, int]]] = {
        "clone": [_load(0), (_ANY_BIT, 1, 0, _CLONE_THREAD), refuse, ignore],
        "clone3": [
            (_RETURN, 0, 0, _FAIL | errno.ENOSYS)
        ],  # its flags cannot be seen; C libraries then use `clone`
        "mmap": [  # memory that `RLIMIT_DATA` does not count
            *(_load(3), (_ANY_BIT, 2, 0, _GROWS_DOWN)),
            *((_AND, 0, 0, _SHARED_ANONYMOUS), (_EQUAL, 0, 1, _SHARED_ANONYMOUS)),
            *((_RETURN, 0, 0, _FAIL | errno.ENOMEM), ignore),
        ],
        "fcntl": _refuse_any(_FCNTL_REFUSED),
        "ioctl": _refuse_any(_IOCTL_REFUSED),
        "socketpair": [_load(1), (_AND, 0, 0, _TYPE_BITS), (_EQUAL, 1, 0, _STREAM), refuse, ignore],
    }
    for name in _OF_OWN_PROCESS:
        zero = 0 if name in ("kill", "tgkill") else 1  # which `kill` takes for the process group
        test = [(_EQUAL, 2, 0, pid), (_EQUAL, zero, 0, 0), refuse, ignore]
        special[name] = [_load(0), *test]
    steps = [(_LOAD, 0, 0, _ARCH), (_EQUAL, 1, 0, _AUDIT_ARCH[machine]), refuse, (_LOAD, 0, 0, _NUMBER)]
    if machine == "x86_64":
        steps += [(_AT_LEAST, 0, 1, _X32), refuse]
    for name, number in numbers:
        block = special.get(name, [refuse])
        steps += [] if number is None else [(_EQUAL, 0, len(block), number), *block]
    return [*steps, ignore]


def _refuse_any(commands: Sequence[int]) -> list[tuple[int, int, int, int]]:
    """Return the steps that refuse some values of a call's second argument."""
    tests = [(_EQUAL, len(commands) - k, 0, command) for k, command in enumerate(commands)]
    return [_load(1), *tests, (_RETURN, 0, 0, _ALLOW), (_RETURN, 0, 0, _FAIL | errno.EPERM)]


def _load(argument: int) -> tuple[int, int, int, int]:
    """Return the step that loads the lower half of an argument."""
    return _LOAD, 0, 0, _ARGUMENTS + 8 * argument


# -- what can still be done ---------------------------------------------------------------------------------------


def look_around(spec: Mapping[str, Any]) -> dict[str, dict[str, str]]:
    """Try what a confined process should not be able to do.

    Args:
        spec: what to try it with: `secret`, a file of the evaluator, whose number is `evaluator`; `is_namespace`,
            whether processes have other numbers here; `own`, the solution file; `tcp`, a port, and `unix`, names
            of sockets, at which the evaluator listens.

    Returns:
        what -> attempt -> `OPEN`, or how it failed.
    """
    attempts: dict[str, dict[str, Callable[[], object]]] = {
        NETWORK: {
            "connect to 127.0.0.1": lambda: _connect(socket.AF_INET, ("127.0.0.1", spec["tcp"])),
            "find a way to another machine": _route,
            "connect to a Unix socket": lambda: _connect(socket.AF_UNIX, spec["unix"][0]),
            "connect to an abstract socket": lambda: _connect(socket.AF_UNIX, spec["unix"][-1]),
        },
        FILES: {
            "read a file of the evaluator": lambda: _open(spec["secret"], os.O_RDONLY),
            "write to a file of the evaluator": lambda: _open(spec["secret"], os.O_WRONLY),
            "write to the solution file": lambda: _open(spec["own"], os.O_WRONLY),
            "change the machine's settings": lambda: _open("/proc/sys/kernel/core_pattern", os.O_WRONLY),
            "open the evaluator's memory": lambda: _open_memory(spec["evaluator"], spec["is_namespace"]),
        },
        MEMORY: {"reserve more than the limit": lambda: _reserve(spec["memory"])},
        PROCESSES: {"start a process": _fork},
        PRIVILEGES: {"gain privileges by a program": _can_gain_privileges},
    }
    return {what: {name: _outcome(attempt) for name, attempt in ways.items()} for what, ways in attempts.items()}


def _outcome(attempt: Callable[[], object]) -> str:
    try:
        attempt()
    except OSError as error:
        return errno.errorcode.get(error.errno or 0, type(error).__name__)
    return OPEN


def _connect(family: int, address: Any) -> None:
    with socket.socket(family, socket.SOCK_STREAM) as found:
        found.settimeout(1.0)
        found.connect(address)


def _route() -> None:
    """Ask for a way to another machine; nothing is sent. The address is one for documents (RFC 5737)."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as found:
        found.connect(("192.0.2.1", 9))


def _open(path: str, flags: int) -> None:
    os.close(os.open(path, flags))


def _open_memory(pid: int, is_namespace: bool) -> None:
    if is_namespace and pid in (os.getpid(), os.getppid()):  # numbers begin anew there
        raise ProcessLookupError(errno.ESRCH, "another process")
    _open(f"/proc/{pid}/mem", os.O_RDONLY)


def _reserve(count: int | None) -> None:
    if count is not None:
        mmap.mmap(-1, count, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS).close()


def _fork() -> None:
    pid = os.fork()
    if pid == 0:
        os._exit(0)
    os.waitpid(pid, 0)


def _can_gain_privileges() -> None:
    if sys.platform.startswith("linux") and _libc().prctl(_PR_GET_NO_NEW_PRIVS, 0, 0, 0, 0) == 1:
        raise PermissionError(errno.EPERM, "no_new_privs")


if __name__ == "__main__":
    main(int(sys.argv[1]))
