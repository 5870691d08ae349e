"""`render_mode="human"`: a window where there are pygame and a display, else what is missing."""

import copy
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.errors import ConfigError, MissingExtraError, UnknownNameError

OBJECT = "bucket-0002"
STILL = np.zeros(22, np.float32)
PROGRAM = """
import sys
import numpy as np
from artiskill import ManipulationEnv
env = ManipulationEnv("MoveBucket", objects="bucket-0002", render_mode="human")
env.reset(seed=0)
env.step(np.zeros(22))
import pygame
assert pygame.display.get_driver() == sys.argv[1], pygame.display.get_driver()
seen = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
other = ManipulationEnv("MoveBucket", objects="bucket-0002", render_mode="rgb_array")
other.reset(seed=0)
other.step(np.zeros(22))
np.testing.assert_array_equal(seen, other.render())
env.close()
"""


@pytest.fixture
def pygame(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The library, with a display that nobody sees."""
    monkeypatch.setenv("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    library = pytest.importorskip("pygame", reason="needs pip install 'artiskill[viewer]'")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    yield library
    library.display.quit()


def make(**kwargs: Any) -> ManipulationEnv:
    return ManipulationEnv("MoveBucket", objects=OBJECT, **{"render_mode": "human", **kwargs})


def shown(pygame: Any) -> np.ndarray:
    """What is in the window, (H, W, 3)."""
    return pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)


def test_the_window_shows_what_rgb_array_gives(pygame: Any) -> None:
    env, other = make(), make(render_mode="rgb_array")
    for one in (env, other):
        one.reset(seed=0)
    np.testing.assert_array_equal(shown(pygame), other.render())
    state = env.save_state()
    for one in (env, other):
        one.step(STILL + 1)
    after = other.render()
    np.testing.assert_array_equal(shown(pygame), after)
    assert env.render() is None
    np.testing.assert_array_equal(shown(pygame), after)
    assert pygame.display.get_caption()[0] == "ArtiSkill: MoveBucket"
    other.restore_state(state)
    env.restore_state(state)
    np.testing.assert_array_equal(shown(pygame), other.render())
    env.close()
    assert not pygame.display.get_init()
    env.close()


def test_it_runs_in_real_time(pygame: Any) -> None:
    env = make()
    env.reset(seed=0)
    begin = time.monotonic()
    for _ in range(6):
        env.step(STILL)
    assert time.monotonic() - begin > 5 * 0.05


def test_gymnasium_takes_it_as_it_is(pygame: Any) -> None:
    env = gym.make("ArtiSkill/MoveBucket-v0", objects=OBJECT, render_mode="human")
    assert not any("HumanRendering" in layer for layer in str(env).split("<"))
    env.reset(seed=0)
    env.step(STILL)
    assert shown(pygame).any()
    env.close()


def test_a_person_may_close_the_window(pygame: Any) -> None:
    env = make()
    env.reset(seed=0)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    env.step(STILL)
    assert not pygame.display.get_init()
    env.step(STILL)
    assert not pygame.display.get_init(), "the episode goes on unseen"


def test_two_environments_share_the_window(pygame: Any) -> None:
    env = make()
    env.reset(seed=0)
    twin = copy.deepcopy(env)
    before = shown(pygame)
    twin.step(STILL + 1)
    assert (shown(pygame) != before).any()
    env.close()
    assert pygame.display.get_init(), "the other one shows something in it"
    twin.step(STILL)
    twin.close()
    assert not pygame.display.get_init()


def test_without_pygame_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(MissingExtraError, match=r"'human' needs.*pip install 'artiskill\[viewer\]'"):
        make()


@pytest.mark.parametrize("driver", [None, "no-such-driver"])
def test_without_a_display_it_says_so(driver: str | None, pygame: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    pygame.display.quit()
    for name in ("SDL_VIDEODRIVER", "SDL_VIDEO_DRIVER", "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    if driver is not None:
        monkeypatch.setenv("SDL_VIDEODRIVER", driver)
    with pytest.raises(ConfigError, match=r"no display .*DISPLAY.*rgb_array"):
        make()
    assert not pygame.display.get_init()


def test_gymnasiums_checker_is_silent_without_a_display(monkeypatch: pytest.MonkeyPatch) -> None:
    """It makes an environment of every mode that one tells of."""
    for name in ("SDL_VIDEODRIVER", "SDL_VIDEO_DRIVER", "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    env = gym.make("ArtiSkill/MoveBucket-v0", objects=OBJECT, render_mode="rgb_array")
    assert env.metadata["render_modes"] == ["rgb_array"]
    check_env(env.unwrapped)


def test_gymnasiums_checker_is_silent_with_a_display(pygame: Any) -> None:
    env = gym.make("ArtiSkill/MoveBucket-v0", objects=OBJECT, render_mode="rgb_array")
    assert env.metadata["render_modes"] == ["rgb_array", "human"]
    check_env(env.unwrapped)


def test_vectors_have_no_window() -> None:
    with pytest.raises(UnknownNameError, match="render mode 'human'; legal: rgb_array"):
        ManipulationVectorEnv(2, "MoveBucket", OBJECT, render_mode="human")


def test_a_real_display_shows_it() -> None:
    pytest.importorskip("pygame", reason="needs pip install 'artiskill[viewer]'")
    server = shutil.which("xvfb-run")
    if server is None:
        pytest.skip("needs xvfb-run")
    environment = {name: value for name, value in os.environ.items() if not name.startswith("SDL_")}
    command = [server, "--auto-servernum", sys.executable, "-c", PROGRAM, "x11"]
    subprocess.run(command, env=environment, check=True, timeout=120)
