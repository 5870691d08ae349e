"""Generated cabinets: reproducible, free of interpenetration, and with handles that a hand can reach."""

import dataclasses
import itertools
import math
import subprocess
import sys
from functools import cache

import mujoco
import numpy as np
import pytest
import yaml

from artiskill.assets.articulated_object import ROOM_WALL, ArticulatedObject, CollisionShape, Handle
from artiskill.assets.cabinets import (
    CabinetConfig,
    CabinetSpec,
    build_cabinet,
    default_cabinet_config,
    sample_cabinet,
)
from artiskill.assets.cabinets.config import HANDLES
from artiskill.assets.cabinets.sample import collision_count, join_shelves
from artiskill.assets.cabinets.spec import Board, Cell, Rect
from artiskill.assets.kinematics import drawn_points
from artiskill.assets.similarity import describe, distance
from artiskill.config import dump_yaml, from_mapping, to_mapping
from artiskill.errors import AssetError, ConfigError
from artiskill.gallery.facts import object_facts
from artiskill.geometry.meshes import convex_hull, depth_inside, triangle_areas
from artiskill.geometry.rotations import quat_from_axis_angle, quat_rotate, transform_points

SEEDS = range(8)
MANY_SEEDS = range(100, 400)
WALL = to_mapping(default_cabinet_config().wall)


def make(seed: int, held_out: bool = False) -> tuple[CabinetSpec, ArticulatedObject]:
    form, detail = (np.random.default_rng((seed, k)) for k in range(2))
    spec = sample_cabinet(form, default_cabinet_config(), held_out)
    return spec, build_cabinet(spec, f"test-{seed}{'-ood' if held_out else ''}", detail)


@cache
def drawn(held_out: bool) -> list[CabinetSpec]:
    """What `make` builds of many seeds."""
    config = default_cabinet_config()
    return [sample_cabinet(np.random.default_rng((seed, 0)), config, held_out) for seed in MANY_SEEDS]


def seed_with(kind: str) -> tuple[int, bool]:
    """The first seed with a handle of a kind, and whether it is held out."""
    for held_out in (False, True):
        for seed, spec in zip(MANY_SEEDS, drawn(held_out), strict=True):
            if any(c.handle is not None and spec.handle_of(c).kind == kind for c in spec.cells):
                return seed, held_out
    raise AssertionError(f"no cabinet has a {kind}")


def wall_hung(held_out: bool = False) -> tuple[CabinetSpec, ArticulatedObject]:
    """The first that hangs on a wall."""
    found = zip(MANY_SEEDS, drawn(held_out), strict=True)
    return make(next(seed for seed, spec in found if spec.support.kind == "wall"), held_out)


@pytest.fixture(
    scope="module", params=[*SEEDS, *(f"held out {k}" for k in range(4)), *HANDLES, "wall", "held out wall"]
)
def cabinet(request: pytest.FixtureRequest) -> tuple[CabinetSpec, ArticulatedObject]:
    """Some of the first seeds, some held out, one with each kind of handle, some that hang on a wall."""
    if isinstance(request.param, int):
        return make(request.param)
    if request.param.endswith("wall"):
        return wall_hung(held_out=request.param.startswith("held out"))
    if request.param in HANDLES:
        return make(*seed_with(request.param))
    return make(int(request.param[-1]), held_out=True)


