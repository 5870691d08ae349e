"""Generated buckets: reproducible, standing, tight for a ball, with a bail that swings free and can be gripped."""

import dataclasses
import math
from typing import Any

import mujoco
import numpy as np
import pytest
import yaml
from scipy.spatial import cKDTree

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape
from artiskill.assets.buckets import (
    GENERATOR,
    BucketConfig,
    BucketSpec,
    build_bucket,
    default_bucket_config,
    sample_bucket,
)
from artiskill.assets.buckets.shape import coarse_outline, outline, outline_scale
from artiskill.assets.buckets.spec import Section
from artiskill.config import dump_yaml, from_mapping, to_mapping
from artiskill.errors import AssetError, ConfigError
from artiskill.geometry.meshes import TriMesh, convex_hull, depth_inside, sample_surface, triangle_areas
from artiskill.geometry.normals import is_closed
from artiskill.geometry.primitives import box, capsule, cylinder
from artiskill.geometry.rotations import quat_from_axis_angle, quat_multiply, quat_rotate
from artiskill.scene.object_model import add_object
from artiskill.scene.physics import (
    ContactConfig,
    Group,
    PhysicsConfig,
    set_contact,
    set_joint_limits_solver,
    set_options,
)

SEEDS = [(seed, False) for seed in range(7)] + [(seed, True) for seed in range(5)]
MANY_SEEDS = range(100, 200)
BALL_M = 0.05
PHYSICS = PhysicsConfig(contact=ContactConfig(object_friction=0.5, ground_friction=0.5))


def make(seed: int, held_out: bool = False) -> tuple[BucketSpec, ArticulatedObject]:
    form, detail = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(2))
    spec = sample_bucket(form, default_bucket_config(), held_out)
    return spec, build_bucket(spec, f"test-{seed}", detail)


Bucket = tuple[BucketSpec, ArticulatedObject]


@pytest.fixture(scope="module", params=SEEDS, ids=lambda p: f"{'held-out' if p[1] else 'usual'}-{p[0]}")
def bucket(request: pytest.FixtureRequest) -> Bucket:
    return make(*request.param)


class World:
    """A bucket with its bail at the lower of its narrowed limits on the ground, and a ball, as in MoveBucket."""

    def __init__(self, obj: ArticulatedObject, narrowed: float = 0.1) -> None:
        spec = mujoco.MjSpec()
        set_options(spec, PHYSICS)
        ground = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1))
        set_contact(ground, Group.GROUND, Group.LOOSE, 0.5, PHYSICS)
        add_object(spec, obj, PHYSICS)
        ball = spec.worldbody.add_body(name="ball", pos=(0, 0, 5))
        ball.add_freejoint(name="ball")
        geom = ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(BALL_M, 0, 0), density=1000)
        set_contact(geom, Group.LOOSE, Group.ROBOT | Group.OBJECT | Group.GROUND, 0.5, PHYSICS)
        spec.worldbody.add_body(name="carrier", mocap=True)
        weld = spec.add_equality()
        weld.type, weld.objtype = mujoco.mjtEq.mjEQ_WELD, mujoco.mjtObj.mjOBJ_BODY
        weld.name1, weld.name2, weld.active, weld.solref = "carrier", "object/base", False, (0.01, 1)
        weld.data[10] = 1
        set_joint_limits_solver(spec.joints, PHYSICS)
        self.model: Any = spec.compile()
        self.data: Any = mujoco.MjData(self.model)
        for joint in range(self.model.njnt):
            if self.model.jnt_limited[joint]:
                low, high = self.model.jnt_range[joint].copy()
                self.model.jnt_range[joint] = low + narrowed * (high - low), high - narrowed * (high - low)
                self.data.qpos[self.model.jnt_qposadr[joint]] = self.model.jnt_range[joint, 0]
        self.base = self.data.body("object/base")
        mujoco.mj_forward(self.model, self.data)

    def step(self, seconds: float) -> None:
        for _ in range(round(seconds / PHYSICS.timestep_s)):
            mujoco.mj_step(self.model, self.data)

    def drop_ball(self, position: tuple[float, float, float]) -> None:
        joint = self.data.joint("ball")
        joint.qpos[:] = (*position, 1, 0, 0, 0)
        joint.qvel[:] = 0

    def ball_in_bucket(self) -> np.ndarray:
        return self.base.xmat.reshape(3, 3).T @ (self.data.body("ball").xpos - self.base.xpos)

    def grab(self) -> None:
        """Hold the bucket by a body that follows `carry`."""
        self.data.mocap_pos[0], self.data.mocap_quat[0] = self.base.xpos, self.base.xquat
        self.data.eq_active[0] = 1

    def tilt_rad(self) -> float:
        return math.acos(min(1.0, self.base.xmat[8]))


