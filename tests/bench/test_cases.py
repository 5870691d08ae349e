import pytest

from artiskill.bench.cases import Case, make_cases
from artiskill.errors import ArtiSkillError
from artiskill.jobs.parallel import available_cores
from artiskill.sensors.observations.sampling import make_sampler
from artiskill.tasks.registry import task_names

DRAWER = "OpenCabinetDrawer"


def test_combinations_without_repetition() -> None:
    cases = make_cases([DRAWER], ["state", "pointcloud"], [1, 4], [1, 2, 8], ["test"], points=120)
    assert [(c.mode, c.num_envs, c.num_threads) for c in cases] == [
        ("state", 1, 1),
        ("state", 4, 1),
        ("state", 4, 2),
        ("state", 4, 4),
        ("pointcloud 120", 1, 1),
        ("pointcloud 120", 4, 1),
        ("pointcloud 120", 4, 2),
        ("pointcloud 120", 4, 4),
    ]


def test_all_tasks_and_cores() -> None:
    cases = make_cases(["all"], ["state"], [1024], None, ["train"])
    assert tuple(case.task for case in cases) == task_names()
    assert {case.num_threads for case in cases} == {min(available_cores(), 1024)}


@pytest.mark.parametrize("points", [1, 7, 100, 1200, 5000])
def test_any_number_of_points_can_be_sampled(points: int) -> None:
    case = Case(DRAWER, "pointcloud", 1, 1, ("test",), points)
    assert make_sampler("maniskill", points, case.sampling).num_points == points


def test_points_are_shared_as_in_the_baselines() -> None:
    case = Case(DRAWER, "pointcloud", 1, 1, ("test",), 1200)
    assert case.sampling == {"masked_points": 800, "points_per_mask": 50}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"tasks": ["OpenCabinetDrwer"]}, "did you mean 'OpenCabinetDrawer'"),
        ({"obs_modes": ["pointclod"]}, "did you mean 'pointcloud'"),
        ({"num_envs": [0]}, "num_envs must be at least 1, not 0"),
        ({"threads": [0]}, "threads must be at least 1, not 0"),
        ({"objects": ["tset"]}, "did you mean 'test'"),
        ({"seconds": 0.0}, "seconds must be positive, not 0"),
        ({"obs_modes": ["pointcloud"], "points": 0}, "points must be at least 1, not 0"),
    ],
)
def test_errors(change: dict[str, object], says: str) -> None:
    given: dict[str, object] = {
        "tasks": [DRAWER],
        "obs_modes": ["state"],
        "num_envs": [2],
        "threads": None,
        "objects": ["test"],
    }
    with pytest.raises(ArtiSkillError, match=says):
        make_cases(**given | change)  # type: ignore[arg-type]