def compiled(obj: ArticulatedObject) -> "mujoco.MjModel":
    """All shapes of the object, every link colliding with every other."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.gravity = (0.0, 0.0, 0.0)
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    kinds = {"box": "BOX", "cylinder": "CYLINDER", "capsule": "CAPSULE", "sphere": "SPHERE", "hull": "MESH"}
    for link in obj.links:
        body = spec.worldbody.add_body(name=link.name, pos=link.position, quat=link.quaternion)
        if link.joint is not None:
            kind = {"prismatic": "mjJNT_SLIDE", "revolute": "mjJNT_HINGE"}[link.joint.kind]
            joint = body.add_joint(name=link.joint.name, type=getattr(mujoco.mjtJoint, kind), axis=link.joint.axis)
            joint.range, joint.limited = link.joint.limits, mujoco.mjtLimited.mjLIMITED_TRUE
        for shape in link.collisions:
            size = np.zeros(3)
            size[: len(shape.size)] = shape.size
            name = f"{link.name}-{len(body.geoms)}-{shape.part}"
            geom = body.add_geom(
                name=name,
                type=getattr(mujoco.mjtGeom, f"mjGEOM_{kinds[shape.kind]}"),
                size=size,
                pos=shape.position,
                quat=shape.quaternion,
                density=link.density_kg_m3,
            )
            if shape.vertices is not None:
                geom.meshname = spec.add_mesh(name=name, uservert=shape.vertices.ravel()).name
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


def test_springs_are_plain_numbers() -> None:
    """A NumPy number cannot be written as JSON."""
    joints = [joint for seed in range(12) for joint in make(seed, held_out=True)[1].joints if joint.stiffness > 0]
    assert joints, "top-hung flaps are held by springs"
    assert {type(value) for joint in joints for value in (joint.stiffness, joint.spring_reference)} == {float}


def test_nothing_overlaps_within_joint_limits(cabinet: tuple[CabinetSpec, ArticulatedObject]) -> None:
    assert overlaps(cabinet[1]) == []


@pytest.mark.slow
def test_nothing_overlaps_within_joint_limits_many() -> None:
    for seed in MANY_SEEDS:
        assert overlaps(make(seed)[1]) == []
        if seed % 3 == 0:
            assert overlaps(make(seed, held_out=True)[1]) == []


def test_the_sweep_notices_a_door_that_opens_into_its_neighbours() -> None:
    seed = next(k for k, spec in zip(MANY_SEEDS, drawn(False), strict=True) if inner_door(spec) is not None)
    spec, obj = make(seed)
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
        if g in base or model.body(model.geom_bodyid[g]).name == ROOM_WALL:
            continue
        nearest = min(mujoco.mj_geomDistance(model, data, g, b, 0.05, None) for b in base)
        assert nearest >= 0.002 - 1e-6, f"{model.geom(g).name} is {nearest:.5f} m from the carcass"


def test_links_joints_and_limits(cabinet: tuple[CabinetSpec, ArticulatedObject]) -> None:
    spec, obj = cabinet
    config = default_cabinet_config()
    moving = [f"link_{k}" for k in range(len(obj.joints))]
    wall = [ROOM_WALL] if spec.support.kind == "wall" else []
    assert [link.name for link in obj.links] == ["base", *moving, *wall]
    assert obj.links[0].joint is None
    assert spec.count("drawer") == len(obj.target_links("prismatic"))
    assert spec.count("door") == len(obj.target_links("revolute"))
    cells = [cell for cell in spec.cells if cell.kind in ("drawer", "door")]
    for link, cell in zip((obj.links[i] for i in obj.jointed_links), cells, strict=True):
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
            assert cell.hinge is not None
            levers = {"left": (0, -1, 0), "right": (0, 1, 0), "top": (0, 0, -1), "bottom": (0, 0, 1)}
            lever = np.array(levers[cell.hinge], dtype=float)
            assert quat_rotate(quat_from_axis_angle(joint.axis, 0.5), lever)[0] < 0


def test_masses_are_plausible(cabinet: tuple[CabinetSpec, ArticulatedObject]) -> None:
    obj, model = cabinet[1], compiled(cabinet[1])
    own = {obj.links[i].name: float(model.body(obj.links[i].name).mass[0]) for i in obj.own_links}
    assert 5 < own["base"] < 90
    assert all(0.4 < mass < 18 for name, mass in own.items() if name != "base")
    assert obj.metadata["mass_kg"] == pytest.approx(sum(own.values()), rel=0.01)


def test_budgets_of_shapes_and_triangles(cabinet: tuple[CabinetSpec, ArticulatedObject]) -> None:
    spec, obj = cabinet
    assert sum(len(link.collisions) for link in obj.links) == collision_count(spec) <= 72
    assert sum(len(v.mesh.faces) for link in obj.links for v in link.visuals) <= 15_000


def test_stands_on_the_ground_centred_and_within_its_bounds(
    cabinet: tuple[CabinetSpec, ArticulatedObject],
) -> None:
    spec, obj = cabinet
    own = [obj.links[i] for i in obj.own_links]
    points = np.concatenate([v.mesh.vertices + link.position for link in own for v in link.visuals])
    assert np.allclose(obj.bounds, (points.min(axis=0), points.max(axis=0)))
    below = spec.support.height_m if spec.support.kind == "wall" else 0.0
    assert obj.bounds[0, 2] == pytest.approx(below, abs=1e-9)
    assert obj.bounds[1, 2] == pytest.approx(spec.height_m + spec.top.upstand_m)
    assert obj.bounds[1, 0] == pytest.approx(spec.depth_m / 2)
    assert obj.bounds[0, 1] == pytest.approx(-obj.bounds[1, 1], abs=0.004)  # hinges stand out on one side
    for link in obj.links:
        vertices = np.concatenate([v.mesh.vertices for v in link.visuals])
        assert (link.surface_points >= vertices.min(axis=0) - 1e-9).all()
        assert (link.surface_points <= vertices.max(axis=0) + 1e-9).all()


@pytest.mark.parametrize("held_out", [False, True])
def test_what_does_not_stand_hangs_on_a_wall(held_out: bool) -> None:
    for spec in drawn(held_out):
        assert (spec.wall is not None) == (spec.support.kind == "wall")
    spec, obj = wall_hung(held_out)
    (wall,) = (link for link in obj.links if link.is_wall)
    assert wall.joint is None
    (shape,), (visual,) = wall.collisions, wall.visuals
    low, high = visual.mesh.bounds + wall.position
    for corner, sign in ((low, -1), (high, 1)):
        assert np.allclose(corner, wall.position + shape.position + sign * np.array(shape.size))
    assert low[0] == pytest.approx(obj.bounds[1, 0], abs=1e-12), "its face touches the cabinet's back"
    assert low[2] == 0.0, "it stands on the floor"
    beyond = np.array((obj.bounds[0, 1] - low[1], high[1] - obj.bounds[1, 1], high[2] - obj.bounds[1, 2]))
    assert (beyond > 0.7).all(), "it reaches far beyond the cabinet, to its left, its right and above"


def test_a_wall_changes_nothing_about_its_cabinet() -> None:
    """Walls came later than cabinets: all else of them is what it was."""
    spec, obj = wall_hung()
    bare = build_cabinet(dataclasses.replace(spec, wall=None), obj.id, np.random.default_rng((int(obj.id[5:]), 1)))
    assert obj.own_links == tuple(range(len(bare.links)))
    without = dataclasses.replace(obj, links=obj.links[:-1])
    assert without.content_hash == bare.content_hash != obj.content_hash
    assert np.array_equal(drawn_points(obj, obj.rest_qpos), drawn_points(bare, bare.rest_qpos))
    assert distance(describe(obj), describe(bare)) == distance(describe(bare), describe(bare))
    assert object_facts(obj).mass_kg == object_facts(bare).mass_kg


def test_fronts_that_swing_into_the_wall_are_noticed() -> None:
    """As they would if the wall stood before the cabinet's face; where it stands, none meets it."""
    _, obj = wall_hung()
    assert overlaps(obj) == []
    wall = obj.links[-1]
    before = dataclasses.replace(wall, position=np.array((obj.bounds[0, 0] - 0.2, 0.0, 0.0)))
    found = overlaps(dataclasses.replace(obj, links=(*obj.links[:-1], before)))
    assert any(ROOM_WALL in text and "link_0" in text for text in found)


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
        points = link.surface_points
        nearest = np.full(len(points), np.inf)
        for shape in link.collisions:
            local = quat_rotate(shape.quaternion * (1, -1, -1, -1), points - shape.position)
            nearest = np.minimum(nearest, outside(shape, local))
        assert np.percentile(nearest, 80) < 0.004
        assert np.percentile(nearest, 95) < 0.0095
        assert nearest.max() < 0.016  # runners, forks of casters and the bulge of mouldings are visual only


