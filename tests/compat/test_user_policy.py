"""Solutions in the form of 2021's benchmark: our own texts, in the style of its examples."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import artiskill
from artiskill.assets.catalog import load_object
from artiskill.cli.main import main
from artiskill.compat import user_policy
from artiskill.compat.observations import describe_for_2021
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import PolicyError

TASKS = ("OpenCabinetDoor", "OpenCabinetDrawer", "PushChair", "MoveBucket")
OBJECTS = dict(zip(TASKS, ("cabinet-0006", "cabinet-0002", "chair-0004", "bucket-0001"), strict=True))
SHORT = {"episode_steps": 3}
Write = Callable[[str], Path]

BASE = """
class BasePolicy(object):
    def __init__(self, opts=None):
        self.obs_mode = 'pointcloud'
    def act(self, observation):
        raise NotImplementedError()
    def reset(self):
        pass
"""

# draws from the space of an environment that it makes for it
SAMPLING = f"""
import copy
import gym
import mani_skill.env
from gym.spaces import Box
{BASE}
class UserPolicy(BasePolicy):
    def __init__(self, env_name):
        super().__init__()
        env = gym.make(env_name)
        assert isinstance(env.action_space, Box)
        self.action_space = copy.copy(env.action_space)
        env.close()
        del env
        self.obs_mode = 'state'
    def act(self, observation):
        assert observation.ndim == 1
        return self.action_space.sample()
"""

# keeps an environment in the mode that it wants, stacks frames of it, and goes where the handle is
CLOUD = f"""
import os.path as osp
from collections import deque
import gym
import numpy as np
{BASE}
GAIN = float(open(osp.join(osp.dirname(__file__), 'gain.txt')).read())

class Frames:
    def __init__(self, env, count):
        self.env, self.frames = env, deque(maxlen=count)
    def add(self, observation):
        wanted = self.env.observation_space
        assert sorted(observation) == sorted(wanted) == ['agent', 'pointcloud']
        for key, space in wanted['pointcloud'].items():
            assert observation['pointcloud'][key].shape == space.shape, key
            assert observation['pointcloud'][key].dtype == space.dtype, key
        assert observation['agent'].shape == wanted['agent'].shape
        self.frames.append(observation['pointcloud']['xyz'])
        return np.concatenate(self.frames)

class UserPolicy(BasePolicy):
    def __init__(self, env_name):
        super().__init__()
        self.env = gym.make(env_name)
        self.env.set_env_mode(obs_mode=self.obs_mode)
        self.size = self.env.action_space.shape[0]
        self.frames = Frames(self.env, 2)
    def reset(self):
        self.frames.frames.clear()
    def act(self, observation):
        cloud = observation['pointcloud']
        self.frames.add(observation)
        rgb = cloud['rgb']
        assert rgb.dtype == np.float32 and 0 <= rgb.min() and 0.2 < rgb.max() <= 1
        ahead = cloud['xyz'][cloud['seg'][:, 0] > 0]
        action = np.zeros(self.size)
        if len(ahead):
            action[:2] = np.clip(GAIN * ahead.mean(axis=0)[:2], -1, 1)
        observation['pointcloud']['xyz'] *= 0  # they may be written to
        return action
"""

# three cameras' images, a base class from the kit, and a network's memory
PICTURES = """
import numpy as np
import mani_skill.env, gym
from mani_skill.eval.user_solution import BasePolicy

class UserPolicy(BasePolicy):
    def __init__(self, env_name):
        BasePolicy.__init__(self)
        self.env_name = env_name
        self.obs_mode = 'rgbd'
        env = gym.make(env_name, obs_mode='rgbd', reward_type='sparse')
        self.blank = env.reset(level=3)
        self.n = len(env.action_space.low)
        self.hidden = 0.0
    def reset(self):
        self.hidden = 0.0
    def act(self, observation):
        for key in ('rgb', 'depth', 'seg'):
            assert observation['rgbd'][key].shape == self.blank['rgbd'][key].shape, key
        self.hidden += float(observation['rgbd']['depth'].mean() > 0) / 4
        return [self.hidden] * self.n
"""

# averages members of an ensemble, and asks which task it has
ENSEMBLE = f"""
from copy import deepcopy
import numpy as np
{BASE}
class Member(BasePolicy):
    def __init__(self, env_name, value):
        super().__init__()
        self.size = 22 if 'Chair' in env_name or 'Bucket' in env_name else 13
        self.value = value
    def act(self, observation):
        observation['pointcloud'].pop('rgb')
        return np.full(self.size, self.value, dtype=np.float32)

class UserPolicy(BasePolicy):
    def __init__(self, env_name):
        super().__init__()
        assert env_name.endswith('-v0') and '_' not in env_name
        self.members = [Member(env_name, value) for value in (0.25, 0.5)]
    def act(self, observation):
        actions = [member.act(deepcopy(observation)) for member in self.members]
        return sum(actions) / len(actions)
