"""The evaluator's end of a solution's process: frames that come in time, or a fault that says what went wrong.

What comes from there is checked as what a stranger sends; the other end is `solution_process`.
"""

import math
import select
import signal
import socket
import subprocess
import time
from pathlib import Path

from artiskill.errors import ConfigError
from artiskill.evaluation import solution_process as wire
from artiskill.evaluation.sandbox import (
    Confinement,
    SandboxConfig,
    SandboxedProcess,
    SandboxError,
    check_confinement,
)
from artiskill.evaluation.solution_process import SolutionError
from artiskill.files import parse_json

MOST_SAID = 100_000  # bytes of a frame that is not an action
BROKEN = "its process does not keep to the protocol"
_MOST_AT_ONCE = 4096  # bytes: an answer has some hundred
_MOST_TEXT, _MOST_LINES = 500, 10_000_000  # characters of what it complains of; lines of its file
_ENDING_S = 1.0  # for a process whose socket is closed
_NOW = socket.MSG_DONTWAIT | getattr(socket, "MSG_NOSIGNAL", 0)  # macOS has none, and needs none


def open_process(path: Path, sandbox: SandboxConfig) -> tuple["SolutionChannel", Confinement]:
    """Start a solution's process under the best kind of confinement that holds; its code has not been run.

    Raises:
        ConfigError: none of those that were asked for holds.
    """
    passed_over: dict[str, str] = {}
    for kind in sandbox.kinds:
        process = None
        try:
            process = SolutionChannel(SandboxedProcess(path, kind, sandbox))
            said = process.ask(wire.CONFINE, b"", wire.CONFINED, MOST_SAID)
            process.settled()
            return process, check_confinement(kind, sandbox, said, passed_over)
        except SandboxError as error:
            passed_over[kind] = str(error)
        except SolutionError as error:
            passed_over[kind] = process.last_words() or error.text if process is not None else error.text
        if process is not None:
            process.end()
    kind, why = list(passed_over.items())[-1]
    raise ConfigError(f"sandbox {kind!r} does not hold here: {why}; leave the choice out for the best that does")


class SolutionChannel:
    """The evaluator's end of a solution's process; what it sends is read with care, and never unpickled."""

    def __init__(self, sandboxed: SandboxedProcess) -> None:
        self._sandboxed, self._channel, self._process = sandboxed, sandboxed.channel, sandboxed.process
        self.end, self.settled, self.last_words = sandboxed.end, sandboxed.settled, sandboxed.last_words
        self._poll = select.poll()
        self._poll.register(self._channel, select.POLLIN | select.POLLOUT)
        self._readable = select.poll()
        self._readable.register(self._channel, select.POLLIN)
        self._end_s = math.inf

    def ask(self, kind: bytes, body: bytes, answer: bytes, most_bytes: int, limit_s: float = math.inf) -> bytes:
        """Send a frame and return the content of the answer.

        Args:
            kind: of the frame.
            body: its content.
            answer: the kind of frame that must come back.
            most_bytes: that it may have.
            limit_s: in which it must have come.

        Raises:
            TimeoutError: it has not; nothing more can be asked.
            SolutionError: the policy reports a fault, the process has ended, or it does not keep to the protocol.
        """
        self._end_s = time.monotonic() + limit_s
        try:
            self._send(wire.HEADER.pack(kind, len(body)) + body)
            return self._receive(answer, most_bytes)
        except (BrokenPipeError, ConnectionResetError):
            raise SolutionError(self._how_it_ended()) from None

    def _send(self, frame: bytes) -> None:
        """Send a frame to a process that must listen now: one that talks instead would have both wait forever."""
        while True:
            if self._wait(self._poll) & ~select.POLLOUT:
                self._check_silent()
            sent = self._channel.send(frame, _NOW)
            if sent == len(frame):
                return
            frame = frame[sent:]

    def _wait(self, poll: select.poll) -> int:
        """Wait for the socket, but not beyond the time limit, and return what has become of it."""
        rest_s = self._end_s - time.monotonic()
        events = poll.poll(None if rest_s == math.inf else max(0.0, rest_s * 1000.0))
        if not events:
            raise TimeoutError
        return events[0][1]

    def _check_silent(self) -> None:
        said = self._channel.recv(wire.HEADER.size, socket.MSG_PEEK | socket.MSG_DONTWAIT)
        raise SolutionError(f"{BROKEN}: it talks before it is asked" if said else self._how_it_ended())

    def _receive(self, answer: bytes, most_bytes: int) -> bytes:
        """Read a frame: no byte more than it may have."""
        found = self._read(b"", wire.HEADER.size)
        kind, length = wire.HEADER.unpack_from(found)
        if kind not in (answer, wire.FAULT):
            raise SolutionError(f"{BROKEN}: it answers {kind!r}, not {answer!r}")
        if length > (most_bytes if kind == answer else MOST_SAID):
            raise SolutionError(f"{BROKEN}: it answers with {length} bytes, at most {most_bytes} are legal")
        body = self._read(found[wire.HEADER.size :], length)
        if len(body) > length:
            raise SolutionError(f"{BROKEN}: it talks on after its answer")
        if kind == wire.FAULT:
            raise _reported(body)
        return body

    def _read(self, found: bytes, count: int) -> bytes:
        """Return at least so many bytes, of which some may have come already."""
        while len(found) < count:
            self._wait(self._readable)
            part = self._channel.recv(_MOST_AT_ONCE)
            if not part:
                raise SolutionError(self._how_it_ended())
            found += part
        return found

    def _how_it_ended(self) -> str:
        """Return the exit status or signal of a process that closed its end."""
        try:
            code = self._sandboxed.exit_code(_ENDING_S)
        except subprocess.TimeoutExpired:
            return f"{BROKEN}: it closed its socket"
        how = f"exit status {code}" if code >= 0 else f"killed by signal {-code}, {signal.strsignal(-code)}"
        return f"its process ended ({how}): the policy ended it, or memory ran out"


def _reported(body: bytes) -> SolutionError:
    """Return the fault that a process reports; a stranger may have written it."""
    try:
        said = parse_json(body)
        text, line, trace = str(said["text"]), said["line"], str(said["traceback"])
    except (ValueError, KeyError, TypeError):
        return SolutionError(f"{BROKEN}: its complaint makes no sense")
    text = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    short = text if len(text) <= _MOST_TEXT else f"{text[: _MOST_TEXT - 3]}..."
    fault = SolutionError(short, line if isinstance(line, int) and 0 < line < _MOST_LINES else None)
    fault.add_note("in the solution's process:\n" + "".join(c for c in trace if c.isprintable() or c == "\n"))
    return fault