def shape_mesh(shape: CollisionShape) -> TriMesh:
    if shape.kind == "hull":
        mesh = convex_hull(shape.vertices).mesh
    elif shape.kind == "box":
        mesh = box(shape.size)
    else:
        mesh = {"cylinder": cylinder, "capsule": capsule}[shape.kind](*shape.size, 32)
    return mesh.transformed(shape.position, shape.quaternion)


def test_same_seed_same_bucket_and_other_seed_another() -> None:
    hashes = [GENERATOR.make(seed, "x", held_out).content_hash for seed, held_out in SEEDS]
    assert [GENERATOR.make(seed, "x", held_out).content_hash for seed, held_out in SEEDS[5:9]] == hashes[5:9]
    assert len(set(hashes)) == len(hashes)


def test_settles_at_once(bucket: Bucket) -> None:
    world = World(bucket[1])
    start = world.base.xpos.copy()
    world.step(2.0)
    assert np.linalg.norm(world.base.xpos - start) < 0.002
    assert world.tilt_rad() < math.radians(1.0)
    for joint in range(world.model.njnt):  # the bail stays where it lies
        if world.model.jnt_limited[joint]:
            value = world.data.qpos[world.model.jnt_qposadr[joint]]
            assert value == pytest.approx(world.model.jnt_range[joint, 0], abs=0.02)


def shaken(world: World, lift_m: float, acceleration_m_s2: float, tilt_deg: float) -> np.ndarray:
    """Lift, shake along three axes at a time and tilt towards all sides; the ball's places in the bucket."""
    start, upright, places = world.base.xpos.copy(), world.base.xquat.copy(), []
    world.grab()
    turn = 2 * math.pi * 2.5
    reach = acceleration_m_s2 / turn**2
    for k in range(2000):
        t = k * PHYSICS.timestep_s
        full = min(1.0, 2 * t)
        swing = (
            full
            * reach
            * np.array((math.sin(turn * t), math.sin(1.31 * turn * t), 0.7 * math.sin(0.8 * turn * t)))
        )
        world.data.mocap_pos[0] = start + swing + (0, 0, full * lift_m)
        towards = 2 * math.pi * t / 2
        lean = math.radians(tilt_deg) * min(max(t - 1.0, 0.0), 1.0)
        quaternion = quat_from_axis_angle((math.cos(towards), math.sin(towards), 0.0), lean)
        world.data.mocap_quat[0] = quat_multiply(quaternion, upright)
        mujoco.mj_step(world.model, world.data)
        places.append(world.ball_in_bucket())
    return np.array(places)


def holds_a_ball(spec: BucketSpec, obj: ArticulatedObject) -> None:
    """A ball dropped from the rim comes to rest on the floor and stays in, also shaken and tilted."""
    world = World(obj)
    world.step(0.05)
    world.drop_ball((0.01, 0.005, spec.height_m))
    world.step(2.5)
    rest = world.ball_in_bucket()
    assert rest[2] == pytest.approx(max(spec.floor_z, 0.006) + BALL_M, abs=0.001)
    assert np.linalg.norm(world.data.joint("ball").qvel) < 0.02
    assert world.tilt_rad() < math.radians(1.0)
    places = shaken(world, 0.3, 5.0, 20.0)
    assert places[:, 2].min() > rest[2] - 0.004
    assert places[:, 2].max() < spec.height_m
    # its surface never passes the drawn wall
    widths = np.interp(places[:, 2], *np.array(spec.profile.knots).T)
    assert (outline_scale(spec.section, places[:, :2]) + BALL_M < widths + 0.004).all()


def test_holds_a_ball(bucket: Bucket) -> None:
    holds_a_ball(*bucket)


@pytest.mark.slow
def test_holds_a_ball_many() -> None:
    for seed in MANY_SEEDS:
        holds_a_ball(*make(seed, held_out=seed % 4 == 0))