def outside(shape: CollisionShape, points: np.ndarray) -> np.ndarray:
    """Distance of points in a shape's frame from its solid; from below where a hull's corner is nearest."""
    if shape.kind == "hull":
        return np.maximum(-depth_inside(convex_hull(shape.vertices).planes, points), 0)
    if shape.kind == "box":
        return np.linalg.norm(np.maximum(np.abs(points) - shape.size, 0), axis=1)
    radius, half = shape.size if len(shape.size) == 2 else (shape.size[0], 0.0)
    along = np.maximum(np.abs(points[:, 2]) - half, 0)
    across = np.linalg.norm(points[:, :2], axis=1)
    if shape.kind == "cylinder":
        return np.hypot(np.maximum(across - radius, 0), along)
    return np.maximum(np.hypot(across, along) - radius, 0)


def test_handles_can_be_reached_and_gripped(cabinet: tuple[CabinetSpec, ArticulatedObject]) -> None:
    spec, obj = cabinet
    cells = [cell for cell in spec.cells if cell.kind in ("drawer", "door")]
    assert len(obj.handles) == len(cells)
    for handle, cell in zip(obj.handles, cells, strict=True):
        link, model = obj.links[obj.link_index(handle.link)], spec.handle_of(cell)
        assert handle.kind == model.kind
        assert 0.12 - 1e-9 <= handle.grasp_positions[0, 2] + link.position[2] <= 1.2 + 1e-9
        assert handle.grasp_width_m <= 0.062  # the gripper opens 80 mm
        tcp = handle.grasp_positions[0]
        assert depth_inside(handle.planes, tcp[None])[0] > -1e-6
        for position, quaternion in zip(handle.grasp_positions, handle.grasp_quaternions, strict=True):
            assert np.array_equal(position, tcp)
            assert np.allclose(quat_rotate(quaternion, np.array((0.0, 0.0, 1.0))), (1, 0, 0), atol=1e-6)
            # between the pads lies the handle, as wide as it says
            across = quat_rotate(quaternion, np.array((0.0, 1.0, 0.0)))
            depth = handle.points[:, 0] - tcp[0]
            along = np.abs((handle.points - tcp) @ np.cross(across, (1.0, 0.0, 0.0)))
            near = handle.points[(np.abs(depth) < 0.0085) & (along < 0.0085)]
            if len(near):
                assert np.abs((near - tcp) @ across).max() <= handle.grasp_width_m / 2 + 1e-6


