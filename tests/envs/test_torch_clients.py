"""Wrappers that turn arrays into tensors: Gymnasium's `NumpyToTorch`, TorchRL's `GymWrapper`."""

import copy
import logging
import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers.vector import ArrayConversion

from artiskill.envs.options import OBSERVATION_MODES

ID, OBJECTS = "ArtiSkill/OpenCabinetDrawer-v0", ["cabinet-0001", "cabinet-0010"]
SMALL = {"cameras.number": 1, "cameras.width": 64, "cameras.height": 48, "episode_steps": 3}
AUTORESET = ("next_step", "same_step", "disabled")


def make(obs_mode: str, autoreset_mode: str, **kwargs: Any) -> gym.vector.VectorEnv:
    kwargs = {"objects": OBJECTS, "config": SMALL, "num_threads": 1} | kwargs
    return gym.make_vec(ID, num_envs=2, obs_mode=obs_mode, autoreset_mode=autoreset_mode, **kwargs)


def import_torch() -> Any:
    return pytest.importorskip("torch", reason="needs torch: make test-rl")


def torchrl_envs() -> Any:
    """The library's environments; importing it warns of things that are its own."""
    import_torch()
    logging.disable(logging.INFO)  # it says a great deal
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pytest.importorskip("torchrl", reason="needs TorchRL: make test-rl")
        import torchrl.envs
    return torchrl.envs


def assert_converted(ours: Any, theirs: Any, kind: type, where: str = "") -> None:
    """The same numbers, as arrays of the other library; names as they are."""
    if isinstance(ours, dict):
        assert ours.keys() == theirs.keys()
        for key, value in ours.items():
            assert_converted(value, theirs[key], kind, f"{where}/{key}")
    elif isinstance(ours, np.ndarray) and ours.dtype == object:
        for mine, other in zip(ours, theirs, strict=True):
            assert_converted(mine, other, kind, where)
    elif ours is None or isinstance(ours, str):
        assert ours == theirs, where
    else:
        assert isinstance(theirs, kind), f"{where} is {type(theirs)}"
        np.testing.assert_array_equal(np.asarray(theirs), ours, err_msg=where)


def check_conversion(env: gym.vector.VectorEnv, wrapped: gym.vector.VectorEnv, xp: Any, kind: type) -> None:
    """Play in both, into the second episode."""
    for one, other in zip(env.reset(seed=1), wrapped.reset(seed=1), strict=True):
        assert_converted(one, other, kind)
    action = np.linspace(-1, 1, 26, dtype=np.float32).reshape(2, 13)
    for _ in range(5):
        result = env.step(action)
        for ours, theirs in zip(result, wrapped.step(xp.asarray(action)), strict=True):
            assert_converted(ours, theirs, kind)
        done = result[2] | result[3]
        if env.metadata["autoreset_mode"] is gym.vector.AutoresetMode.DISABLED and done.any():
            again = (
                env.reset(options={"reset_mask": done}),
                wrapped.reset(options={"reset_mask": xp.asarray(done)}),
            )
            for ours, theirs in zip(*again, strict=True):
                assert_converted(ours, theirs, kind)


@pytest.mark.parametrize("autoreset", AUTORESET)
@pytest.mark.parametrize("mode", OBSERVATION_MODES)
def test_array_conversion_converts_everything(mode: str, autoreset: str) -> None:
    """Without torch: another library of arrays does as well."""
    xp = pytest.importorskip("array_api_strict")
    env = make(mode, autoreset)
    wrapped = ArrayConversion(make(mode, autoreset), env_xp=np, target_xp=xp)
    check_conversion(env, wrapped, xp, type(xp.asarray(0)))


@pytest.mark.parametrize("autoreset", AUTORESET)
@pytest.mark.parametrize("mode", OBSERVATION_MODES)
def test_numpy_to_torch_converts_everything(mode: str, autoreset: str) -> None:
    torch = import_torch()
    from gymnasium.wrappers.vector import NumpyToTorch

    env, wrapped = make(mode, autoreset), NumpyToTorch(make(mode, autoreset))
    check_conversion(env, wrapped, torch, torch.Tensor)
    action = torch.zeros(2, 13)
    twin = copy.deepcopy(wrapped)
    np.testing.assert_array_equal(twin.step(action)[1].numpy(), wrapped.step(action)[1].numpy())


@pytest.mark.parametrize("mode", OBSERVATION_MODES)
def test_torchrl_wraps_the_vector(mode: str) -> None:
    envs = torchrl_envs()
    wrapped = envs.GymWrapper(make(mode, "disabled"))
    assert wrapped.batch_size == (2,)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        envs.check_env_specs(wrapped)
        wrapped.set_seed(7)
        played = wrapped.rollout(7, break_when_any_done=False)
    env = make(mode, "disabled")
    env.reset(seed=7)
    seen, _ = env.reset()  # the library seeds by a reset of its own
    for k in range(7):
        assert_observed(seen, played[:, k])
        action = played["action"][:, k].numpy()
        seen, rewards, terminated, truncated, _ = env.step(action)
        np.testing.assert_array_equal(played["next", "reward"][:, k, 0], rewards.astype(np.float32))
        np.testing.assert_array_equal(played["next", "truncated"][:, k, 0], truncated)
        assert_observed(seen, played["next"][:, k])
        done = terminated | truncated
        if done.any():
            seen, _ = env.reset(options={"reset_mask": done})
    assert played["next", "done"].sum() == 4, "two episodes each were over"


def assert_observed(ours: Any, theirs: Any) -> None:
    if isinstance(ours, dict):
        for key, value in ours.items():
            assert_observed(value, theirs[key])
    else:
        theirs = theirs["observation"] if hasattr(theirs, "batch_size") else theirs
        np.testing.assert_array_equal(theirs.numpy(), ours)


def test_torchrl_collects_with_a_policy() -> None:
    envs = torchrl_envs()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from torchrl.collectors import Collector

        wrapped = envs.GymWrapper(make("state", "disabled"))
        collector = Collector(wrapped, wrapped.rand_action, frames_per_batch=16, total_frames=32)
        batches = [tuple(batch.shape) for batch in collector]
        collector.shutdown()
    assert batches == [(2, 8), (2, 8)]


def test_torchrl_wraps_a_single_environment() -> None:
    envs = torchrl_envs()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        wrapped = envs.GymEnv(ID, objects=OBJECTS, config=SMALL)
        envs.check_env_specs(wrapped)
        assert wrapped.rollout(7, break_when_any_done=False).batch_size == (7,)