def test_a_bucket_without_a_wall_leaks() -> None:
    """The check above is only worth something if it can fail."""
    spec, obj = make(0)
    root = obj.links[0]
    fewer = tuple(s for s in root.collisions if s.part != "wall" or s.position[0] < 0)
    leaky = dataclasses.replace(obj, links=(dataclasses.replace(root, collisions=fewer), *obj.links[1:]))
    with pytest.raises(AssertionError):
        holds_a_ball(spec, leaky)


def bail_gap_m(obj: ArticulatedObject) -> float:
    """Least distance of the bail from the body's shapes over its whole range."""
    spec = mujoco.MjSpec()
    add_object(spec, dataclasses.replace(obj, category="cabinet"), PHYSICS)
    model = spec.compile()
    data = mujoco.MjData(model)
    base = [g for g in range(model.ngeom) if model.geom_bodyid[g] == model.body("object/base").id]
    bail = [g for g in range(model.ngeom) if g not in base]
    least = math.inf
    for value in np.linspace(*model.jnt_range[0], 41):
        data.qpos[0] = value
        mujoco.mj_forward(model, data)
        least = min(least, *(mujoco.mj_geomDistance(model, data, a, b, 0.02, None) for a in base for b in bail))
    return least


def test_bail_swings_without_touching(bucket: Bucket) -> None:
    spec, obj = bucket
    if spec.bail is None:
        assert len(obj.links) == 1
        return
    joint = obj.links[1].joint
    assert joint is not None
    assert np.array_equal(joint.axis, (0, 1, 0))
    assert joint.limits[0] == -joint.limits[1]
    assert math.radians(80) <= joint.limits[1] <= math.radians(150)
    assert bail_gap_m(obj) > 0.0002
    # at the lower limit its middle is in front of the rim, at the upper one behind
    top = np.array((0.0, 0.0, spec.bail.reach_m))
    for limit in joint.limits:
        x = quat_rotate(quat_from_axis_angle(joint.axis, limit), top)[0]
        assert x * np.sign(limit) > 0
        if abs(limit) < math.radians(100):
            assert abs(x) > spec.section.aspect * spec.top_m


@pytest.mark.slow
def test_bail_swings_without_touching_many() -> None:
    for seed in MANY_SEEDS:
        spec, obj = make(seed, held_out=seed % 4 == 0)
        assert spec.bail is None or bail_gap_m(obj) > 0.0002, f"seed {seed}, {spec.family}"


def test_the_sweep_notices_a_bail_that_is_too_short() -> None:
    spec, _ = make(next(s for s in range(20) if make(s)[0].family == "household"))
    assert spec.bail is not None
    short = dataclasses.replace(spec.bail, half_span_m=spec.bail.half_span_m - 0.02)
    assert bail_gap_m(build_bucket(dataclasses.replace(spec, bail=short), "x", np.random.default_rng(0))) < 0


def agreement_m(obj: ArticulatedObject, count: int = 1000) -> float:
    """95th percentile of the distances between a link's drawn and touched surfaces, the worse way."""
    rng = np.random.default_rng(0)
    worst = []
    for link in obj.links:
        meshes = [shape_mesh(shape) for shape in link.collisions]
        touched = sample_surface(meshes, 20 * count, rng)
        for mesh in meshes:
            touched = touched[depth_inside(convex_hull(mesh.vertices).planes, touched) < 1e-6]
        drawn = sample_surface([visual.mesh for visual in link.visuals], 20 * count, rng)
        for few, many in ((drawn[:count], touched), (touched[::20], drawn)):
            worst.append(float(np.percentile(cKDTree(many).query(few)[0], 95)))
    return max(worst)


@pytest.mark.parametrize(("seed", "held_out"), [(1, False), (29, False), (5, True)])
def test_drawn_and_touched_surfaces_agree(seed: int, held_out: bool) -> None:
    assert agreement_m(make(seed, held_out)[1]) < 0.010


@pytest.mark.slow
def test_drawn_and_touched_surfaces_agree_many() -> None:
    for seed in MANY_SEEDS[:40]:
        assert agreement_m(make(seed, held_out=seed % 4 == 0)[1]) < 0.010


