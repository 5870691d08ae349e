"""DAgger: commands as numbers, what is learned of them, rollouts that repeat, a policy that acts as it learned."""
# ruff: noqa: E402

import csv
import dataclasses
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from tests.learning.clouds import observe

from artiskill.assets.catalog import load_object
from artiskill.cli.main import main
from artiskill.config import from_mapping, to_mapping
from artiskill.errors import AssetError, ConfigError, PolicyError, RunError, UnknownNameError
from artiskill.evaluation.evaluate import evaluate
from artiskill.experts.whole_body import Command, Grip, WholeBodyConfig
from artiskill.exports.export import export_object
from artiskill.learning.array_policy import ArrayPolicy
from artiskill.learning.batch import Batch, Sizes, Statistics
from artiskill.learning.commands import CommandActor, CommandSpace, commanding_expert
from artiskill.learning.dagger import DAgger
from artiskill.learning.features import Scale, make_features
from artiskill.learning.network_config import load_network_config
from artiskill.learning.networks import make_network
from artiskill.learning.observation import ObservationArrays
from artiskill.learning.policy import RunPolicy, export_policy
from artiskill.learning.rollouts import ROUNDS, Collector, RolloutJob, Rollouts
from artiskill.learning.run import CONFIG, INFO, LATEST
from artiskill.learning.train import RolloutData, train
from artiskill.learning.train_config import algorithm_config, load_train_config
from artiskill.robots.config import load_robot
from artiskill.robots.kinematics import RobotKinematics
from artiskill.tasks.registry import make_task, task_spec

TASK = "OpenCabinetDrawer"
AGENT = {1: 38, 2: 68}
PHASES = ("reach", "grip", "pull")


def space(arms: int = 1) -> CommandSpace:
    robot = load_robot("one_arm" if arms == 1 else "two_arms")
    posture = robot.initial.arm_qpos_rad * arms
    return CommandSpace(robot, 0.05, PHASES, arms, WholeBodyConfig(), posture, 0.1, False)


def command(arms: int, seed: int = 0) -> Command:
    rng = np.random.default_rng(seed)
    return Command(
        phase=int(rng.integers(3)),
        twists=rng.uniform(-0.5, 0.5, (arms, 6)),
        trunk_qvel=rng.uniform(-0.5, 0.5, 4),
        arm_gain_s=float(rng.uniform(0, 2)),
        grip=rng.integers(0, 3, arms),
        width_m=rng.uniform(0, 0.04, arms),
        press_n=30.0 if arms == 2 else 0.0,
    )


@pytest.mark.parametrize("arms", [1, 2])
def test_a_command_survives_being_numbers(arms: int) -> None:
    for seed in range(10):
        given = command(arms, seed)
        back = space(arms).decode(space(arms).encode(given))
        for field in dataclasses.fields(Command):
            np.testing.assert_allclose(
                getattr(back, field.name), getattr(given, field.name), atol=1e-6, rtol=1e-5, err_msg=field.name
            )


def test_motions_beyond_any_use_are_shortened() -> None:
    far = dataclasses.replace(command(1), trunk_qvel=np.array((9.0, -9.0, 0.1, 0.0)))
    back = space().decode(space().encode(far))
    np.testing.assert_allclose(back.trunk_qvel, [0.9, -0.9, 0.1, 0.0], atol=1e-6)


@pytest.mark.parametrize("arms", [1, 2])
def test_the_likeliest_kind_acts(arms: int) -> None:
    """Outputs are laid out here by hand: logits of kinds, then motion, widths and logits of grips of each."""
    own, given = space(arms), command(arms, 3)
    label, m = own.encode(given), own.motion_size
    outputs = np.random.default_rng(0).normal(size=(2, own.output_size)).astype(np.float32)
    kinds, kind = own.kinds, int(label[-1])
    outputs[1, :kinds] = np.eye(kinds)[kind] * 9
    block = outputs[1, kinds:].reshape(kinds, -1)[kind]  # a view
    block[: m + arms] = label[: m + arms]
    block[m + arms :] = (np.eye(3)[given.grip] * 9).reshape(-1)
    np.testing.assert_allclose(own.likeliest(outputs)[1], label, atol=1e-6)


def test_ways_to_roll_a_single_hand_are_kinds_of_their_own() -> None:
    kinds = []
    for roll in (0.0, 0.5, 2.0, -2.0):
        twist = np.array([[0, 0, 0, 0, 0, roll]])
        kinds.append(int(space().encode(dataclasses.replace(command(1), phase=2, twists=twist))[-1]))
    assert kinds == [6, 6, 7, 8]
    assert space(1).kinds == 9
    assert space(2).kinds == 3