def pad_corners(handle: Handle, pose: int) -> np.ndarray:
    """Corners of both open fingertips at a grasp pose, in the link's frame: 17 x 15 x 17 mm each. (16, 3)."""
    opening = min(0.04, handle.grasp_width_m / 2 + 0.01)
    corners = np.array(list(itertools.product((-0.0085, 0.0085), (opening, opening + 0.015), (-0.0085, 0.0085))))
    both = np.concatenate((corners, corners * (1, -1, 1)))
    return handle.grasp_positions[pose] + quat_rotate(handle.grasp_quaternions[pose], both)


def test_open_fingers_fit_around_handles(cabinet: tuple[CabinetSpec, ArticulatedObject]) -> None:
    """Neither the front behind nor any other collision shape is in the fingertips' way."""
    _, obj = cabinet
    for handle in obj.handles:
        own = obj.links[obj.link_index(handle.link)]
        for pose in range(len(handle.grasp_positions)):
            corners = pad_corners(handle, pose) + own.position
            for link in obj.links:
                for shape in link.collisions:
                    turned = shape.quaternion * (1, -1, -1, -1)
                    local = quat_rotate(turned, corners - link.position - shape.position)
                    assert outside(shape, local).min() > 0, (
                        f"{obj.id}: a finger at {handle.kind} meets {shape.part}"
                    )