"""
FILES = {"sampling": SAMPLING, "cloud": CLOUD, "pictures": PICTURES, "ensemble": ENSEMBLE}


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write(text: str) -> Path:
        (tmp_path / "gain.txt").write_text("0.5")
        path = tmp_path / "user_solution.py"
        path.write_text(text)
        return path

    return write


@pytest.mark.parametrize(
    ("name", "task"),
    [
        *(("sampling", task) for task in TASKS),
        *(("cloud", task) for task in TASKS[1:3]),
        *(("pictures", task) for task in TASKS[:1]),
        *(("ensemble", task) for task in TASKS[3:]),
    ],
)
def test_files_run_unchanged(write: Write, name: str, task: str) -> None:
    path = write(FILES[name])
    report = artiskill.evaluate(task, path, [OBJECTS[task]], 2, config=SHORT)
    assert report.total.episodes == 2
    assert report.obs_mode == {"sampling": "state", "pictures": "rgbd"}.get(name, "pointcloud")
    assert report.control_mode == "joint"
    actions = [result.actions for result in report.episodes]
    assert [array.shape for array in actions] == [(3, actions[0].shape[1])] * 2
    if name == "pictures":
        np.testing.assert_allclose(actions[1][:, 0], [0.25, 0.5, 0.75])  # its memory ended with the episode
    if name == "ensemble":
        assert np.all(actions[0] == 0.375)


def test_numbers_are_the_same_again(write: Write) -> None:
    path = write(SAMPLING)
    one, two = (artiskill.evaluate("PushChair", path, ["chair-0004"], 2, config=SHORT) for _ in range(2))
    assert [result.digest for result in one.episodes] == [result.digest for result in two.episodes]
    assert len(np.unique(one.episodes[0].actions)) > 60  # and they are not all alike


def test_from_the_command_line(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["evaluate", "--task", "MoveBucket", "--policy", str(write(ENSEMBLE)), "--objects", "bucket-0001"]
    assert main([*command, "--episodes", "1", "--set", "episode_steps=2"]) == 0
    assert "bucket-0001" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            BASE + "class UserPolicy(BasePolicy):\n    def __init__(self, n):\n        self.obs_mode = 'custom'\n",
            "obs_mode 'custom'",
        ),
        ("class UserPolicy:\n    def __init__(self, env_name):\n        1 / 0\n", "UserPolicy() raised ZeroDiv"),
        ("class UserPolicy:\n    def __init__(self): pass\n", "UserPolicy() raised TypeError"),
        ("import mani_skill_learn\nclass UserPolicy: pass\n", "No module named 'mani_skill_learn' (line 1"),
        ("import mani_skill.utils.osc\nclass UserPolicy: pass\n", "No module named 'mani_skill.utils'"),
        (
            "import gym\nclass UserPolicy:\n    def __init__(self, n):\n        gym.make(n).step([0] * 13)\n",
            "nothing is simulated in a policy's process",
        ),
        (
            "import gym\nclass UserPolicy:\n    def __init__(self, n):\n        gym.make('PushChair-v0')\n",
            "no environment 'PushChair-v0' here; this policy is asked for 'OpenCabinetDrawer-v0'",
        ),
    ],
)
def test_errors_are_one_line(write: Write, text: str, says: str) -> None:
    with pytest.raises(PolicyError) as caught:
        artiskill.evaluate("OpenCabinetDrawer", write(text), ["cabinet-0002"], 1, config=SHORT)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_policy_of_today_that_mentions_it_is_one_of_today(write: Write) -> None:
    text = "class UserPolicy: pass\ndef policy(observation):\n    return [0.0] * 13\n"
    report = artiskill.evaluate("OpenCabinetDrawer", write(text), ["cabinet-0002"], 1, config=SHORT)
    assert not report.episodes[0].actions.any()


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("obs_mode", ["state", "pointcloud", "rgbd"])
def test_blank_observations_have_the_shapes_of_real_ones(task: str, obs_mode: str) -> None:
    env = ManipulationEnv(task, [load_object(OBJECTS[task])], obs_mode=obs_mode)
    real, _ = env.reset(seed=0)
    real = user_policy._as_in_2021(real)
    user_policy._module("gym.spaces", Box=user_policy.Box)
    try:
        blank = user_policy.Environment(describe_for_2021(task), obs_mode).reset()
    finally:
        del sys.modules["gym.spaces"]
    assert shapes_of(blank) == shapes_of(real)
    assert describe_for_2021(task)["action"] == env.action_space.shape[0]


def shapes_of(observation: object) -> object:
    if isinstance(observation, dict):
        return {key: shapes_of(value) for key, value in observation.items()}
    assert isinstance(observation, np.ndarray)
    return observation.shape, observation.dtype


def test_it_needs_nothing_but_numpy(tmp_path: Path) -> None:
    """The file travels to a process that may have no other package."""
    target = tmp_path / "alone.py"
    target.write_bytes(Path(user_policy.__file__).read_bytes())
    code = (
        "import sys, numpy, pathlib\n"
        f"sys.path[:] = [p for p in sys.path if 'site-packages' not in p] + [{str(tmp_path)!r}]\n"
        "import alone, json\n"
        f"alone.install(json.loads({json.dumps(describe_for_2021('PushChair'))!r}))\n"
        "import gym, mani_skill.env, mani_skill.env.base_env\n"
        "env = gym.make('PushChair_3000-v0', obs_mode='rgbd')\n"
        "print(env.spec.id, env.action_space.contains(env.action_space.sample()), env._max_episode_steps)\n"
        "assert isinstance(env, mani_skill.env.base_env.BaseEnv)\n"
        "assert gym.Wrapper(env).unwrapped.obs_mode == gym.core.ObservationWrapper(env).obs_mode == 'rgbd'\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.split() == ["PushChair_3000-v0", "True", "200"], done.stderr