def test_a_space_of_one_kind_has_one_command_for_all_phases_and_rolls() -> None:
    one = dataclasses.replace(space(), one_kind=True)
    rolling = np.array([[0, 0, 0, 0, 0, 2.0]])
    labels = [one.encode(dataclasses.replace(command(1), phase=k, twists=rolling)) for k in range(3)]
    assert one.kinds == 1
    assert one.output_size == space().output_size // 9
    assert [int(label[-1]) for label in labels] == [0, 0, 0]
    assert one.decode(labels[2]).twists[0, -1] == pytest.approx(2.0)


def test_a_space_survives_being_saved() -> None:
    assert from_mapping(CommandSpace, to_mapping(space(2))) == space(2)


def make_dagger(arms: int = 1, **values: Any) -> DAgger:
    config = load_train_config(
        "dagger", TASK, overrides={f"algorithm.{key}": value for key, value in values.items()}
    )
    network = dataclasses.replace(load_network_config("kinematic"), point_layers=(16,), head=(32,))
    sizes = Sizes(40, 3, AGENT[arms], 13)
    zeros, ones = np.zeros(AGENT[arms]), np.ones(AGENT[arms])
    statistics = Statistics(zeros[:3], ones[:3], zeros, ones)

    def make(outputs: int, extra: int) -> Any:
        generator = torch.Generator().manual_seed(1)
        return make_network(network, sizes, statistics, outputs, extra, generator, "robot", space(arms).robot)

    return DAgger(algorithm_config(config), make, sizes, None, to_mapping(space(arms)))


def labels(count: int, arms: int = 1) -> Any:
    return torch.from_numpy(np.array([space(arms).encode(command(arms, seed)) for seed in range(count)]))


def test_the_loss_counts_only_the_kind_that_the_expert_is_in() -> None:
    dagger, label = make_dagger(), labels(4)
    own, m = space(), space().motion_size
    outputs = torch.zeros(4, own.output_size)
    for row in range(4):
        kind = int(label[row, -1])
        outputs[row, kind] = 30.0
        block = outputs[row, own.kinds :].reshape(own.kinds, -1)
        block[:] = 7.0
        block[kind, : m + 1] = label[row, : m + 1]
        block[kind, m + 1 :] = torch.eye(3)[int(label[row, m + 1])] * 30
    loss, numbers = dagger.loss(outputs, label)
    assert float(loss) < 1e-6
    assert float(numbers["kind_accuracy"]) == 1.0
    outputs[:, own.kinds :] += 0.5  # errors beyond the bend count by their length, less half of the bend
    _, numbers = dagger.loss(outputs, label)
    assert float(numbers["imitation_loss"]) == pytest.approx(0.49, abs=1e-4)


def test_the_width_of_a_closed_hand_does_not_count() -> None:
    dagger, own = make_dagger(grip_weight=0.0, kind_weight=0.0), space()
    losses = []
    for grip in (Grip.OPEN, Grip.SHUT):
        given = dataclasses.replace(command(1), grip=np.array([grip]), width_m=np.array([0.04]))
        label = torch.from_numpy(own.encode(given))[None]
        outputs = torch.zeros(1, own.output_size)
        outputs[0, own.kinds :].reshape(own.kinds, -1)[:, : own.motion_size] = label[0, : own.motion_size]
        losses.append(float(dagger.loss(outputs, label)[0]))
    assert losses[0] == pytest.approx(0.05 * 0.99, rel=1e-3)
    assert losses[1] == 0


def test_updates_learn_the_commands() -> None:
    """Random clouds have commands of their own; the network tells them apart."""
    dagger, seen, label = make_dagger().train(), observe(batch=16), labels(16)
    batch = Batch(seen, label, *[torch.ones(16)] * 3, None)
    from contextlib import nullcontext

    first = dagger.update(batch, 0, torch.Generator(), lambda parameters: None, nullcontext)
    for step in range(300):
        last = dagger.update(batch, step, torch.Generator(), lambda parameters: None, nullcontext)
    assert float(last["imitation_loss"]) < 0.2 * float(first["imitation_loss"])
    assert float(last["kind_accuracy"]) == 1.0
    np.testing.assert_allclose(dagger.act(seen)[:, -1], label[:, -1])


