import json
import sys
from pathlib import Path

import numpy as np
import pytest

from artiskill.bench import report as report_module
from artiskill.bench.cases import Case
from artiskill.bench.measure import (
    EngineBaseline,
    Measurement,
    SingleBenchEnv,
    VectorBenchEnv,
    make_bench_env,
    measure_case,
)
from artiskill.bench.report import BenchReport, Line, draw, machine_facts, resident_mb, write_bench
from artiskill.errors import ConfigError, MissingExtraError
from artiskill.tasks.registry import task_names


def measurement(task: str = "PushChair", num_envs: int = 2, threads: int = 1, obs: str = "state") -> Measurement:
    case = Case(task, obs, num_envs, threads, ("train",))
    return Measurement(case, 100, 900.0, 1000.0, 0.9, (0.85, 0.95), 2.0, 890.0, 22500.0, 250.0)


@pytest.mark.parametrize("num_envs", [1, 3])
def test_a_measurement_hangs_together(num_envs: int) -> None:
    case = Case("OpenCabinetDrawer", "state", num_envs, 1, ("cabinet-0003",), seconds=0.01)
    found = measure_case(case)
    assert found.steps % num_envs == 0
    assert found.steps >= num_envs
    assert found.physics_steps_per_s == pytest.approx(25 * found.steps_per_s)
    assert 0 < found.ratio_quartiles[0] <= found.ratio <= found.ratio_quartiles[1]
    assert 0 < found.steps_with_resets_per_s < found.steps_per_s
    assert found.engine_steps_per_s > 0
    assert found.reset_ms > 0
    values = found.to_mapping()
    assert (values["task"], values["num_envs"], values["ratio"]) == ("OpenCabinetDrawer", num_envs, found.ratio)
    json.dumps(values)


def test_machine() -> None:
    facts = machine_facts()
    assert facts["cores"] >= 1
    assert facts["versions"]["mujoco-core"]
    json.dumps(facts)


def test_memory_that_is_used_is_counted() -> None:
    before = resident_mb()
    if before is None:
        pytest.skip("this system does not say")
    block = bytearray(b"x") * 100_000_000
    after = resident_mb()
    assert after is not None
    assert after - before > 90
    assert len(block) == 100_000_000


def test_files(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    report = BenchReport(machine_facts(), [measurement(), measurement(num_envs=1)])
    paths = write_bench(report, tmp_path / "some" / "where")
    assert [path.name for path in paths] == ["bench.json", "bench.png"]
    data = json.loads(paths[0].read_text())
    assert [case["num_envs"] for case in data["cases"]] == [2, 1]
    assert data["machine"]["cores"] == report.machine["cores"]
    assert paths[1].read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in paths[0].parent.iterdir()) == ["bench.json", "bench.png"]


def test_a_folder_that_cannot_be(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="cannot write to"):
        write_bench(BenchReport({}, []), tmp_path / "file", plot=False)


def test_lines_have_the_single_environment_in_common() -> None:
    line = Line("state", 2)
    assert line.has(measurement(num_envs=1, threads=1))
    assert line.has(measurement(num_envs=16, threads=2))
    assert not line.has(measurement(num_envs=16, threads=1))
    assert not line.has(measurement(num_envs=16, threads=2, obs="rgbd"))


def test_plots_with_gaps(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    cases = [
        measurement("OpenCabinetDoor", 16, 2),
        measurement("PushChair", 1, 1, "rgbd"),
        measurement("PushChair", 64, 4),
    ]
    draw(cases, tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 5000


def test_the_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(MissingExtraError, match=r"artiskill\[bench\]"):
        report_module.figure_class()


LEVELS = np.array([11, 4, 23, 7])


def final_states(subject: SingleBenchEnv | VectorBenchEnv, num_envs: int) -> list[np.ndarray]:
    env = subject._env.unwrapped
    if num_envs == 1:
        return [env.save_state().simulation.rows[0]]
    return [env.save_state(i).simulation.rows[0] for i in range(num_envs)]


@pytest.mark.parametrize("task", task_names())
@pytest.mark.parametrize("num_envs", [1, 4])
def test_the_ceiling_does_the_same_physics(task: str, num_envs: int) -> None:
    case = Case(task, "state", num_envs, min(2, num_envs), ("train",))
    subject, levels = make_bench_env(case), LEVELS[:num_envs]
    baseline = EngineBaseline(subject.task, case.objects, case.num_threads)
    subject.start(levels)
    baseline.start(levels)
    rng = np.random.default_rng(0)
    for _ in range(4):
        actions = rng.uniform(-1, 1, (num_envs, subject.action_size)).astype(np.float32)
        assert subject.step(actions) is False
        baseline.step(baseline.targets(actions))
    states = baseline.states()
    for env, row in enumerate(final_states(subject, num_envs)):
        np.testing.assert_array_equal(states[env], row)


def test_chairs_of_several_layouts_are_all_stepped() -> None:
    case = Case("PushChair", "state", 12, 1, ("train",))
    subject = make_bench_env(case)
    baseline = EngineBaseline(subject.task, case.objects, 1)
    baseline.start(np.arange(12))
    assert len(baseline._groups) > 1
    assert sorted(baseline.states()) == list(range(12))


def test_restarts_begin_the_levels_they_are_given() -> None:
    subject = VectorBenchEnv(Case("OpenCabinetDrawer", "state", 3, 1, ("test",)))
    subject.start(LEVELS[:3])
    subject.restart(np.array([0, 2]), np.array([100, 101]))
    assert subject._env.get_attr("level") == (100, 4, 101)


@pytest.mark.parametrize("num_envs", [1, 2])
def test_points_are_down_sampled(num_envs: int) -> None:
    subject = make_bench_env(Case("OpenCabinetDrawer", "pointcloud", num_envs, 1, ("cabinet-0003",), 100))
    space = subject._env.observation_space  # type: ignore[attr-defined]
    assert space["pointcloud"]["xyz"].shape == ((100, 3) if num_envs == 1 else (num_envs, 100, 3))
    subject.start(np.arange(num_envs))
    assert subject.step(np.zeros((num_envs, subject.action_size), np.float32)) is False
