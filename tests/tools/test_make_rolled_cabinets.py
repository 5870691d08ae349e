"""`make_rolled_cabinets.py`: cabinets on their side, whose doors open as flaps do."""

from pathlib import Path

import numpy as np
import pytest
from tests.tools.conftest import LoadTool

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import load_object, resolve_objects
from artiskill.assets.kinematics import link_poses
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.experts.registry import make_expert
from artiskill.geometry.rotations import quat_rotate, quat_to_matrix

SEEDS = "3000003..3000009"  # five of these have doors


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("rolled")


@pytest.fixture
def rolled(load_tool: LoadTool, folder: Path) -> tuple[ArticulatedObject, ...]:
    tool = load_tool("make_rolled_cabinets")
    if not (folder / tool.LIST).exists():
        assert tool.main(["--seeds", SEEDS, "--out", str(folder)]) == 0
    return resolve_objects([str(folder / tool.LIST)], task="OpenCabinetDoor")  # type: ignore[return-value]


def test_they_lie_on_both_sides_within_reach(rolled: tuple[ArticulatedObject, ...]) -> None:
    assert [one.id.removeprefix("rolled-cabinet-") for one in rolled] == [
        "3000003-left",
        "3000004-right",
        "3000005-left",
        "3000008-right",
        "3000009-left",
    ]
    for one in rolled:
        base, turn = one.links[0].position, quat_to_matrix(one.links[0].quaternion)
        corners = [v.mesh.vertices for v in one.links[0].visuals]
        drawn = np.concatenate(corners) @ turn.T + base
        assert (drawn >= one.bounds[0] - 1e-9).all()
        assert (drawn <= one.bounds[1] + 1e-9).all()
        assert one.bounds[0, 2] >= -1e-12, "not below the floor"
        heights = []
        for link in one.links[1:]:
            assert not link.is_wall
            if link.joint is not None and link.joint.kind == "revolute":
                assert abs((turn @ link.joint.axis)[2]) < 1e-12, "hinges lie level"
                assert np.deg2rad(60) < link.joint.limits[1] <= np.deg2rad(95)
                handles = [handle.points.mean(axis=0) for handle in one.handles_of(link.name)]
                heights += [(turn @ (link.position + handle) + base)[2] for handle in handles]
        assert 0.45 <= np.mean(heights) <= 1.5


def test_left_and_right(rolled: tuple[ArticulatedObject, ...]) -> None:
    """Of a cabinet that lies on its own left side, whoever stands before it finds the top at the right: -y."""
    for one, side in ((rolled[0], 1.0), (rolled[1], -1.0)):
        up = quat_to_matrix(one.links[0].quaternion) @ (0.0, 0.0, 1.0)
        np.testing.assert_allclose(up, (0.0, -side, 0.0), atol=1e-12)


def test_the_same_seeds_make_the_same_cabinets(rolled: tuple[ArticulatedObject, ...], load_tool: LoadTool) -> None:
    again = load_tool("make_rolled_cabinets").roll(load_object("generated:cabinet:3000003"), "left")
    assert again.content_hash == rolled[0].content_hash


def test_the_expert_opens_one(rolled: tuple[ArticulatedObject, ...]) -> None:
    env = ManipulationEnv("OpenCabinetDoor", objects=rolled[0])
    expert = make_expert("OpenCabinetDoor", env.task.robot)
    env.reset(options={"level": 5})
    for _ in range(200):
        _, _, solved, over, _ = env.step(expert.act(env.snapshot, env.goal))
        if solved or over:
            break
    assert solved


def test_both_sides(load_tool: LoadTool, tmp_path: Path) -> None:
    tool = load_tool("make_rolled_cabinets")
    for _ in range(2):  # the second time, over what is there
        assert tool.main(["--seeds", "3000003..3000004", "--both", "--out", str(tmp_path)]) == 0
    found = [one.id.removeprefix("rolled-cabinet-") for one in resolve_objects([str(tmp_path / tool.LIST)])]  # type: ignore[union-attr]
    assert found == ["3000003-left", "3000003-right", "3000004-left", "3000004-right"]


def test_cabinets_with_drawers(load_tool: LoadTool) -> None:
    found = list(load_tool("make_rolled_cabinets").rolled_cabinets("9000000..9000004", task="OpenCabinetDrawer"))
    names = [f"rolled-cabinet-{name}" for name in ("9000001-left", "9000002-right", "9000004-left")]
    assert [one.id for one in found] == names
    for one in found:
        _, quaternions = link_poses(one, one.rest_qpos)
        drawers = [k for k, link in enumerate(one.links) if link.joint and link.joint.kind == "prismatic"]
        assert drawers
        for k in drawers:  # forward, as those of a cabinet that stands
            np.testing.assert_allclose(quat_rotate(quaternions[k], one.links[k].joint.axis), (-1, 0, 0), atol=1e-9)


def test_illegal_seeds(load_tool: LoadTool, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert load_tool("make_rolled_cabinets").main(["--seeds", "5..3", "--out", str(tmp_path)]) == 2
    assert "comes before" in capsys.readouterr().err