def kinematic_features(agent: np.ndarray, points: np.ndarray, frame: str, origin: bool) -> Any:
    robot = space(1 if agent.shape[1] == 38 else 2).robot
    config = dataclasses.replace(load_network_config("kinematic").input, origin=origin)
    seen = ObservationArrays(
        points,
        np.zeros_like(points),
        np.ones((*points.shape[:2], 1), np.float32),
        np.ones(points.shape[:2], bool),
        agent,
    )
    scale = Scale(np.zeros(3), np.ones(3), np.zeros(agent.shape[1]), np.ones(agent.shape[1]))
    return make_features(seen, config, scale, frame, RobotKinematics(robot))


@pytest.mark.parametrize("arms", [1, 2])
def test_features_do_not_depend_on_where_the_robot_is(arms: int) -> None:
    """The world is turned by 0.7 and moved: base, its velocity, fingertips and points with it."""
    rng = np.random.default_rng(2)
    agent = rng.uniform(-1, 1, (1, AGENT[arms]))
    points = rng.normal(size=(1, 8, 3))
    turn, way = (
        np.array(((np.cos(0.7), -np.sin(0.7), 0), (np.sin(0.7), np.cos(0.7), 0), (0, 0, 1))),
        np.array((3, -2, 0)),
    )
    moved, start = agent.copy(), 12 * arms
    tips = agent[0, : 6 * arms].reshape(-1, 3)
    moved[0, : 6 * arms] = (tips @ turn.T + way).reshape(-1)
    moved[0, 6 * arms : start] = (agent[0, 6 * arms : start].reshape(-1, 3) @ turn.T).reshape(-1)
    moved[0, start : start + 2] = (turn @ [*agent[0, start : start + 2], 0] + way)[:2]
    moved[0, start + 2] += 0.7
    moved[0, start + 3 : start + 5] = (turn @ [*agent[0, start + 3 : start + 5], 0])[:2]
    seen, other = (
        kinematic_features(a.astype(np.float32), p.astype(np.float32), "world", False)
        for a, p in ((agent, points), (moved, points @ turn.T + way))
    )
    np.testing.assert_allclose(other.state, seen.state, atol=1e-5)
    np.testing.assert_allclose(other.points, seen.points, atol=1e-5)
    told = kinematic_features(moved.astype(np.float32), points.astype(np.float32), "robot", True)
    assert told.state.shape[1] == seen.state.shape[1] + 4, "the origin's place and its squashed copy"


def test_tensors_and_arrays_have_the_same_features() -> None:
    seen = observe(batch=3)
    robot = RobotKinematics(space().robot)
    config = load_network_config("kinematic").input
    plain = [np.zeros(3), np.ones(3), np.zeros(38), np.ones(38)]
    arrays = ObservationArrays(*(one.numpy() for one in seen))
    ours = make_features(arrays, config, Scale(*plain), "robot", robot)
    theirs = make_features(seen, config, Scale(*map(torch.from_numpy, plain)), "robot", robot)
    np.testing.assert_allclose(ours.points, theirs.points.numpy(), atol=1e-5)
    np.testing.assert_allclose(ours.state, theirs.state.numpy(), atol=1e-4)
    assert {one.dtype for one in ours[:3]} == {np.dtype(np.float32)}


def test_rounds_that_never_begin_are_refused() -> None:
    legal = load_train_config("dagger", TASK, overrides={"steps": 20, "algorithm.rounds": 20})
    assert algorithm_config(legal).round_steps(20) == 1
    config = load_train_config("dagger", TASK, overrides={"steps": 60, "algorithm.rounds": 40})
    with pytest.raises(ConfigError, match=r"room for 30 rounds of 2, not for algorithm\.rounds=40; 80 have"):
        RolloutData().open(config, Path("nowhere"))


