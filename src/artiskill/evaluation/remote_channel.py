"""A WebSocket to a policy's server: messages go out and come in, each fault is one line."""

import os
import socket
import ssl
import struct
import threading
from typing import Any
from urllib.parse import urlsplit

from artiskill.errors import MissingExtraError
from artiskill.evaluation import wire
from artiskill.evaluation.wire import WireError

LOOPBACKS = ("127.0.0.1", "localhost", "::1")
_CLOSE_S = 1.0
_TOO_BIG = 1009  # WebSocket's status, RFC 6455, section 7.4.1


class RemoteChannel:
    """A WebSocket that is given up as soon as anything goes wrong.

    Args:
        url: `ws://host:port` or `wss://host:port`.
        connect_timeout_s: the time in which it must stand.
        step_timeout_s: the time in which each message must go out.

    Raises:
        WireError: no connection.
        MissingExtraError: websockets or msgpack is not installed.
    """

    def __init__(self, url: str, connect_timeout_s: float, step_timeout_s: float) -> None:
        wire.import_msgpack()
        try:
            import websockets.sync.client as client
        except ImportError as error:
            raise MissingExtraError("a policy behind a WebSocket", wire.EXTRA) from error
        from websockets.exceptions import InvalidStatus, WebSocketException

        key, host = os.environ.get(wire.API_KEY), urlsplit(url).hostname
        try:
            self._socket = client.connect(
                url,
                compression=None,
                additional_headers={"Authorization": f"Api-Key {key}"} if key else None,
                proxy=None if host in LOOPBACKS else True,
                open_timeout=connect_timeout_s,
                close_timeout=_CLOSE_S,
                ping_interval=None,  # a policy that thinks answers no pings
                max_size=wire.MOST_BYTES,
                create_connection=_one_way_at_first(),
            )
        except TimeoutError as error:
            raise WireError(f"no connection within {connect_timeout_s:g} s") from error
        except OSError as error:
            raise WireError(f"no connection: {error.strerror or error}") from error
        except InvalidStatus as error:
            status = error.response.status_code
            hint = f"; its key goes into the environment variable {wire.API_KEY}" if status in (401, 403) else ""
            raise WireError(f"no connection: it answers with HTTP status {status}{hint}") from error
        except (WebSocketException, ValueError, EOFError) as error:
            raise WireError("no connection: what answers there speaks no WebSocket") from error
        whole = int(step_timeout_s)
        limit = struct.pack("ll", whole, int(1e6 * (step_timeout_s - whole)) or 1)
        self._socket.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, limit)
        self._limit_s = step_timeout_s

    def send(self, message: bytes) -> None:
        """Send a message.

        Raises:
            WireError: the connection is lost, the server reads too slowly, or it has sent more than was asked.
        """
        from websockets.exceptions import ConnectionClosed

        self._check_silent()
        try:
            self._socket.send(message)
        except ConnectionClosed as error:
            if isinstance(error.__cause__, BlockingIOError | ssl.SSLWantWriteError):
                raise WireError(f"it does not read an observation within {self._limit_s:g} s") from error
            self._check_silent()
            raise self._lost(error) from error

    def receive(self, what: str, limit_s: float) -> dict[Any, Any]:
        """Return the next message.

        Args:
            what: is waited for.
            limit_s: in which time.

        Raises:
            WireError: it does not come, or is none; or the server says that its policy failed.
        """
        from websockets.exceptions import ConnectionClosed

        try:
            message = self._socket.recv(limit_s)
        except TimeoutError as error:
            raise WireError(f"no {what} within {limit_s:g} s") from error
        except ConnectionClosed as error:
            raise self._lost(error) from error
        if isinstance(message, str):
            raise _failed(message)
        try:
            return wire.unpack(message)
        except WireError as error:
            raise WireError(f"it sends {error}") from error

    def close(self) -> None:
        """Close it; later calls do nothing."""
        self._socket.close()

    def _check_silent(self) -> None:
        """Raise what the server said though nobody asked: that its policy failed, or an answer too many.

        Who took that for the next answer would be one answer late from there on.
        """
        from websockets.exceptions import ConnectionClosed

        try:
            message = self._socket.recv(0)
        except (TimeoutError, ConnectionClosed):
            return
        if isinstance(message, str):
            raise _failed(message)
        raise WireError("it sends an answer that nobody asked for")

    def _lost(self, error: Any) -> WireError:
        """Return the error of a connection that was closed, by either side."""
        if error.sent is not None and error.sent.code == _TOO_BIG:
            return WireError(f"it sends a message of more than {wire.MOST_BYTES} bytes")
        if error.rcvd is None:
            broken = error.sent is not None and not error.rcvd_then_sent
            return WireError(f"it breaks WebSocket's rules ({error.sent.reason})" if broken else "connection lost")
        reason = wire.printable(error.rcvd.reason, 200)
        said = f"status {error.rcvd.code}, {reason}" if reason else f"status {error.rcvd.code}"
        return WireError(f"connection lost: the server closed it ({said})")


def _one_way_at_first() -> type[Any]:
    """Return the connection that reads nothing before its request is sent.

    OpenSSL must not read and write at once, and a server's session tickets come while the request is sent: one of
    65 connections hung or broke. So they are read before the first observation goes out. What a server sends
    unasked later may still meet a write; that was never seen.
    """
    from websockets.sync.client import ClientConnection

    class Connection(ClientConnection):
        def __init__(self, *values: Any, **options: Any) -> None:
            self._is_sent = threading.Event()
            super().__init__(*values, **options)

        def send_data(self) -> None:
            try:
                super().send_data()
            finally:
                self._is_sent.set()

        def close_socket(self) -> None:
            self._is_sent.set()
            super().close_socket()

        def recv_events(self) -> None:
            self._is_sent.wait()
            super().recv_events()

    return Connection


def _failed(text: str) -> WireError:
    return WireError(f"the policy failed: {wire.last_line(text)}", wire.printable(text))
