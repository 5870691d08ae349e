"""Reports that anyone can check: honest ones hold, and whatever is changed is found."""

import json
import math
import re
import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import artiskill
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ArtiSkillError, ConfigError
from artiskill.evaluation.action_replay import pack_actions, unpack_actions
from artiskill.evaluation.evaluate import evaluate, run_episode
from artiskill.evaluation.plan import plan_evaluation
from artiskill.evaluation.policies import StillActor
from artiskill.evaluation.protocols import Protocol
from artiskill.evaluation.report import (
    ACTIONS_FILE,
    REPORT_FILES,
    Report,
    make_report,
    mapping_sha256,
    write_report,
)
from artiskill.evaluation.statistics import EpisodeResult, object_interval, summarize
from artiskill.evaluation.verify import compare_reports, verify_policy, verify_report
from artiskill.exports.export import export_object

TASK, OBJECTS = "OpenCabinetDrawer", ["generated-cabinet-1000000", "generated-cabinet-1000002"]
SHORT = {"episode_steps": 5}
EASY = {"episode_steps": 20, "success.open_fraction": 0.001}


@pytest.fixture(scope="module")
def report() -> Report:
    """Short: an expert that reaches no handle; with rates that differ all the same, for a cabinet stands still."""
    return evaluate(TASK, "expert", OBJECTS, 3, 5, config=EASY)