def test_handles_grip_as_their_kind_asks() -> None:
    poses = {"bar": 2, "bow": 2, "knob": 8, "ring": 2, "lip": 2, "slot": 2, "cup": 2}
    for kind, count in poses.items():
        spec, obj = make(*seed_with(kind))
        handle = next(h for h in obj.handles if h.kind == kind)
        square = kind == "knob" and "square" in (spec.drawer_handle.shape, spec.door_handle.shape)
        assert len(handle.grasp_positions) == (4 if square else count)
        if kind in ("bar", "bow", "ring", "slot", "cup"):
            assert handle.hookable
        if kind == "ring":  # from its sides, across the whole ring
            assert np.allclose(np.abs(quat_rotate(handle.grasp_quaternions[0], np.array((0.0, 1, 0)))), (0, 1, 0))


def test_handles_keep_their_distance(cabinet: tuple[CabinetSpec, ArticulatedObject]) -> None:
    _, obj = cabinet
    boxes = []
    for handle in obj.handles:
        link = obj.links[obj.link_index(handle.link)]
        points = next(v.mesh.bounds for v in link.visuals if v.part == "handle") + link.position
        boxes.append(points[:, 1:])
    for (low, high), (other_low, other_high) in itertools.combinations(boxes, 2):
        assert np.maximum(low - other_high, other_low - high).max() >= 0.03


def test_drawers_are_hollow(cabinet: tuple[CabinetSpec, ArticulatedObject]) -> None:
    """No shape fills the middle of a drawer, and its box is open upwards."""
    spec, obj = cabinet
    drawers = [cell for cell in spec.cells if cell.kind in ("drawer", "door")]
    for link, cell in zip((obj.links[i] for i in obj.jointed_links), drawers, strict=True):
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


def test_a_shelf_behind_a_pair_of_doors_is_one_board() -> None:
    def half(y0: float, y1: float, z: float, part: str = "shelf") -> Board:
        return Board(Rect(y0, y1, z, z + 0.02), -0.2, 0.2, part)  # type: ignore[arg-type]

    halves = [half(0.0, 0.3, 0.5), half(0.0, 0.3, 0.8), half(-0.3, 0.0, 0.5), half(-0.3, 0.0, 0.9)]
    assert join_shelves(halves) == (half(-0.3, 0.3, 0.5), halves[1], halves[3])
    dividers = [half(0.0, 0.3, 0.5, "divider"), half(-0.3, 0.0, 0.5, "divider")]
    assert join_shelves(dividers) == tuple(dividers)


def test_hinges_reach_from_the_carcass_to_the_open_door() -> None:
    """What hides within a closed door bridges most of the gap that an open one leaves."""
    spec = next(
        s for s in drawn(held_out=False) if s.front.mount == "overlay" and s.count("door") and not s.front.bow_m
    )
    base, *moving = build_cabinet(spec, "test", np.random.default_rng(0)).links
    (arms,) = (v.mesh for v in base.visuals if v.part == "hinge")
    back = spec.face_x + spec.front.thickness_m
    assert spec.face_x < arms.bounds[0, 0] < back - 0.5 * spec.front.thickness_m
    assert arms.bounds[1, 0] > -spec.depth_m / 2, "they are fixed within the carcass"
    assert any(v.part == "hinge" for link in moving for v in link.visuals)


def test_no_plinth_is_of_brass() -> None:
    plinths = [s for s in drawn(held_out=False) if s.support.kind in ("plinth", "sides")]
    assert plinths
    assert all(s.appearance.support.name != "brass" for s in plinths)