def test_many_seeds_are_legal() -> None:
    config = default_bucket_config()
    seen = {False: set[str](), True: set[str]()}
    kinds: dict[str, set[str]] = {
        name: set() for name in ("section", "profile", "bail", "ear", "lip", "foot", "grip")
    }
    for seed in MANY_SEEDS:
        for held_out in (False, True):
            spec = sample_bucket(np.random.default_rng(seed), config, held_out)
            seen[held_out].add(spec.family)
            assert spec.held_out == held_out
            assert 0.2 <= 2 * spec.top_m <= 0.34
            assert 0.18 <= spec.height_m <= 0.4
            lean = (spec.top_m - spec.profile.knots[0][1]) / spec.height_m
            assert 1 < math.degrees(math.atan(lean)) < 13
            assert 0.4 <= spec.body_kg + spec.bail_kg <= 2.6
            assert spec.wall_m + spec.lip.overhang_m < 0.03
            if not held_out:
                assert spec.bail is not None
                assert spec.section.kind != "oval"
                for name in ("section", "profile", "lip", "foot", "ear", "bail"):
                    kinds[name].add(getattr(spec, name).kind)
                kinds["grip"].add(spec.bail.grip.kind)
    assert seen[False] == {family.name for family in config.families if not family.held_out}
    assert seen[True] == {family.name for family in config.families if family.held_out}
    assert kinds["section"] == {"round", "square", "hexagon", "octagon"}
    assert kinds["profile"] == {"straight", "stepped", "ribbed", "bellied", "flared"}
    assert kinds["bail"] == {"wire", "moulded"}
    assert kinds["ear"] == {"boss", "tab"}
    assert kinds["lip"] == {"rolled", "flange", "collar", "plain"}
    assert kinds["foot"] == {"flat", "skirt", "ring"}
    assert kinds["grip"] == {"barrel", "sleeve", "bare"}


def test_budgets(bucket: Bucket) -> None:
    obj = bucket[1]
    assert sum(len(visual.mesh.faces) for link in obj.links for visual in link.visuals) <= 6000
    assert sum(len(link.collisions) for link in obj.links) <= 60


def test_weighs_what_the_specification_says(bucket: Bucket) -> None:
    spec, obj = bucket
    model = World(obj).model
    assert model.body("object/base").mass[0] == pytest.approx(spec.body_kg, rel=0.01)
    if spec.bail is not None:
        assert model.body("object/link_0").mass[0] == pytest.approx(spec.bail_kg, rel=0.01)
        assert 0.02 < spec.bail_kg < 0.4
    assert obj.metadata["mass_kg"] == pytest.approx(spec.body_kg + spec.bail_kg, abs=0.001)


def test_meshes_are_closed_and_look_outwards(bucket: Bucket) -> None:
    for link in bucket[1].links:
        for visual in link.visuals:
            assert is_closed(visual.mesh), visual.part
            assert (triangle_areas(visual.mesh) > 0).all(), visual.part
    parts = {visual.part for link in bucket[1].links for visual in link.visuals}
    assert parts <= {"wall", "floor", "lip", "foot", "handle", "ear"}
    assert {"wall", "floor", "ear"} <= parts


def test_stands_on_the_ground_within_its_bounds(bucket: Bucket) -> None:
    spec, obj = bucket
    base = np.concatenate([visual.mesh.vertices for visual in obj.links[0].visuals])
    assert base[:, 2].min() == pytest.approx(0.0, abs=1e-9)
    assert obj.bounds[0, 2] == pytest.approx(0.0, abs=1e-9)
    assert (obj.bounds[0] <= base.min(axis=0) + 1e-9).all()
    assert (obj.bounds[1] >= base.max(axis=0) - 1e-9).all()
    lip = np.concatenate([v.mesh.vertices for v in obj.links[0].visuals if v.part in ("wall", "lip")])
    assert lip[:, 2].max() == pytest.approx(spec.height_m, abs=0.001)
    touched = np.concatenate([shape_mesh(shape).vertices for shape in obj.links[0].collisions])
    assert touched[:, 2].min() == pytest.approx(0.0, abs=1e-9)


def test_is_hollow(bucket: Bucket) -> None:
    """A straight line down its axis meets nothing but the floor."""
    spec, obj = bucket
    line = np.stack([(0.0, 0.0, z) for z in np.linspace(max(spec.floor_z, 0.006) + 0.001, spec.height_m, 40)])
    for shape in obj.links[0].collisions:
        assert (depth_inside(convex_hull(shape_mesh(shape).vertices).planes, line) < 0).all()


