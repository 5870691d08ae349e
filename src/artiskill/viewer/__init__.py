"""Episodes, demonstrations and objects in a browser. viser draws; what is shown comes from other packages.

Here is the server that pages are served by.
"""

import contextlib
import io
import logging
import socket
from collections.abc import Iterator
from typing import Any

from artiskill.errors import ConfigError, MissingExtraError

EXTRA = "viewer"
LOOPBACK, PORT = "127.0.0.1", 8080


def import_viser() -> Any:
    """Return the library that shows scenes in a browser.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        import viser
    except ImportError as error:
        raise MissingExtraError("the viewer", EXTRA) from error
    return viser


@contextlib.contextmanager
def serving(host: str = LOOPBACK, port: int = PORT) -> Iterator[Any]:
    """Yield a viser server that stops with the block.

    Args:
        host: address that is listened to; anybody who reaches it can see and steer what is shown.
        port: 0 for any that is free.

    Raises:
        MissingExtraError: viser is not installed.
        ConfigError: the address cannot be listened to.
    """
    viser = import_viser()
    check_address(host, port)
    # browsers open connections that they may not need; when one is closed, that is no error for the terminal
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
    with contextlib.redirect_stdout(io.StringIO()):  # it greets
        server = viser.ViserServer(host=host, port=port, label="ArtiSkill", verbose=False)
    server.request_share_url = lambda verbose=True: None  # no page shall ask for a tunnel to the world
    server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
    try:
        yield server
    finally:
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()


def check_address(host: str, port: int) -> None:
    """Raise `ConfigError` unless a server can listen there; viser would wait forever."""
    if not 0 <= port <= 65535:
        raise ConfigError(f"a port must lie in [0, 65535], not {port}")
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
    except OSError as error:
        reason = error.strerror or error
        raise ConfigError(f"cannot listen to {host}, port {port}: {reason}; --port 0 takes a free one") from error