def test_variety_over_many_seeds() -> None:
    config, specs = default_cabinet_config(), drawn(False)
    cells = [(s, c) for s in specs for c in s.cells]
    assert {s.family for s in specs} == {f.name for f in config.families if not f.held_out}
    assert {s.front.mount for s in specs} == {"overlay", "inset"}
    assert {s.support.kind for s in specs} == {"plinth", "sides", "legs", "casters", "floor", "wall"}
    assert {s.support.leg_shape for s in specs if s.support.kind == "legs"} == set(config.leg_shapes)
    assert {c.kind for _, c in cells} == {"drawer", "door", "open", "blind"}
    assert {c.face for _, c in cells} == {"slab", "shaker", "raised", "glazed", "louvred", "planks"}
    assert {c.hinge for _, c in cells if c.kind == "door"} == {"left", "right"}
    kinds = {s.handle_of(c).kind for s, c in cells if c.handle}
    assert kinds == {"bar", "bow", "knob", "ring", "lip", "slot"}
    assert {c.handle.vertical for _, c in cells if c.handle and c.kind == "door"} == {True, False}
    assert {s.count("drawer") for s in specs} >= {0, 1, 2, 3, 4, 5}
    assert {s.top.steps for s in specs} == {1, 2, 3}


def test_held_out_cabinets_are_of_other_families() -> None:
    config, specs = default_cabinet_config(), drawn(True)
    assert {s.family for s in specs} == {f.name for f in config.families if f.held_out}
    assert all(s.held_out for s in specs)
    assert not any(s.held_out for s in drawn(False))
    for spec in specs:
        new = {spec.handle_of(c).kind for c in spec.cells if c.handle} & {"cup"}
        flaps = any(c.hinge in ("top", "bottom") for c in spec.cells)
        assert new or flaps or spec.front.bow_m > 0 or spec.family in ("flap_cabinet", "cup_chest")
    for spec in drawn(False):
        assert spec.front.bow_m == 0
        assert all(c.hinge in (None, "left", "right") for c in spec.cells)


def test_metadata_holds_plain_facts(cabinet: tuple[CabinetSpec, ArticulatedObject]) -> None:
    spec, obj = cabinet
    facts = obj.metadata
    assert (facts["family"], facts["held_out"]) == (spec.family, spec.held_out)
    assert facts["joints"] == len(obj.jointed_links)
    assert facts["handles"] == sorted({h.kind for h in obj.handles})
    assert set(facts["handles"]) <= set(facts["tags"])
    for value in facts.values():
        plain = isinstance(value, str | int | float | bool)
        assert plain or (isinstance(value, list) and all(isinstance(v, str) for v in value))


def test_points_move_with_doors_as_documented() -> None:
    """A door's frame lies on its hinge axis: its own points turn about it."""
    seed = next(k for k, spec in zip(MANY_SEEDS, drawn(False), strict=True) if spec.count("door") > 0)
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
    handle = dataclasses.replace(config.handle, height_m=(5.0, 6.0), slot_lowest_m=5.0)
    with pytest.raises(AssetError, match="no legal cabinet in 500 draws"):
        sample_cabinet(np.random.default_rng(0), dataclasses.replace(config, handle=handle))


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("gap_m", [0.001, 0.002], "gap_m must be at least 0.002"),
        ("panel_m", [0.02, 0.01], "panel_m must be two numbers above 0"),
        ("travel_fraction", [0.6, 1.2], "travel_fraction must stay within 1"),
        ("strips", {"drawer": 1.0}, "unknown name 'drawer'"),
        ("held_out", ["cup", "mugs"], "unknown name 'mugs'"),
        ("held_out", ["knob"], "'night_stand' is not held out but has knob"),
        ("colour", "red", "unknown key 'colour'"),
        ("wall", {**WALL, "paints": ["plaid"]}, "unknown name 'plaid'; legal: white, cream"),
        ("wall", {**WALL, "paints": []}, "wall: paints must name at least one paint"),
        ("wall", {**WALL, "height_m": 0.0}, "height_m must be"),
    ],
)
def test_bad_config_values_are_named(key: str, value: object, message: str) -> None:
    data = {**to_mapping(default_cabinet_config()), key: value}
    with pytest.raises(ConfigError, match=message):
        from_mapping(CabinetConfig, data)