@pytest.fixture(scope="module")
def folder(report: Report, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_report(report, tmp_path_factory.mktemp("report"))


def copied(folder: Path, to: Path) -> Path:
    for name in REPORT_FILES:
        (to / name).write_bytes((folder / name).read_bytes())
    return to


def faults(folder: Path) -> str:
    return "\n".join(verify_report(folder).faults)


def test_an_honest_report_holds(report: Report, folder: Path) -> None:
    seen: list[EpisodeResult] = []
    found = verify_report(folder, on_episode=seen.append)
    assert (found.faults, found.episodes) == ((), 6)
    assert found.steps == sum(episode.length for episode in report.episodes)
    assert sorted(seen, key=str) == sorted(report.episodes, key=str)
    assert verify_report(folder, workers=2) == found


def test_the_actions_are_those_of_the_episodes(report: Report, folder: Path) -> None:
    """A single environment, one step after the other, does with the stored actions what the report says."""
    stored = unpack_actions((folder / ACTIONS_FILE).read_bytes())
    env = ManipulationEnv(TASK, OBJECTS, config=EASY)
    for episode, actions in zip(report.episodes, stored, strict=True):
        env.reset(options={"level": episode.level, "object": episode.object})
        reward_sum, done = 0.0, False
        for action in actions:
            assert not done
            _, reward, terminated, truncated, info = env.step(action)
            reward_sum += reward  # one after the other: Python's `sum` compensates from 3.12 on
            done = terminated or truncated
        assert done
        assert (info["flags"], info["success"], reward_sum) == (
            episode.flags,
            episode.success,
            episode.reward_sum,
        )


# -- what is written consistently, by somebody who knows the format ----------------------------------------------


def with_episodes(report: Report, episodes: Sequence[EpisodeResult], per_row: int = 3) -> Report:
    """The report that would follow from these episodes."""
    parts = [episodes[start : start + per_row] for start in range(0, len(episodes), per_row)]
    rows = tuple(replace(row, stats=summarize(part)) for row, part in zip(report.rows, parts, strict=False))
    total, spread = summarize(episodes), object_interval(episodes)
    return replace(report, episodes=tuple(episodes), rows=rows, total=total, interval_over_objects=spread)


def changed(number: int, **values: Any) -> Callable[[Report], Report]:
    def change(report: Report) -> Report:
        episodes = list(report.episodes)
        episodes[number] = replace(episodes[number], **values)
        return with_episodes(report, episodes)

    return change


def order(*numbers: int, per_row: int = 3) -> Callable[[Report], Report]:
    return lambda report: with_episodes(report, [report.episodes[k] for k in numbers], per_row)


def last_digits(report: Report) -> Report:
    actions = report.episodes[1].actions.copy()
    actions[7, 4] *= 1.0 - 1e-14  # the last bit alone may be lost where numbers become velocities
    return changed(1, actions=actions)(report)


def longer(report: Report) -> Report:
    return changed(2, actions=np.concatenate([report.episodes[2].actions, np.zeros((1, 13))]))(report)


def shorter(report: Report) -> Report:
    return changed(2, actions=report.episodes[2].actions[:-1], length=report.episodes[2].length - 1)(report)


def total(**values: Any) -> Callable[[Report], Report]:
    return lambda report: replace(report, total=replace(report.total, **values))


def row(number: int, **values: Any) -> Callable[[Report], Report]:
    def change(report: Report) -> Report:
        rows = list(report.rows)
        rows[number] = replace(rows[number], **values)
        return replace(report, rows=tuple(rows))

    return change


def header(**values: Any) -> Callable[[Report], Report]:
    return lambda report: replace(report, **values)


def names_swapped(report: Report) -> Report:
    one, other = (entry.object for entry in report.rows)
    swapped = {one: other, other: one}
    episodes = [replace(episode, object=swapped[episode.object]) for episode in report.episodes]
    rows = tuple(replace(entry, object=swapped[entry.object]) for entry in report.rows)
    return with_episodes(replace(report, rows=rows), episodes)


FORGED: dict[str, Callable[[Report], Report]] = {
    "success": lambda report: changed(0, success=not report.episodes[0].success)(report),
    "all solved": lambda report: with_episodes(
        report, [replace(episode, success=True) for episode in report.episodes]
    ),
    "length": changed(1, length=7),
    "flag": lambda report: changed(3, flags={name: not held for name, held in report.episodes[3].flags.items()})(
        report
    ),
    "reward by one bit": lambda report: changed(
        4, reward_sum=float(np.nextafter(report.episodes[4].reward_sum, 0.0))
    )(report),
    "state digest": changed(0, digest="0123456789abcdef"),
    "target": changed(0, target="link_7"),
    "level of an episode": changed(2, level=9),
    "object of an episode": changed(2, object="cabinet-0005"),
    "fault": changed(0, fault="DivergedError: it was the physics", digest="", success=False),
    "fault of the policy": changed(0, fault="FloatingPointError: not finite", digest="", success=False),
    "levels": header(levels=(6, 8)),
    "fewer levels": header(levels=(5, 6)),
    "salt": header(levels=None, salt="pepper"),
    "names of objects": names_swapped,
    "name of an object": row(0, object="cabinet-0005"),
    "target of a row": row(1, target="link_0"),
    "content hash": row(1, content_hash="0123456789abcdef"),
    "success rate": total(success_rate=0.99),
    "successes": total(successes=5),
    "mean length": total(mean_length=19.0),
    "interval": lambda report: total(interval=(0.2, report.total.interval[1]))(report),
    "interval over objects": header(interval_over_objects=(0.4, 0.9)),
    "flags over all": total(flags={"target_open": 1.0, "target_static": 1.0}),
    "protocol": header(protocol=Protocol("artiskill-1/OpenCabinetDrawer/test/joint/state", "0123456789abcdef")),
    "protocol's name": lambda report: header(
        protocol=Protocol("artiskill-1/OpenCabinetDrawer/test/joint/state", report.protocol.digest)
    )(report),
    "observations": header(obs_mode="pointcloud"),
    "control": header(control_mode="operational_space"),
    "task": header(task="OpenCabinetDoor"),
    "configuration": lambda report: header(config=report.config | {"episode_steps": 21})(report),
    "version": lambda report: header(versions=report.versions | {"numpy": "1.0.0"})(report),
    "track": header(track="no-interactions"),
    "interval by one digit": lambda report: total(
        interval=(report.total.interval[0], float(np.nextafter(report.total.interval[1], 0.0)))
    )(report),
    "actions of another object": lambda report: with_episodes(
        report,
        [
            replace(one, actions=other.actions)
            for one, other in zip(report.episodes, reversed(report.episodes), strict=True)
        ],
    ),
    "speed": lambda report: header(timing=report.timing | {"steps_per_s": 1.5})(report),
    "last digits of an action": last_digits,
    "an action more": longer,
    "an action less": shorter,
    "episodes swapped": order(1, 0, 2, 3, 4, 5),
    "objects swapped": order(3, 4, 5, 0, 1, 2),
    "an episode twice": order(0, 0, 2, 3, 4, 5),
    "an episode dropped": order(0, 1, 2, 3, 4),
    "an episode more": order(0, 1, 2, 3, 4, 5, 5, per_row=4),
}


@pytest.mark.parametrize("kind", FORGED)
def test_what_is_forged_with_care_is_found(report: Report, tmp_path: Path, kind: str) -> None:
    forged = FORGED[kind](report)
    write_report(forged, tmp_path)
    data = json.loads((tmp_path / "report.json").read_text())
    assert data["sha256"] == mapping_sha256(data), "its own digest finds nothing"
    assert faults(tmp_path)


# -- what is changed in single files ------------------------------------------------------------------------------

EDITED = {
    "report.json": [
        '"seconds": ',
        '"policy": "',
        '"python": "3.',
        '"workers": ',
        '"sha256": "',
        '"mean_length": ',
    ],
    "episodes.csv": [",5,", ",20,", ",-"],
    "report.csv": ["generated-cabinet-100000", "0."],
    "report.md": ["| 0/3 | ", "Levels ", "numpy "],
    "config.yaml": ["episode_steps: ", "timestep_s: 0.00"],
}


@pytest.mark.parametrize(("name", "before"), [(name, one) for name, many in EDITED.items() for one in many])
def test_a_digit_that_is_changed_is_found(folder: Path, tmp_path: Path, name: str, before: str) -> None:
    path = copied(folder, tmp_path) / name
    text = path.read_text()
    at = text.index(before) + len(before)
    digit = "7" if text[at] != "7" else "3"
    path.write_text(text[:at] + digit + text[at + 1 :])
    assert name in faults(tmp_path)


def test_other_actions_are_found(folder: Path, tmp_path: Path) -> None:
    path = copied(folder, tmp_path) / ACTIONS_FILE
    actions = unpack_actions(path.read_bytes())
    actions[4][3, 3] = -actions[4][3, 3]
    path.write_bytes(pack_actions(actions))
    says = faults(tmp_path)
    assert "actions_sha256" in says
    assert "episodes.csv: line 6" in says


@pytest.mark.parametrize(
    "content", [b"", b"PK", b"PK\x05\x06" + bytes(18), pack_actions([np.full((3, 13), np.nan)]), b"x" * 4096]
)
def test_actions_that_are_none(folder: Path, tmp_path: Path, content: bytes) -> None:
    (copied(folder, tmp_path) / ACTIONS_FILE).write_bytes(content)
    assert "the actions cannot be played" in faults(tmp_path)


def test_actions_with_something_else_beside_them(folder: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(copied(folder, tmp_path) / ACTIONS_FILE, "a") as archive:
        archive.writestr("weights.npy", b"anything")
    assert "the actions cannot be played: its arrays do not fit together" in faults(tmp_path)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda data: data.pop("task"), "'task' is missing"),
        (lambda data: data.update(levls=1), "did you mean 'levels'"),
        (lambda data: data.update(track="the best"), "unknown track 'the best'"),
        (lambda data: data.update(salt="x"), "either levels or a salt"),
        (lambda data: data.update(levels=[5, 2**31]), "levels must be a lower and a higher number"),
        (lambda data: data.update(objects=[]), "objects must not be empty"),
        (lambda data: data["timing"].update(seconds=0), "seconds must be positive"),
        (lambda data: data["timing"]["act_ms"].update(p95=1e9), "act_ms must rise"),
        (lambda data: data["timing"]["machine"].update(cores="many"), "cores"),
        (lambda data: data.update(successes="many"), "successes"),
    ],
)
def test_what_is_no_report(folder: Path, tmp_path: Path, change: Callable[[Any], object], says: str) -> None:
    path = copied(folder, tmp_path) / "report.json"
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))
    with pytest.raises(ConfigError, match=says):
        verify_report(tmp_path)