def test_what_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="kinematic"):
        load_train_config("bc", TASK, "kinematic")
    with pytest.raises(ConfigError, match="body is for dagger"):
        load_train_config("bc", TASK, overrides={"network.input": {"body": True, "frames": ["cloud"]}})
    with pytest.raises(ConfigError, match="frames with hand need body: false"):
        load_train_config("dagger", TASK, overrides={"network.input.frames": ["robot", "hand"]})
    with pytest.raises(ConfigError, match="takeover_steps"):
        load_train_config("dagger", TASK, overrides={"algorithm.takeover_steps": [9, 3]})
    config = load_train_config("dagger", TASK, overrides={"algorithm.takeover_steps": [10, 200]})
    with pytest.raises(ConfigError, match="takeover_steps must lie below the 200 steps of an episode, not at 200"):
        RolloutData().open(config, Path("nowhere"))
    config = load_train_config("dagger", TASK, overrides={"algorithm.objects": ["test"]})
    with pytest.raises(ConfigError, match=r"neither what is trained on .* is of 'test'"):
        RolloutData().open(config, Path("nowhere"))
    more = {"algorithm.objects": ["train"], "algorithm.generated_share": 0.5}
    with pytest.raises(ConfigError, match="generated_share is for generated objects beside others"):
        RolloutData().open(load_train_config("dagger", TASK, overrides=more), Path("nowhere"))
    config = load_train_config("dagger", TASK, overrides={"algorithm.shares": [1, 1]})
    with pytest.raises(ConfigError, match=r"algorithm\.shares needs 4 numbers"):
        RolloutData().open(config, Path("nowhere"))
    config = load_train_config("dagger", "PushChair", overrides={"algorithm.shares": [1]})
    with pytest.raises(ConfigError, match="needs 2 numbers for PushChair, one for each of the masks robot"):
        RolloutData().open(config, Path("nowhere"))


# -- runs ---------------------------------------------------------------------------------------------------------

TINY: dict[str, Any] = {
    "algorithm.objects": ["cabinet-0002", "cabinet-0007"],
    "algorithm.points": 24,
    "algorithm.rounds": 3,
    "algorithm.collectors": 2,
    "algorithm.envs": 2,
    "algorithm.rollout_steps": 12,
    "algorithm.expert_rounds": 1,
    "algorithm.takeover_steps": [2, 6],
    "algorithm.augmentation.displace": 0.5,
    "network.point_layers": [8],
    "network.head": [8],
    "steps": 9,
    "batch_size": 8,
    "log_every": 3,
    "development.objects": [],
}


def tiny_run(folder: Path, workers: int = 1, stop_at: int = 0) -> Path:
    """Train a tiny run, or until it is interrupted after a step."""

    def on_step(step: int, text: str) -> None:
        if step == stop_at:
            raise ZeroDivisionError("as a crash would")

    config = load_train_config("dagger", TASK, overrides=TINY)
    train(config, RolloutData(workers, lambda text: None), folder, "cpu", 1, on_step=on_step)
    return folder


def weights(run: Path) -> dict[str, Any]:
    return torch.load(run / LATEST, weights_only=True)["weights"]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tiny_run(tmp_path_factory.mktemp("dagger") / "whole")


def test_notes_say_that_nobody_but_the_expert_acts_and_that_no_object_is_new(tmp_path: Path) -> None:
    lines: list[str] = []
    development = ["cabinet-0007", "generated:cabinet:1000000"]
    values = TINY | {"algorithm.expert_rounds": 3, "development.objects": development}
    config = load_train_config("dagger", TASK, overrides=values)
    with pytest.raises(ZeroDivisionError):
        train(
            config,
            RolloutData(1, lambda text: None),
            tmp_path / "run",
            "cpu",
            1,
            make_develop=lambda info: lambda *given: [],
            on_lines=lines.extend,
            on_start=lambda step: 1 // 0,
        )
    assert "note: the expert acts in all rounds, so this is behaviour cloning" in lines
    assert lines[-1].startswith("note: development object 'cabinet-0007' is also learned from")


def test_values_of_a_teaching_expert_are_for_no_other_expert(monkeypatch: pytest.MonkeyPatch) -> None:
    """A task of one's own may have chairs, and an expert that knows nothing of seats."""
    other = dataclasses.replace(task_spec("PushChair"), expert="my_package.chairs:MyExpert")
    monkeypatch.setattr("artiskill.learning.train_config.task_spec", lambda name: other)
    assert load_train_config("dagger", "PushChair").algorithm["expert"] == {}


