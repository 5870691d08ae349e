"""Generated cabinets: reproducible, free of interpenetration, and with handles that a hand can reach."""

import dataclasses
import math
import subprocess
import sys

import mujoco
import numpy as np
import pytest
import yaml

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.cabinets import (
    CabinetConfig,
    CabinetSpec,
    build_cabinet,
    default_cabinet_config,
    sample_cabinet,
)
from artiskill.assets.cabinets.spec import Cell
from artiskill.config import dump_yaml, from_mapping, to_mapping
from artiskill.errors import AssetError, ConfigError
from artiskill.geometry.hulls import depth_inside
from artiskill.geometry.meshes import triangle_areas
from artiskill.geometry.rotations import quat_from_axis_angle, quat_rotate, transform_points

SEEDS = range(12)
MANY_SEEDS = range(100, 400)


def make(seed: int) -> tuple[CabinetSpec, ArticulatedObject]:
    form, detail = (np.random.default_rng((seed, k)) for k in range(2))
    spec = sample_cabinet(form, default_cabinet_config())
    return spec, build_cabinet(spec, f"test-{seed}", detail)


@pytest.fixture(scope="module", params=SEEDS)
def cabinet(request: pytest.FixtureRequest) -> tuple[CabinetSpec, ArticulatedObject]:
    return make(request.param)