def test_pads_can_close_on_the_wall(bucket: Bucket) -> None:
    """At the rim the touched wall, lip included, is thinner than 30 mm, and thick enough to close on."""
    spec, obj = bucket
    angle = math.pi / 6 if spec.section.kind == "hexagon" else 0.0  # a flat side or the front
    scan = np.linspace(0.03, 0.25, 4000)
    height = spec.height_m - 0.0025
    points = np.stack((scan * math.cos(angle), scan * math.sin(angle), np.full_like(scan, height)), axis=-1)
    walls = [shape for shape in obj.links[0].collisions if shape.part in ("wall", "lip")]
    inside = [depth_inside(convex_hull(shape_mesh(shape).vertices).planes, points) > 0 for shape in walls]
    met = scan[np.any(inside, axis=0)]
    assert 0.004 < np.ptp(met) < 0.03


def test_handles(bucket: Bucket) -> None:
    spec, obj = bucket
    assert [handle.kind for handle in obj.handles] == obj.metadata["handles"]
    if spec.bail is None:
        assert [(handle.kind, handle.link) for handle in obj.handles] == [("ear", "base")] * 2
        return
    (handle,) = obj.handles
    assert (handle.kind, handle.link) == ("bail", "link_0")
    assert handle.grasp_width_m < 0.04
    assert handle.grasp_positions[0] == pytest.approx((0.0, 0.0, spec.bail.reach_m), abs=0.012)
    assert np.allclose(quat_rotate(handle.grasp_quaternions[0], np.array((0.0, 0.0, 1.0))), (0, 0, -1), atol=1e-6)
    assert np.allclose(
        np.abs(quat_rotate(handle.grasp_quaternions[0], np.array((0.0, 1.0, 0.0)))), (1, 0, 0), atol=1e-6
    )


@pytest.mark.parametrize("kind", ["round", "square", "hexagon", "octagon", "oval"])
def test_outlines_have_flat_sides_where_the_ears_are(kind: Any) -> None:
    section = Section(kind, 0.2, 0.7 if kind == "oval" else 1.0)
    fine, coarse = outline(section), coarse_outline(section)
    assert fine[:, 1].max() == pytest.approx(1.0, abs=0.01)
    assert coarse[:, 1].max() == pytest.approx(1.0, abs=0.03)
    assert 6 <= len(coarse) <= 12
    assert outline_scale(section, np.array((0.0, 1.3))) == pytest.approx(1.3, abs=0.03)
    assert np.ptp(fine[:, 0]) / np.ptp(fine[:, 1]) == pytest.approx(section.aspect, rel=0.2)
    edges = np.roll(coarse, -1, axis=0) - coarse
    ahead = np.roll(edges, -1, axis=0)
    turns = edges[:, 0] * ahead[:, 1] - edges[:, 1] * ahead[:, 0]
    assert (turns > 0).all(), "convex and counter-clockwise"


def test_spec_survives_yaml(bucket: Bucket) -> None:
    assert from_mapping(BucketSpec, yaml.safe_load(dump_yaml(bucket[0]))) == bucket[0]


def test_impossible_config_is_an_error() -> None:
    config = dataclasses.replace(default_bucket_config(), least_floor_m=0.5)
    with pytest.raises(AssetError, match="no legal bucket of family"):
        sample_bucket(np.random.default_rng(0), config)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("foot_height_m", [0.02, 0.01], "foot_height_m must be two numbers above 0"),
        ("families", [], "at least one weight must be above 0"),
        ("materials", [], "family 'household': materials have no 'plastic'"),
        ("colour", "red", "unknown key 'colour'"),
    ],
)
def test_bad_config_values_are_named(key: str, value: object, message: str) -> None:
    data = {**to_mapping(default_bucket_config()), key: value}
    with pytest.raises(ConfigError, match=message):
        from_mapping(BucketConfig, data)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("sections", {"triangle": 1.0}, "unknown name 'triangle'"),
        ("top_m", [0.2, float("inf")], "top_m must be two numbers above 0"),
        ("taper_deg", [3.0, 30.0], "taper_deg must stay within 20"),
        ("ears", {"loop": 1.0}, "ears must be boss or tab where there is a bail"),
    ],
)
def test_bad_families_are_named(key: str, value: object, message: str) -> None:
    data = to_mapping(default_bucket_config())
    data["families"][0][key] = value
    with pytest.raises(ConfigError, match=message):
        from_mapping(BucketConfig, data)