def test_a_run_has_rounds_and_says_what_came_of_them(whole: Path) -> None:
    with (whole / "rounds.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["round"]) for row in rows] == [0, 1, 2]
    assert [int(float(row["samples"])) for row in rows] == [48, 48, 48]
    assert len(list((whole / ROUNDS).glob("*.npz"))) == 6
    assert len(list((whole / ROUNDS).glob("*.pt"))) == 2, "the expert alone acts in the first round"


class Still:
    """A policy that wants to stay where it is, whatever it sees."""

    def __init__(self, label: np.ndarray) -> None:
        self._label = torch.from_numpy(label)

    def act(self, seen: Any) -> Any:
        return self._label.expand(len(seen.points), -1)


@pytest.mark.parametrize(("number", "whole_share"), [(0, 0.5), (1, 0.0), (1, 1.0)])
def test_who_acts_and_that_the_expert_labels_everything(
    number: int, whole_share: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In round 0 the expert acts; later the policy, to the end or until the expert takes over."""
    envs, steps, low, high = 2, 210, 2, 6
    more = {"envs": envs, "rollout_steps": steps, "whole_share": whole_share, "takeover_steps": [low, high]}
    values = TINY | {f"algorithm.{key}": value for key, value in more.items()}
    config = load_train_config("dagger", TASK, overrides=values)
    info = Rollouts(config, tmp_path).info(config, {})
    made = Collector(config, info)
    own = from_mapping(CommandSpace, info.commands)
    still = own.encode(dataclasses.replace(command(1), twists=np.zeros((1, 6)), trunk_qvel=np.zeros(4)))
    monkeypatch.setattr(Collector, "_load", lambda self, job: Still(still))
    carried_out: list[np.ndarray] = []
    act = CommandActor.action

    def action(self: CommandActor, agent: np.ndarray, label: np.ndarray) -> np.ndarray:
        carried_out.append(label.copy())
        return act(self, agent, label)

    monkeypatch.setattr(CommandActor, "action", action)
    _, labels, counts = made.run(RolloutJob(tmp_path, number, 0), lambda message: None)
    done = np.array(carried_out).reshape(steps, envs, -1)
    expected = labels.reshape(steps, envs, -1)  # of the expert, in every state
    by_policy = (done == still).all(axis=2)
    assert not (expected == still).all(axis=2).any()
    np.testing.assert_array_equal(done[~by_policy], expected[~by_policy])
    assert counts.samples == steps * envs
    if number == 0:
        assert not by_policy.any()
        assert counts[1:5] == (counts.expert_episodes, counts.expert_episodes, 0, 0)
    elif whole_share == 1.0:
        assert by_policy.all()
        assert counts[1:5] == (0, 0, envs, 0)  # which end after 200 steps
    else:
        for env in range(envs):
            runs = "".join("p" if one else "e" for one in by_policy[:, env]).split("e")
            lengths = [len(run) for run in runs if run]
            assert all(low <= length <= high for length in lengths[:-1]), lengths
            assert by_policy[:low, env].all()
        assert counts[1:5] == (counts.expert_episodes, counts.expert_episodes, 0, 0)
    assert counts.expert_episodes == (0 if whole_share == 1.0 else pytest.approx(5, abs=2))


@pytest.mark.parametrize(("workers", "stop_at"), [(2, 0), (1, 4), (1, 8)])
def test_the_same_bits_in_any_number_of_processes_and_after_a_crash(
    whole: Path, tmp_path: Path, workers: int, stop_at: int
) -> None:
    run = tmp_path / "run"
    if stop_at:
        with pytest.raises(ZeroDivisionError):
            tiny_run(run, workers, stop_at)
    ours, theirs = weights(tiny_run(run, workers)), weights(whole)
    for name, value in theirs.items():
        assert torch.equal(ours[name], value), name


def test_dropout_has_the_same_bits_in_any_number_of_processes(tmp_path: Path) -> None:
    """Making the policy that collects draws from torch's own generator, as dropout does."""
    transformer = {"width": 8, "blocks": 1, "heads": 1, "head_width": 8, "feedforward": 8, "dropout": 0.5}
    values = TINY | {"algorithm.rounds": 2, "steps": 2, "network.transformer": transformer}
    config = load_train_config("dagger", TASK, "small_transformer", values)
    for workers in (1, 2):
        train(config, RolloutData(workers, lambda text: None), tmp_path / str(workers), "cpu", 1)
    ours, theirs = (weights(tmp_path / name) for name in ("1", "2"))
    for name, value in theirs.items():
        assert torch.equal(ours[name], value), name


@pytest.mark.parametrize(("share", "kinds"), [(0.0, {"c"}), (0.5, {"c", "g"}), (1.0, {"g"})])
def test_how_often_generated_objects_are_drawn(share: float, kinds: set[str], tmp_path: Path) -> None:
    more = {"algorithm.objects": ["cabinet-0002", "generated:cabinet:0..9"], "algorithm.generated_share": share}
    config = load_train_config("dagger", TASK, overrides=TINY | more)
    collector = Collector(config, Rollouts(config, tmp_path).info(config, {}))
    collector._rng = np.random.default_rng(0)
    drawn = []
    for _ in range(8):
        collector._begin(np.ones(2, dtype=bool))
        drawn += collector._env.get_attr("object")
    assert {name[0] for name in drawn} == kinds
    if share == 0.5:
        assert 3 <= sum(name == "cabinet-0002" for name in drawn) <= 13, "of 16"


def test_imported_objects_teach_and_develop(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """They have no name that says what they are: folders are read by whoever needs them."""
    for name, copied in (("a", "cabinet-0007"), ("b", "cabinet-0003")):
        export_object(dataclasses.replace(load_object(copied), id=f"own-{name}"), "urdf", tmp_path / name)
    values = [f"{key}={value}" for key, value in TINY.items() if not key.endswith("objects")]
    command = ["train", "dagger", "--task", TASK, "--out", str(tmp_path / "run"), "--workers", "2"]
    command += ["--objects", "generated:cabinet:9..12", str(tmp_path / "a"), "--dev-objects", str(tmp_path / "b")]
    command += ["--dev-episodes", "1", "--dev-every", "9", "--set", *values, "algorithm.generated_share=0.5"]
    assert main(command) == 0
    assert json.loads((tmp_path / "run" / INFO).read_text())["objects"][-1] == "own-a"
    assert "own-b" in (tmp_path / "run/development.csv").read_text()
    assert main(command) == 0, "nothing is left to do"
    other = dataclasses.replace(load_object("cabinet-0003"), id="own-a")
    export_object(other, "urdf", tmp_path / "a", force=True)
    capsys.readouterr()
    assert main(command) == 2
    assert "other data" in capsys.readouterr().err, "of the same name, but another object"


def test_an_imported_object_is_not_taken_for_its_original(tmp_path: Path) -> None:
    original = load_object("generated:cabinet:9")
    heavy = [dataclasses.replace(link, density_kg_m3=3 * link.density_kg_m3) for link in original.links]
    export_object(dataclasses.replace(original, links=tuple(heavy)), "urdf", tmp_path / "heavy")
    config = load_train_config("dagger", TASK, overrides=TINY | {"algorithm.objects": [str(tmp_path / "heavy")]})
    rollouts = Rollouts(config, tmp_path)
    collector = Collector(config, rollouts.info(config, {}))
    assert [one.content_hash for one in collector._objects.values()] != [original.content_hash]  # type: ignore[union-attr]
    changed = dataclasses.replace(rollouts.info(config, {}), data="of other objects")
    with pytest.raises(RunError, match="has changed since"):
        Collector(config, changed)
    same = dataclasses.replace(load_object("cabinet-0007"), id="cabinet-0002")
    export_object(same, "urdf", tmp_path / "named")
    config = load_train_config("dagger", TASK, overrides=TINY | {"algorithm.objects": [str(tmp_path / "named")]})
    with pytest.raises(AssetError, match="another id"):
        Rollouts(config, tmp_path)


def test_rounds_that_are_lost_are_collected_again(whole: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    shutil.copytree(whole, run)
    for name in ("0000-1.npz", "0001-0.npz"):  # of the expert alone, and of a policy
        (run / ROUNDS / name).unlink()
    (run / LATEST).unlink()
    with pytest.raises(ZeroDivisionError):
        tiny_run(run, stop_at=5)
    (run / ROUNDS / "0000-0.npz").unlink()  # before the checkpoint
    ours = weights(tiny_run(run))
    for name, value in weights(whole).items():
        assert torch.equal(ours[name], value), name
    for name in ("0000-1.npz", "0001-0.npz"):
        with np.load(run / ROUNDS / name) as again, np.load(whole / ROUNDS / name) as before:
            np.testing.assert_array_equal(again["records"], before["records"])
            np.testing.assert_array_equal(again["labels"], before["labels"])


@pytest.mark.parametrize("damage", [lambda data: data[:99], lambda data: b"", lambda data: b"x" + data[1:]])
def test_a_damaged_round(whole: Path, tmp_path: Path, damage: Callable[[bytes], bytes]) -> None:
    run = tmp_path / "run"
    shutil.copytree(whole, run)
    path = run / ROUNDS / "0000-1.npz"
    path.write_bytes(damage(path.read_bytes()))
    (run / LATEST).unlink()
    with pytest.raises(
        RunError, match=r"0000-1\.npz' is damaged .*remove it, and the same command collects it again"
    ):
        tiny_run(run)


def test_a_round_whose_policy_is_lost(whole: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    shutil.copytree(whole, run)
    (run / LATEST).unlink()
    with pytest.raises(ZeroDivisionError):
        tiny_run(run, stop_at=8)
    (run / ROUNDS / "0001-0.npz").unlink()
    (run / ROUNDS / "0001.pt").unlink()
    with pytest.raises(RunError, match=r"0001\.pt' is missing: train anew"):
        tiny_run(run)


def test_another_run_in_the_same_folder_collects_by_its_own_values(tmp_path: Path) -> None:
    tiny_run(tmp_path / "run")
    shutil.rmtree(tmp_path / "run")
    config = load_train_config("dagger", TASK, overrides=TINY | {"algorithm.envs": 3})
    train(config, RolloutData(1, lambda text: None), tmp_path / "run", "cpu", 1)
    with np.load(tmp_path / "run" / ROUNDS / "0000-0.npz") as found:
        assert len(found["labels"]) == 3 * TINY["algorithm.rollout_steps"]


def test_more_steps_are_another_run(whole: Path, tmp_path: Path) -> None:
    """Rounds are shares of the steps."""
    config = load_train_config("dagger", TASK, overrides=TINY | {"schedule": "constant"})
    more = dataclasses.replace(config, steps=18)
    with pytest.raises(RunError, match="steps 9 there, 18 here"):
        config.check_continues(more, tmp_path)


def test_a_run_that_began_before_a_value_was_there_goes_on(whole: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    shutil.copytree(whole, run)
    text = (run / CONFIG).read_text()
    nested, dotted = "    grasp:\n      roll_weight: 0.3\n", "    grasp.roll_weight: 0.3\n"
    assert nested in text
    assert "  one_kind: false\n" in text
    (run / CONFIG).write_text(text.replace("  one_kind: false\n", "").replace(nested, dotted))
    tiny_run(run)
    assert (run / CONFIG).read_text() == text


def test_a_run_acts_and_its_file_acts_alike_without_torch(whole: Path, tmp_path: Path) -> None:
    from artiskill.envs.manipulation import ManipulationEnv

    header = export_policy(whole, tmp_path / "policy.npz")
    assert header.algorithm == "dagger"
    run, file = RunPolicy(whole), ArrayPolicy(tmp_path / "policy.npz")
    env = ManipulationEnv(TASK, ["cabinet-0002"], obs_mode="pointcloud")
    from artiskill.envs.wrappers import Sampling

    env = Sampling(**run.sampling).wrap(env)
    seen, _ = env.reset(options={"level": 5})
    for _ in range(5):
        action = file.act(seen)
        np.testing.assert_allclose(action, run.act(seen), atol=1e-5)
        assert action.shape == (13,)
        assert np.abs(action).max() <= 1
        seen, *_ = env.step(action)


def test_a_file_whose_points_do_not_fit_its_network_is_refused(whole: Path, tmp_path: Path) -> None:
    path = tmp_path / "policy.npz"
    export_policy(whole, path)
    with np.load(path) as archive:
        values = {name: archive[name] for name in archive.files}
    header = json.loads(str(values["header"]))
    assert header["network"]["input"]["frames"] == ["robot", "tool"]
    header["network"]["input"]["frames"] = ["tool"]
    np.savez(path, **values | {"header": np.array(json.dumps(header))})
    with pytest.raises(PolicyError, match="is damaged: its weights do not fit its network"):
        ArrayPolicy(path)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"commands": {}}, "network.input.body needs commands"),
        ({"commands": {"arms": 2}}, "arms must be at most 1, those of the robot"),
        ({"commands": {"arm_qpos_rad": [0.0]}}, "arm_qpos_rad"),
        ({"frame": "end_effector"}, "points are in frame 'end_effector', and are sampled in 'robot'"),
    ],
)
def test_a_file_whose_commands_do_not_fit_is_refused(
    whole: Path, tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    path = tmp_path / "policy.npz"
    export_policy(whole, path)
    with np.load(path) as archive:
        values = {name: archive[name] for name in archive.files}
    header = json.loads(str(values["header"]))
    for name, value in changes.items():
        header[name] = header[name] | value if value and isinstance(value, dict) else value
    np.savez(path, **values | {"header": np.array(json.dumps(header))})
    with pytest.raises(PolicyError, match=f"is damaged: .*{message}"):
        ArrayPolicy(path)


def test_a_run_is_evaluated(whole: Path) -> None:
    report = evaluate(TASK, str(whole), ["cabinet-0007"], episodes=1, config={"episode_steps": 5})
    assert report.rows[0].stats.episodes == 1


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("dagger", "--data", "x"), "--data is of demonstrations"),
        (("bc",), "--data is needed"),
        (("bc", "--data", "x", "--samples", "9"), "--samples is for dagger, not for bc"),
        (("dagger", "--samples", "0"), "--samples must be at least 1, not 0"),
        (("dagger", "--workers", "0"), "workers must be a whole number of at least 1, not 0"),
        (("sac", "--workers", "2"), "--workers is not for sac"),
        (("ppo", "--device", "cuda"), "--device is auto or cpu for ppo, not 'cuda'"),
    ],
)
def test_options_of_the_other_kind(
    arguments: tuple[str, ...], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from artiskill.cli.main import main

    assert main(["train", *arguments, "--task", TASK, "--out", str(tmp_path / "run")]) == 2
    assert says in capsys.readouterr().err


@pytest.mark.parametrize("algorithm", ["dagger", "sac"])
def test_rollouts_are_of_one_process(
    algorithm: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from artiskill.cli.main import main

    for name, value in (("RANK", "0"), ("WORLD_SIZE", "2")):
        monkeypatch.setenv(name, value)
    assert main(["train", algorithm, "--task", TASK, "--out", str(tmp_path / "run")]) == 2
    assert f"{algorithm} trains in one process: start it without torchrun" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "batch_size"), [((), None), (("--batch-size", "64"), 64), (("--set", "batch_size=32"), 32)]
)
def test_samples_set_rounds_and_steps(more: tuple[str, ...], batch_size: int | None) -> None:
    from artiskill.cli.main import make_parser
    from artiskill.cli.train import _overrides

    given = ["--points", "64", "--objects", "train", "--samples", "20000", "--out", "run", *more]
    found = _overrides(make_parser().parse_args(["train", "dagger", "--task", TASK, *given]))
    assert found == {
        "algorithm.points": 64,
        "algorithm.objects": ["train"],
        "algorithm.rounds": 5,  # of 4,800 each
        "steps": 7 * 24_000 // (batch_size or 128),
        **({} if batch_size is None else {"batch_size": batch_size}),
    }