def test_a_folder_without_a_report(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"is no whole report: config\.yaml: No such file"):
        verify_report(tmp_path)
    with pytest.raises(ConfigError, match=r"^there is no folder '.*none'; a report is a folder"):
        verify_report(tmp_path / "none")


def paths_in(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if path:
        yield path
    keys = value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    for key in keys:
        yield from paths_in(value[key], (*path, key))


def test_nonsense_is_an_error_or_a_difference(folder: Path, tmp_path: Path, rng: np.random.Generator) -> None:
    path = copied(folder, tmp_path) / "report.json"
    text = path.read_text()
    # configurations have tests of their own; which policy acted, how fast, and where cannot be known afterwards
    unknown = ("config", "policy_sha256", "act_ms", "machine")
    places = [one for one in paths_in(json.loads(text)) if not {one[0], one[min(1, len(one) - 1)]} & {*unknown}]
    for _ in range(40):
        data = json.loads(text)
        *keys, last = places[rng.integers(len(places))]
        place = data
        for key in keys:
            place = place[key]
        nonsense = [None, -1, 10**30, 1.5, "x", "../../etc", [], {}, [1], math.nan]
        place[last] = nonsense[rng.integers(len(nonsense))]
        path.write_text(json.dumps(data | {"sha256": mapping_sha256(data)}, indent=2) + "\n")
        with suppress(ArtiSkillError):
            assert faults(tmp_path) or path.read_text() == text, (keys, last, place[last])


def test_other_versions_are_one_difference(report: Report, tmp_path: Path) -> None:
    """Of what the versions here give, nothing else is said to be wrong."""
    write_report(FORGED["version"](report), tmp_path)
    here = report.versions["numpy"]
    says = f'made with other versions, which may give other numbers: numpy "1.0.0" there, "{here}" here'
    assert verify_report(tmp_path).faults == (says,)


# -- faults, targets, objects -------------------------------------------------------------------------------------


def test_an_episode_that_diverges_can_be_verified(tmp_path: Path) -> None:
    class Wild:
        obs_mode = "state"

        def reset(self, observation: Any, info: dict[str, Any]) -> None:
            self.level, self.step = info["level"], 0

        def act(self, observation: Any) -> np.ndarray:
            self.step += 1
            return np.tile((1.0, -1.0), 7)[:13] * (self.level == 1 and self.step > 2)

    fragile = {"physics.integrator": "rk4", "physics.timestep_s": 0.01, "episode_steps": 4}
    report = evaluate(TASK, Wild(), "cabinet-0005", 3, config=fragile)
    assert report.total.faults == {"DivergedError": 1}
    assert verify_report(write_report(report, tmp_path)).faults == ()
    forged = with_episodes(report, [replace(report.episodes[1], fault="", digest="0" * 16)] * 3)
    assert faults(write_report(forged, tmp_path))


def test_an_experts_own_fault_can_be_verified(tmp_path: Path) -> None:
    class Shaky(StillActor):
        def act(self, env: ManipulationEnv, observation: Any) -> np.ndarray:
            if env.save_state().elapsed == 2:
                raise np.linalg.LinAlgError("SVD did not converge")
            return super().act(env, observation)

    plan = plan_evaluation(TASK, "still", OBJECTS[:1], 1, config=SHORT)
    result = run_episode(plan.batches[0].make_env(), Shaky(), 0)
    report = make_report(plan, [[result]], 1.0, 1)
    assert report.total.faults == {"LinAlgError": 1}
    assert verify_report(write_report(report, tmp_path)).faults == ()


def test_targets_objects_of_ones_own_and_fresh_levels(tmp_path: Path) -> None:
    cabinet = replace(artiskill.load_object("generated:8"), id="mine")
    report = evaluate(TASK, "random", [cabinet, OBJECTS[0]], 1, target="all", config=SHORT, salt="2026-11-23 a")
    assert (report.levels, report.salt) == (None, "2026-11-23 a")
    assert report.protocol.id.endswith("/fresh-2026-11-23 a")
    write_report(report, tmp_path)
    assert "the report's object 'mine' is none of this package: name it, or the folder" in faults(tmp_path)
    assert verify_report(tmp_path, objects=[cabinet]).faults == ()
    export_object(cabinet, "urdf", tmp_path / "own" / "mine")
    (tmp_path / "own" / "list.yaml").write_text("objects: [./mine]\n")
    assert verify_report(tmp_path, objects=[str(tmp_path / "own" / "list.yaml")]).faults == ()
    other = replace(artiskill.load_object("generated:9"), id="mine")
    assert "content_hash" in "\n".join(verify_report(tmp_path, objects=[other]).faults) or faults(tmp_path)


# -- with the policy ----------------------------------------------------------------------------------------------

POLICY = (
    "import numpy as np\n"
    "class Policy:\n    obs_mode = 'state'\n    calls = 0\n"
    "    def reset(self, observation, info):\n        self.step = 0\n"
    "    def act(self, observation):\n        self.step += 1\n"
    "        return np.sin(observation[:13] + self.step + np.random.rand(13) + {extra})\n"
)


def test_the_policy_at_hand_plays_a_sample_again(
    solution: Callable[[str], Path], tmp_path: Path, rng: np.random.Generator
) -> None:
    path = solution(POLICY.format(extra="0"))
    write_report(evaluate(TASK, path, OBJECTS, 2, config=SHORT), tmp_path / "out")
    found = verify_policy(tmp_path / "out", str(path), 1, rng)
    assert (found.faults, found.episodes) == ((), 2)
    assert verify_policy(tmp_path / "out", str(path), 99, rng).episodes == 4
    with pytest.raises(ConfigError, match="must be at least 1, not 0"):
        verify_policy(tmp_path / "out", str(path), 0, rng)
    path.write_text(POLICY.format(extra="1e-9"))
    assert "is not the policy of the report" in verify_policy(tmp_path / "out", str(path), 3, rng).faults[0]


def test_an_archive_that_unpacks_to_more_than_its_episodes_is_refused(folder: Path, tmp_path: Path) -> None:
    many = pack_actions([np.zeros((1_000_000, 13))])
    assert len(many) < 100_000
    (copied(folder, tmp_path) / ACTIONS_FILE).write_bytes(many)
    assert re.search(r"unpacks to 52 MB, more than the \d MB allowed", faults(tmp_path))


def test_a_policy_of_any_name_is_read(report: Report, tmp_path: Path) -> None:
    write_report(report, tmp_path / "address")
    path = tmp_path / "address" / "report.json"
    data = json.loads(path.read_text()) | {"policy": "ws://"}
    path.write_text(json.dumps(data | {"sha256": mapping_sha256(data)}, indent=2) + "\n")
    assert all(fault.startswith("report.md: ") for fault in verify_report(tmp_path / "address").faults)
    write_report(replace(report, policy="my\u00a0policy 💡.py"), tmp_path / "spaces")
    assert verify_report(tmp_path / "spaces").faults == ()


def test_a_name_that_no_report_can_hold_is_refused_beforehand(solution: Callable[[str], Path]) -> None:
    path = solution(POLICY.format(extra="0"))
    path = path.rename(path.with_name("a\x1b[2J.py"))
    with pytest.raises(ConfigError, match=r"a report cannot name the policy: .* is not one line"):
        plan_evaluation(TASK, path, OBJECTS, 2, config=SHORT)


def test_a_policy_that_acts_otherwise_is_found(folder: Path, rng: np.random.Generator) -> None:
    assert verify_policy(folder, "expert", 1, rng).faults == ()
    assert "acts otherwise from step 0 on" in verify_policy(folder, "still", 1, rng).faults[0]


# -- two reports --------------------------------------------------------------------------------------------------


def test_reports_of_one_protocol_compare(report: Report, folder: Path, tmp_path: Path) -> None:
    write_report(evaluate(TASK, "still", OBJECTS, 3, 5, config=EASY), tmp_path / "still")
    first, second, found = compare_reports(folder, tmp_path / "still")
    assert (first.policy, second.policy) == ("expert", "still")
    assert found.difference == found.second.success_rate - report.success_rate
    assert found.only_second - found.only_first == found.second.successes - report.total.successes
    assert compare_reports(folder, folder)[2].interval is None
    write_report(evaluate(TASK, "still", OBJECTS, 2, 5, config=EASY), tmp_path / "fewer")
    with pytest.raises(
        ConfigError, match=r"^reports of different protocols do not compare: 'custom/.* and 'custom/"
    ):
        compare_reports(folder, tmp_path / "fewer")


def test_a_damaged_report_does_not_compare(folder: Path, tmp_path: Path) -> None:
    path = copied(folder, tmp_path) / "episodes.csv"
    path.write_text(path.read_text().replace(",20,", ",19,", 1))
    with pytest.raises(ConfigError, match="is damaged or forged; `artiskill report verify` says where"):
        compare_reports(folder, tmp_path)


def test_actions_survive_their_file(rng: np.random.Generator) -> None:
    exact = [rng.uniform(-1, 1, (length, 13)) for length in (0, 3, 1)]
    short = [one.astype(np.float32).astype(np.float64) for one in exact]
    for actions in (exact, short):
        found = unpack_actions(pack_actions(actions))
        assert [one.tobytes() for one in found] == [one.tobytes() for one in actions]
    assert len(pack_actions(short)) < 0.6 * len(pack_actions(exact)) + 500
