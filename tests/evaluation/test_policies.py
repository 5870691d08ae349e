from pathlib import Path

import numpy as np
import pytest

import artiskill
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import PolicyError, UnknownNameError
from artiskill.evaluation.evaluate import evaluate, run_episode
from artiskill.evaluation.plan import plan_evaluation
from artiskill.evaluation.policies import Actor, RandomActor, load_policy
from artiskill.learning.array_policy import pretrained_file
from artiskill.tasks.registry import task_names


@pytest.fixture(scope="module")
def env() -> ManipulationEnv:
    return ManipulationEnv(objects=["cabinet-0005", "cabinet-0010"])


def first_action(actor: Actor, env: ManipulationEnv, level: int, name: str) -> np.ndarray:
    observation, info = env.reset(options={"level": level, "object": name})
    actor.reset(env, observation, info)
    return actor.act(env, observation)


def test_random_follows_level_and_object_only(env: ManipulationEnv) -> None:
    actor = RandomActor()
    first = first_action(actor, env, 3, "cabinet-0005")
    assert first.shape == (13,)
    assert np.abs(first).max() <= 1
    others = [first_action(actor, env, 4, "cabinet-0005"), first_action(actor, env, 3, "cabinet-0010")]
    assert not any(np.array_equal(first, other) for other in others)
    np.testing.assert_array_equal(first, first_action(RandomActor(), env, 3, "cabinet-0005"))


def test_still_asks_for_nothing(env: ManipulationEnv) -> None:
    action = first_action(load_policy("still"), env, 3, "cabinet-0005")
    assert action.shape == (13,)
    assert not action.any()


def test_the_expert_solves_a_level(env: ManipulationEnv) -> None:
    seen: list[tuple[int, bool]] = []
    result = run_episode(env, load_policy("expert"), 0, lambda _, steps, done: seen.append((steps, done)))
    assert result.success
    assert all(result.flags.values())
    assert [steps for steps, _ in seen] == list(range(result.length + 1))
    assert [done for _, done in seen] == [False] * result.length + [True]


def test_unknown_names() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'expert'"):
        load_policy("exprt")


def test_paths_may_be_text_or_path(root: Path) -> None:
    path = root / "examples" / "solution_example.py"
    assert load_policy(path).name == load_policy(str(path)).name == str(path)


@pytest.mark.parametrize(
    ("task", "category"),
    [
        ("OpenCabinetDrawer", "cabinet"),
        ("OpenCabinetDoor", "cabinet"),
        ("PushChair", "chair"),
        ("MoveBucket", "bucket"),
    ],
)
def test_a_policy_of_the_package_solves_an_object_that_it_has_never_seen(task: str, category: str) -> None:
    number = 3000003 if task == "OpenCabinetDoor" else 3000000  # the first with a door, a drawer
    report = evaluate(task, "pretrained", f"generated:{category}:{number}", 1)
    assert report.success_rate == 1
    assert (report.policy, report.obs_mode) == ("pretrained", "pointcloud")
    assert report.policy_sha256 is not None


@pytest.mark.parametrize("given", ["file", "loaded"])
def test_a_policy_that_learned_another_task(given: str) -> None:
    """Of other objects it is refused; of the same ones it plays, and a note says what it learned."""
    path = pretrained_file("OpenCabinetDrawer")
    policy, name = (str(path), str(path)) if given == "file" else (artiskill.load_policy(path.stem), "the policy")
    with pytest.raises(PolicyError) as refused:
        plan_evaluation("PushChair", policy, "chair-0031", 1)
    assert str(refused.value) == f"{name} learned OpenCabinetDrawer, with a cabinet; PushChair has a chair"
    doors = plan_evaluation("OpenCabinetDoor", policy, "cabinet-0042", 1)
    assert doors.notes == (f"{name} learned OpenCabinetDrawer, and is played on OpenCabinetDoor",)
    assert plan_evaluation("OpenCabinetDrawer", policy, "cabinet-0042", 1, target="any").notes == ()


def test_policies_of_the_package() -> None:
    policy = artiskill.load_policy("PushChair")
    assert (policy.header.task, policy.header.algorithm) == ("PushChair", "dagger")
    with pytest.raises(
        PolicyError, match="no trained policy comes with the package for Fold; for MoveBucket, Open"
    ):
        artiskill.load_policy("Fold")
    with pytest.raises(PolicyError, match="did you mean 'PushChair'"):
        artiskill.load_policy("PushChiar")
    with pytest.raises(PolicyError, match=r"ArrayPolicy\('mine\.npz'\) loads a file"):
        artiskill.load_policy("mine.npz")
    files = [pretrained_file(task).stat().st_size for task in task_names()]
    assert sum(files) <= 8_000_000
