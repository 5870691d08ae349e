"""A window on the screen, for `render_mode="human"`; the extra `viewer` brings what it needs."""

import os
import warnings
from importlib.util import find_spec
from typing import Any, ClassVar
from weakref import WeakSet

import numpy as np

from artiskill.envs.options import HUMAN, RENDER_MODES
from artiskill.errors import ConfigError, MissingExtraError

EXTRA = "viewer"
_DISPLAYS, _DRIVERS = ("DISPLAY", "WAYLAND_DISPLAY"), ("SDL_VIDEODRIVER", "SDL_VIDEO_DRIVER")
_NOT_SEEN = ("dummy", "offscreen")  # what SDL falls back to, silently, where there is no display


class Window:
    """Shows pictures; it opens with the first one, and stays closed once a person has closed it.

    A process has one such window: that of the environment that drew last.

    Args:
        title: of the window.
        fps: no more pictures than this are shown per second; who shows more has to wait.

    Raises:
        MissingExtraError: pygame is not installed.
        ConfigError: there is no display.
    """

    _in_use: ClassVar[WeakSet["Window"]] = WeakSet()

    def __init__(self, title: str, fps: float) -> None:
        self._pygame = _import_pygame()
        self._title, self._fps = title, fps
        self._clock: Any = None
        self._was_closed = False
        _open_display(self._pygame)

    def show(self, picture: np.ndarray) -> None:
        """Show a picture, (H, W, 3) uint8."""
        pygame = self._pygame
        if self._was_closed:
            return
        _open_display(pygame)
        size = picture.shape[1::-1]
        screen = pygame.display.get_surface()
        if screen is None or screen.get_size() != size:
            screen = pygame.display.set_mode(size)
        pygame.display.set_caption(self._title)
        self._in_use.add(self)
        pygame.surfarray.blit_array(screen, picture.swapaxes(0, 1))
        pygame.display.flip()
        if any(event.type == pygame.QUIT for event in pygame.event.get()):
            self.close()
            self._was_closed = True
            return
        self._clock = self._clock or pygame.time.Clock()
        self._clock.tick(self._fps)

    def close(self) -> None:
        """Close the window, unless another environment shows something in it."""
        shown = self in self._in_use
        self._in_use.discard(self)
        if shown and not self._in_use:
            self._pygame.display.quit()


def open_window(render_mode: str | None, title: str, fps: float) -> Window | None:
    """The window of a render mode: None unless that is `human`.

    Raises:
        MissingExtraError, ConfigError: as `Window`.
    """
    return Window(title, fps) if render_mode == HUMAN else None


def render_modes_here(render_mode: str | None) -> list[str]:
    """The modes that other environments could have here: `human` where a window can be seen.

    Gymnasium's `check_env` makes an environment of every mode that one tells of.

    Args:
        render_mode: of this environment, which is certainly one.
    """
    display = any(os.environ.get(name) for name in (*_DISPLAYS, *_DRIVERS))
    shown = render_mode == HUMAN or (display and find_spec("pygame") is not None)
    return [mode for mode in RENDER_MODES if mode != HUMAN or shown]


def _import_pygame() -> Any:
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # or importing it prints a greeting
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of things that are its own
            import pygame
    except ImportError as error:
        raise MissingExtraError("render_mode='human'", EXTRA) from error
    return pygame


def _open_display(pygame: Any) -> None:
    """Connect to the display; nothing happens if that has been done.

    Raises:
        ConfigError: there is none.
    """
    found = "none"
    try:
        pygame.display.init()
        found = pygame.display.get_driver()
    except pygame.error as error:
        found = str(error)
    wanted = any(os.environ.get(name) for name in _DRIVERS)
    if not pygame.display.get_init() or (found in _NOT_SEEN and not wanted):
        pygame.display.quit()
        raise ConfigError(
            f"render_mode='human' shows a window, but there is no display ({found}): set DISPLAY or "
            "WAYLAND_DISPLAY, or take render_mode='rgb_array'; `artiskill render` makes films"
        )