def test_samples_leave_room_for_all_rounds() -> None:
    from artiskill.cli.main import make_parser
    from artiskill.cli.train import _overrides

    given = ["--samples", "192000", "--batch-size", "2048", "--out", "run"]
    found = _overrides(make_parser().parse_args(["train", "dagger", "--task", TASK, *given]))
    config = load_train_config("dagger", TASK, overrides=found)
    assert algorithm_config(config).round_steps(config.steps) * 40 == config.steps
    assert 7 * 192_000 <= config.steps * 2048 < 7.3 * 192_000


def test_samples_may_be_of_any_network() -> None:
    from artiskill.cli.main import make_parser
    from artiskill.cli.train import _overrides

    given = ["--network", "small_transformer", "--set", "network.transformer.blocks=1", "--samples", "4800"]
    found = _overrides(make_parser().parse_args(["train", "dagger", "--task", TASK, "--out", "run", *given]))
    assert found["algorithm.rounds"] == 1


@pytest.mark.parametrize(
    ("task", "samples", "share", "taught"),
    [
        ("OpenCabinetDrawer", 96_000, None, {"overshoot", "grasp"}),
        ("OpenCabinetDoor", 192_000, None, {"overshoot", "grasp"}),
        ("PushChair", 192_000, 0.5, {"seat"}),
        ("MoveBucket", 192_000, 0.5, set()),
    ],
)
def test_each_task_has_the_values_of_the_policies_that_come_with_the_package(
    task: str, samples: int, share: float | None, taught: set[str]
) -> None:
    """Those of docs/generalization.md; where other objects are named, none is played more often than others."""
    config = load_train_config("dagger", task)
    values = config.algorithm
    assert values["rounds"] * values["collectors"] * values["envs"] * values["rollout_steps"] == samples
    assert values["generated_share"] == share
    own, teaching = (to_mapping(commanding_expert(make_task(task), v).config) for v in ({}, values["expert"]))
    assert {key for key in own if own[key] != teaching[key]} == taught, "what it does otherwise where it teaches"
    plain = load_train_config("dagger", task, overrides={"algorithm.expert": {}}).algorithm["expert"]
    assert plain == {}, "the expert may teach as it acts"
    named = load_train_config("dagger", task, overrides={"algorithm.objects": ["train"]})
    assert named == dataclasses.replace(config, algorithm=values | {"objects": ["train"], "generated_share": None})