def compiled(obj: ArticulatedObject) -> "mujoco.MjModel":
    """All shapes of the object, every link colliding with every other."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.gravity = (0.0, 0.0, 0.0)
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    kinds = {"box": "mjGEOM_BOX", "cylinder": "mjGEOM_CYLINDER", "capsule": "mjGEOM_CAPSULE"}
    for link in obj.links:
        body = spec.worldbody.add_body(name=link.name, pos=link.position, quat=link.quaternion)
        if link.joint is not None:
            kind = {"prismatic": "mjJNT_SLIDE", "revolute": "mjJNT_HINGE"}[link.joint.kind]
            joint = body.add_joint(name=link.joint.name, type=getattr(mujoco.mjtJoint, kind), axis=link.joint.axis)
            joint.range, joint.limited = link.joint.limits, mujoco.mjtLimited.mjLIMITED_TRUE
        for shape in link.collisions:
            size = np.zeros(3)
            size[: len(shape.size)] = shape.size
            body.add_geom(
                name=f"{link.name}-{len(body.geoms)}-{shape.part}",
                type=getattr(mujoco.mjtGeom, kinds[shape.kind]),
                size=size,
                pos=shape.position,
                quat=shape.quaternion,
                density=link.density_kg_m3,
            )
    return spec.compile()


def joint_values(model: "mujoco.MjModel", rng: np.random.Generator) -> np.ndarray:
    """Each joint alone over its range, all together, and random combinations. (N, nq)."""
    ends = model.jnt_range[:, 1]
    steps = np.linspace(0.0, 1.0, 15)[:, None]
    alone = [steps * np.eye(model.nq)[k] for k in range(model.nq)]
    fractions = np.concatenate((*alone, np.repeat(steps, model.nq, axis=1), rng.random((20, model.nq))))
    return fractions * ends


def overlaps(obj: ArticulatedObject) -> list[str]:
    """What overlaps what, at any of the joint values."""
    model = compiled(obj)
    data = mujoco.MjData(model)
    found = []
    for values in joint_values(model, np.random.default_rng(0)):
        data.qpos[:] = values
        mujoco.mj_forward(model, data)
        for contact in data.contact:
            names = [model.geom(g).name for g in (contact.geom1, contact.geom2)]
            if contact.dist < -1e-6:
                found.append(f"{obj.id}: {names} by {-contact.dist:.5f} m at {values.round(3)}")
    return found


def test_same_seed_same_object_and_other_seed_another() -> None:
    assert make(5)[1].content_hash == make(5)[1].content_hash
    assert len({make(seed)[1].content_hash for seed in SEEDS}) == len(SEEDS)


def test_content_hash_is_the_same_in_another_process() -> None:
    code = "from artiskill.assets.catalog import load_object as f; print(f('generated:7').content_hash)"
    hashes = {
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()
        for _ in range(2)
    }
    assert len(hashes) == 1
    assert len(hashes.pop()) == 16


def test_nothing_overlaps_within_joint_limits(cabinet: tuple[CabinetSpec, ArticulatedObject]) -> None:
    assert overlaps(cabinet[1]) == []


@pytest.mark.slow
def test_nothing_overlaps_within_joint_limits_many() -> None:
    for seed in MANY_SEEDS:
        assert overlaps(make(seed)[1]) == []


def test_the_sweep_notices_a_door_that_opens_into_its_neighbours() -> None:
    spec, obj = next(c for c in map(make, MANY_SEEDS) if inner_door(c[0]) is not None)
    assert overlaps(obj) == []
    door = inner_door(spec)
    cells = tuple(dataclasses.replace(cell, limit=2.5) if cell is door else cell for cell in spec.cells)
    wide = build_cabinet(dataclasses.replace(spec, cells=cells), "wide", np.random.default_rng(0))
    assert overlaps(wide) != []


def inner_door(spec: CabinetSpec) -> Cell | None:
    """A door hinged beside a drawer that stands on its level."""
    for door in spec.cells:
        for drawer in spec.cells:
            if door.kind == "door" and drawer.kind == "drawer":
                level = door.clear.z0 < drawer.clear.z1 and drawer.clear.z0 < door.clear.z1
                gap = drawer.clear.y0 - door.clear.y1 if door.hinge == "left" else door.clear.y0 - drawer.clear.y1
                if level and 0 < gap < 0.03:
                    return door
    return None


def test_closed_drawers_and_doors_leave_two_millimetres(cabinet: tuple[CabinetSpec, ArticulatedObject]) -> None:
    model = compiled(cabinet[1])
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    base = [g for g in range(model.ngeom) if model.body(model.geom_bodyid[g]).name == "base"]
    for g in range(model.ngeom):
        if g in base:
            continue
        nearest = min(mujoco.mj_geomDistance(model, data, g, b, 0.05, None) for b in base)
        assert nearest >= 0.002 - 1e-6, f"{model.geom(g).name} is {nearest:.5f} m from the carcass"


def test_links_joints_and_limits(cabinet: tuple[CabinetSpec, ArticulatedObject]) -> None:
    spec, obj = cabinet
    config = default_cabinet_config()
    assert [link.name for link in obj.links] == ["base"] + [f"link_{k}" for k in range(len(obj.links) - 1)]
    assert obj.links[0].joint is None
    assert spec.count("drawer") == len(obj.target_links("prismatic"))
    assert spec.count("door") == len(obj.target_links("revolute"))
    cells = [cell for cell in spec.cells if cell.kind in ("drawer", "door")]
    for link, cell in zip(obj.links[1:], cells, strict=True):
        joint = link.joint
        assert joint is not None
        assert joint.limits[0] == 0.0
        if cell.kind == "drawer":
            assert np.array_equal(joint.axis, (-1, 0, 0))
            assert config.travel_m[0] <= joint.limits[1] <= config.travel_m[1]
            assert 0.6 - 1e-9 <= joint.limits[1] / cell.box_length_m <= 1.0
        else:
            assert 75 <= math.degrees(joint.limits[1]) + 0.01 <= 170.02
            # the free edge swings out towards -x
            lever = np.array((0.0, -1.0 if cell.hinge == "left" else 1.0, 0.0))
            assert quat_rotate(quat_from_axis_angle(joint.axis, 0.5), lever)[0] < 0


def test_masses_are_plausible(cabinet: tuple[CabinetSpec, ArticulatedObject]) -> None:
    model = compiled(cabinet[1])
    assert 5 < model.body("base").mass[0] < 90
    for link in cabinet[1].links[1:]:
        assert 0.5 < model.body(link.name).mass[0] < 15


def test_budgets_of_shapes_and_triangles(cabinet: tuple[CabinetSpec, ArticulatedObject]) -> None:
    spec, obj = cabinet
    assert sum(len(link.collisions) for link in obj.links) == spec.collision_count <= 60
    assert sum(len(v.mesh.faces) for link in obj.links for v in link.visuals) <= 10_000


def test_stands_on_the_ground_centred_and_within_its_bounds(
    cabinet: tuple[CabinetSpec, ArticulatedObject],
) -> None:
    spec, obj = cabinet
    points = np.concatenate([v.mesh.vertices + link.position for link in obj.links for v in link.visuals])
    assert np.allclose(obj.bounds, (points.min(axis=0), points.max(axis=0)))
    assert obj.bounds[0, 2] == pytest.approx(0.0, abs=1e-9)
    assert obj.bounds[1, 2] == pytest.approx(spec.height_m)
    assert obj.bounds[1, 0] == pytest.approx(spec.depth_m / 2)
    assert obj.bounds[0, 1] == pytest.approx(-obj.bounds[1, 1])
    for link in obj.links:
        own = np.concatenate([v.mesh.vertices for v in link.visuals])
        assert (link.surface_points >= own.min(axis=0) - 1e-9).all()
        assert (link.surface_points <= own.max(axis=0) + 1e-9).all()


def test_meshes_are_sound(cabinet: tuple[CabinetSpec, ArticulatedObject]) -> None:
    for link in cabinet[1].links:
        for visual in link.visuals:
            mesh = visual.mesh
            corners = mesh.vertices[mesh.faces]
            volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
            assert volume > 0, f"{link.name}: faces of {visual.part} look inwards"
            assert (triangle_areas(mesh) > 0).all()
            if mesh.uvs is not None:
                assert 0 <= mesh.uvs.min() <= mesh.uvs.max() <= 1 + 1e-6


def test_collision_shapes_hug_what_is_drawn(cabinet: tuple[CabinetSpec, ArticulatedObject]) -> None:
    for link in cabinet[1].links:
        drawn = link.surface_points
        nearest = np.full(len(drawn), np.inf)
        for shape in link.collisions:
            local = quat_rotate(shape.quaternion * (1, -1, -1, -1), drawn - shape.position)
            if shape.kind == "box":
                outside = np.linalg.norm(np.maximum(np.abs(local) - shape.size, 0), axis=1)
            else:
                radius, half = shape.size
                along = np.maximum(np.abs(local[:, 2]) - half, 0)
                across = np.linalg.norm(local[:, :2], axis=1)
                outside = np.maximum(np.hypot(across, along) - radius, 0)
            nearest = np.minimum(nearest, outside)
        assert np.percentile(nearest, 90) < 0.004
        assert nearest.max() < 0.012  # a drawer's runners are drawn, not touched


def test_handles_can_be_reached_gripped_and_hooked(cabinet: tuple[CabinetSpec, ArticulatedObject]) -> None:
    spec, obj = cabinet
    cells = [cell for cell in spec.cells if cell.kind in ("drawer", "door")]
    assert len(obj.handles) == len(cells)
    for handle, cell in zip(obj.handles, cells, strict=True):
        link = obj.links[obj.link_index(handle.link)]
        assert cell.handle is not None
        assert handle.hookable
        assert spec.handle.projection_m - spec.handle.diameter_m >= 0.025 - 1e-9
        points = handle.points + link.position
        assert points[:, 0].max() <= spec.face_x + spec.front.recess_m + 1e-9
        assert points[:, 0].min() == pytest.approx(spec.face_x - spec.handle.projection_m, abs=0.002)
        assert handle.grasp_width_m == pytest.approx(spec.handle.diameter_m, abs=2e-4)
        assert handle.grasp_width_m < 0.06  # the gripper opens 80 mm
        tcp = handle.grasp_positions[0] + link.position
        assert 0.12 <= tcp[2] <= 1.2
        # on the bar: no farther from its axis than its own radius
        axis = np.array(
            (spec.face_x - spec.handle.projection_m + spec.handle.diameter_m / 2, *(cell.handle.y, cell.handle.z))
        )
        assert np.linalg.norm(tcp - axis) <= spec.handle.diameter_m / 2 + 1e-6
        across = (0, 1, 0) if cell.handle.vertical else (0, 0, 1)
        for quaternion in handle.grasp_quaternions:
            assert np.allclose(quat_rotate(quaternion, np.array((0.0, 0.0, 1.0))), (1, 0, 0), atol=1e-6)
            assert np.allclose(np.abs(quat_rotate(quaternion, np.array((0.0, 1.0, 0.0)))), across, atol=1e-6)
        assert depth_inside(handle.planes, handle.grasp_positions[:1])[0] > -1e-6


def test_handles_keep_their_distance(cabinet: tuple[CabinetSpec, ArticulatedObject]) -> None:
    spec, _ = cabinet
    places = [cell.handle for cell in spec.cells if cell.handle is not None]
    for place in places:
        for other in places:
            if other is place:
                continue
            reach = other.centres_m / 2 + spec.handle.overhang_m
            dy, dz = abs(place.y - other.y), abs(place.z - other.z)
            across, along = (dy, dz) if place.vertical else (dz, dy)
            free_across = across - (0.0 if other.vertical == place.vertical else reach)
            free_along = along - (reach if other.vertical == place.vertical else 0.0)
            assert free_across >= 0.08 or free_along >= 0.03, f"{place} is too near to {other}"


def test_drawers_are_hollow(cabinet: tuple[CabinetSpec, ArticulatedObject]) -> None:
    """No shape fills the middle of a drawer, and its box is open upwards."""
    spec, obj = cabinet
    drawers = [cell for cell in spec.cells if cell.kind in ("drawer", "door")]
    for link, cell in zip(obj.links[1:], drawers, strict=True):
        if cell.kind != "drawer":
            continue
        y, _ = cell.clear.centre
        middle = np.array((spec.face_x + spec.front.thickness_m + cell.box_length_m / 2, y, cell.clear.z0 + 0.04))
        for shape in link.collisions:
            gap = np.abs(middle - link.position - shape.position)
            if shape.kind == "box":
                assert (gap > np.array(shape.size)).any(), f"{shape.part} fills the drawer"
        assert {v.part for v in link.visuals} >= {
            "drawer_front",
            "drawer_side",
            "drawer_back",
            "drawer_bottom",
            "handle",
        }


def test_variety_over_many_seeds() -> None:
    config = default_cabinet_config()
    specs = [sample_cabinet(np.random.default_rng(seed), config) for seed in MANY_SEEDS]
    assert {s.family for s in specs} == {f.name for f in config.families}
    assert {s.front.mount for s in specs} == {"overlay", "inset"}
    assert {s.support.kind for s in specs} == {"plinth", "legs", "floor"}
    assert {c.kind for s in specs for c in s.cells} == {"drawer", "door", "open", "blind"}
    assert {c.hinge for s in specs for c in s.cells if c.kind == "door"} == {"left", "right"}
    assert {s.handle.section for s in specs} == {"round", "square"}
    assert {c.handle.vertical for s in specs for c in s.cells if c.handle and c.kind == "door"} == {True, False}
    assert any(s.front.frame_m > 0 for s in specs)
    assert {s.count("drawer") for s in specs} >= {0, 1, 2, 3, 4, 5}


def test_points_move_with_doors_as_documented() -> None:
    """A door's frame lies on its hinge axis: its own points turn about it."""
    seed = next(s for s in range(100) if make(s)[0].count("door") > 0)
    obj = make(seed)[1]
    name = obj.target_links("revolute")[0]
    link = obj.links[obj.link_index(name)]
    assert link.joint is not None
    assert np.array_equal(link.joint.origin, np.zeros(3))
    handle = obj.handles_of(name)[0]
    opened = transform_points(
        link.position, quat_from_axis_angle(link.joint.axis, link.joint.limits[1]), handle.points
    )
    assert opened[:, 0].min() < obj.bounds[0, 0] - 0.05


def test_spec_survives_yaml(cabinet: tuple[CabinetSpec, ArticulatedObject]) -> None:
    spec = cabinet[0]
    assert from_mapping(CabinetSpec, yaml.safe_load(dump_yaml(spec))) == spec


def test_impossible_config_is_an_error() -> None:
    config = default_cabinet_config()
    handle = dataclasses.replace(config.handle, height_m=(5.0, 6.0))
    with pytest.raises(AssetError, match="no legal cabinet in 500 draws"):
        sample_cabinet(np.random.default_rng(0), dataclasses.replace(config, handle=handle))


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("gap_m", [0.001, 0.002], "gap_m must be at least 0.002"),
        ("panel_m", [0.02, 0.01], "panel_m must be two numbers above 0"),
        ("travel_fraction", [0.6, 1.2], "travel_fraction must stay within 1"),
        ("stack_tops", {"drawer": 1.0}, "unknown name 'drawer'"),
        ("colour", "red", "unknown key 'colour'"),
    ],
)
def test_bad_config_values_are_named(key: str, value: object, message: str) -> None:
    data = {**to_mapping(default_cabinet_config()), key: value}
    with pytest.raises(ConfigError, match=message):
        from_mapping(CabinetConfig, data)
