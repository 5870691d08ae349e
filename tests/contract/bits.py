"""Digests of all that follows from seeds, levels and actions.

`python -m tests.contract.bits few` prints them; `record` in place of `few` writes them to `digests.json`, with
which every Python is compared; `acting` prints digests of what policies do. A change that is meant to change bits
records them anew; the CHANGELOG says so.
"""

import dataclasses
import hashlib
import json
import sys
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

import artiskill
from artiskill.evaluation.pictures import EpisodeChoice
from artiskill.evaluation.policies import load_policy, policy_of_task

# objects whose hash, which rounds, once differed between processors all the same
ONCE_UNLIKE = ("chair-0004", "chair-0023", "chair-0028", "chair-0032", "chair-0033", "chair-0034")
RECORDED = Path(__file__).with_name("digests.json")
# whose states are other than the paper's
STATE_OPTIONS = {
    "OpenCabinetDoor": ("cabinet-0064", "state.handle"),
    "OpenCabinetDrawer": ("cabinet-0002", "state.handle"),
    "PushChair": ("chair-0004", "state.relative"),
    "MoveBucket": ("bucket-0016", "state.relative"),
}
STEPS = {"state": 25, "pointcloud": 4, "rgbd": 4}
ACTIONS = 30  # of a policy

Episode = tuple[str, str, str, str]  # task, object, obs_mode, control_mode


def few() -> tuple[list[str], list[Episode]]:
    """Every twentieth object, and a short episode of each task."""
    every = artiskill.list_objects()
    episodes = [(task, ids[-1], "state", "operational_space") for task, ids in of_tasks()]
    seen = [("PushChair", "chair-0004", "pointcloud", "joint"), ("OpenCabinetDrawer", every[0], "rgbd", "joint")]
    return [*every[::20], *ONCE_UNLIKE], [*episodes, *seen]


def whole() -> tuple[list[str], list[Episode]]:
    """All objects of the catalogue, and episodes in all modes."""
    modes = (("state", "joint"), ("state", "operational_space"), ("pointcloud", "joint"), ("rgbd", "joint"))
    episodes = [(task, one, *mode) for task, ids in of_tasks() for one in ids[::12] for mode in modes]
    splits = ("train", "test", "ood")
    return [one for split in splits for one in artiskill.list_objects(split=split)], episodes


def of_tasks() -> Iterator[tuple[str, list[str]]]:
    for task in ("OpenCabinetDoor", "OpenCabinetDrawer", "PushChair", "MoveBucket"):
        yield task, artiskill.list_objects(task=task)


def digests(objects: list[str], episodes: list[Episode]) -> dict[str, str]:
    """A digest of each object, and of states, observations, rewards, and flags of each episode."""
    found = {"object " + one: digest(artiskill.load_object(one)) for one in objects}
    for episode in episodes:
        found |= {f"{what} of {' '.join(episode)}": value for what, value in played(*episode).items()}
    for task, (object_id, key) in STATE_OPTIONS.items():
        told = played(task, object_id, "state", "joint", {key: True})
        found[f"observations of {task} {object_id} {key}"] = told["observations"]
    return found


def played(
    task: str, object_id: str, obs_mode: str, control_mode: str, config: Mapping[str, Any] | None = None
) -> dict[str, str]:
    """Play random actions and digest what came of it, by kind."""
    modes = {"obs_mode": obs_mode, "control_mode": control_mode, "config": config}
    env: Any = gym.make(f"ArtiSkill/{task}-v0", **modes).unwrapped
    observation, info = env.reset(options={"level": 3, "object": object_id})
    rng = np.random.default_rng(3)
    states, observations, rewards, infos = [env.save_state().simulation], [observation], [], [info]
    for _ in range(STEPS[obs_mode]):
        action = np.clip(rng.normal(0.3, 0.5, env.action_space.shape), -1, 1).astype(np.float32)
        observation, reward, *ends, info = env.step(action)
        states.append(env.save_state().simulation)
        observations.append(observation)
        rewards.append(reward)
        infos.append((info, ends))
    env.close()
    return {
        "states": digest(states),
        "observations": digest(observations),
        "rewards": digest(rewards),
        "flags": digest(infos),
    }


def digest(value: Any) -> str:
    """Of every bit of nested values."""
    found = hashlib.sha256()
    for piece in pieces(value):
        found.update(len(piece).to_bytes(8, "little") + piece)
    return found.hexdigest()[:16]


def pieces(value: Any) -> Iterator[bytes]:
    if isinstance(value, np.ndarray | np.generic):
        yield np.ascontiguousarray(value).tobytes()
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from pieces(getattr(value, field.name))
    elif isinstance(value, Mapping):
        for key in sorted(value):
            yield from pieces((key, value[key]))
    elif isinstance(value, tuple | list):
        for item in value:
            yield from pieces(item)
    else:
        yield repr(value).encode()


def acting() -> dict[str, str]:
    """A digest of the first actions of experts, as they demonstrate, too, and of the package's policies."""
    found = {}
    for task, ids in of_tasks():
        for name in ("expert", "demonstrator", "pretrained"):
            actor = load_policy(policy_of_task(name, task))
            env = EpisodeChoice(task, ids[0]).make_env(actor)
            observation, info = env.reset(options={"level": 3})
            actor.reset(env, observation, info)
            actions = []
            for _ in range(ACTIONS):
                actions.append(actor.act(env, observation))
                observation, *_ = env.step(actions[-1])
            found[f"{name} {task}"] = digest(actions)
            env.close()
    return found


def probes() -> dict[str, str]:
    """What NumPy and BLAS themselves make of some numbers: differs where a switch is felt."""
    rng = np.random.default_rng(0)
    values, matrix, vectors = rng.uniform(0.01, 0.99, 999), rng.normal(size=(64, 64)), rng.normal(size=(2, 999, 3))
    products = [matrix @ matrix, matrix[0] @ matrix, np.vecdot(*vectors)]
    return {"numpy": digest([np.exp(values), np.arccos(values), np.tanh(values)]), "blas": digest(products)}


def record() -> None:
    """Write the digests of `few`, and the engine that they are of, to `RECORDED`."""
    found = {"mujoco-core": version("mujoco-core"), "digests": digests(*few())}
    RECORDED.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    if sys.argv[1] == "record":
        record()
    elif sys.argv[1] == "acting":
        print(json.dumps({"digests": acting(), "probes": probes()}))
    else:
        print(json.dumps({"digests": digests(*(few() if sys.argv[1] == "few" else whole())), "probes": probes()}))
