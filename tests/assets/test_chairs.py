"""Generated chairs: reproducible, free of interpenetration, standing still, and rolling when pushed."""

import math
import subprocess
import sys
from collections.abc import Iterator

import mujoco
import numpy as np
import pytest
import yaml

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape
from artiskill.assets.chairs import (
    GENERATOR,
    ChairConfig,
    ChairSpec,
    default_chair_config,
    sample_chair,
)
from artiskill.assets.kinematics import link_poses, shapes_volume_m3
from artiskill.checks.runner import check_object
from artiskill.config import dump_yaml, from_mapping, to_mapping
from artiskill.errors import AssetError, ConfigError
from artiskill.geometry.meshes import TriMesh, convex_hull, merge, triangle_areas
from artiskill.geometry.primitives import box, capsule, cylinder, sphere
from artiskill.robots.model import add_shape
from artiskill.scene.object_model import add_object
from artiskill.scene.physics import (
    ContactConfig,
    Group,
    PhysicsConfig,
    set_contact,
    set_joint_limits_solver,
    set_options,
)

FEW = [(seed, False) for seed in range(8)] + [(seed, True) for seed in range(3)]
MANY = [(seed, False) for seed in range(100, 220)] + [(seed, True) for seed in range(100, 140)]
PARTS = {"wheel", "caster", "base", "column", "seat", "back", "arm", "headrest", "footrest"}
MOST_OVERLAP_M = 5e-5
# Of a caster on a hard floor: 12 kg roll with some newtons.
CASTER_FRICTION, CASTER_DAMPING = 0.01, 0.002
COLUMN_FRICTION, COLUMN_DAMPING = 0.1, 10.0


def make(seed: int, held_out: bool = False) -> ArticulatedObject:
    return GENERATOR.make(seed, f"test-{seed}", held_out)


def draw(seed: int, held_out: bool = False) -> ChairSpec:
    """The specification from which `make` builds."""
    form, _ = np.random.SeedSequence(seed).spawn(2)
    return sample_chair(np.random.default_rng(form), default_chair_config(), held_out)


@pytest.fixture(scope="module", params=FEW, ids=lambda p: f"{p[0]}{'-ood' if p[1] else ''}")
def chair(request: pytest.FixtureRequest) -> tuple[ChairSpec, ArticulatedObject]:
    return draw(*request.param), make(*request.param)


def many() -> Iterator[ArticulatedObject]:
    for seed, held_out in MANY:
        yield make(seed, held_out)


def across(spec: ChairSpec) -> float:
    """A direction across the way in which the first caster is parked, so that it must turn to follow."""
    return 0.7 if spec.casters is None else spec.casters.yaws_rad[0] + math.pi / 2


# --- the object alone: forms ----------------------------------------------------------------------


def test_same_seed_same_object_and_other_seed_another() -> None:
    assert make(5).content_hash == make(5).content_hash
    assert len({make(*key).content_hash for key in FEW}) == len(FEW)


def test_content_hash_is_the_same_in_another_process() -> None:
    code = "from artiskill.assets.chairs import GENERATOR as g; print(g.make(7, 'c').content_hash)"
    found = {
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True, env={"PYTHONHASHSEED": seed}
        ).stdout.strip()
        for seed in ("1", "2")
    }
    assert found == {make(7).content_hash}


def test_a_specification_survives_yaml(chair: tuple[ChairSpec, ArticulatedObject]) -> None:
    spec, _ = chair
    assert from_mapping(ChairSpec, to_mapping(spec)) == spec
    assert from_mapping(ChairSpec, yaml.safe_load(dump_yaml(spec))) == spec


def test_links_and_joints(chair: tuple[ChairSpec, ArticulatedObject]) -> None:
    spec, obj = chair
    assert [link.name for link in obj.links] == ["base", *(f"link_{k}" for k in range(len(obj.links) - 1))]
    joints = [link.joint for link in obj.links if link.joint is not None]
    assert len(joints) == spec.joint_count == obj.metadata["joints"]
    assert len({j.name for j in joints}) == len(joints)
    assert 1 <= len(joints) <= 3 if spec.held_out else 7 <= len(joints) <= 19
    assert not obj.handles
    for link in obj.links[1:]:
        assert link.joint is not None
        name, what = link.joint.name.rsplit("_", 1)
        assert name == link.name
        assert np.array_equal(link.joint.origin, np.zeros(3))
        if what in ("swivel", "roll"):
            assert link.joint.limits == (-math.inf, math.inf)
            assert link.joint.stiffness == 0
        else:
            assert link.joint.limits[0] == 0 < link.joint.limits[1]
            assert link.joint.stiffness > 0 > link.joint.spring_reference


def test_links_stand_depth_first(chair: tuple[ChairSpec, ArticulatedObject]) -> None:
    """The engine numbers bodies so; links and bodies then agree."""
    _, obj = chair
    for i, link in enumerate(obj.links[1:], start=1):
        chain = [i - 1]
        while chain[-1] >= 0:
            chain.append(obj.links[chain[-1]].parent)
        assert link.parent in chain


def test_stands_on_the_ground_within_its_bounds(chair: tuple[ChairSpec, ArticulatedObject]) -> None:
    spec, obj = chair
    points = drawn(obj).vertices
    assert np.allclose(obj.bounds, (points.min(axis=0), points.max(axis=0)), atol=1e-9)
    assert obj.bounds[0, 2] == pytest.approx(0.0, abs=2e-3)
    lowest = shell(obj).bounds[0, 2]
    assert lowest == pytest.approx(0.0, abs=2e-4)
    assert obj.metadata["height_m"] == pytest.approx(spec.top_m, abs=0.03)
    if spec.back.kind != "none":
        assert 0.75 <= obj.metadata["height_m"] <= 1.07
    assert 0.4 <= obj.metadata["width_m"] <= 0.85


def test_faces_the_negative_x_direction(chair: tuple[ChairSpec, ArticulatedObject]) -> None:
    spec, obj = chair
    parts = [(v.part, v.mesh.vertices + p) for p, link in placed_links(obj) for v in link.visuals]
    seat = np.concatenate([x for part, x in parts if part == "seat"])
    if spec.back.kind != "none":
        back = np.concatenate([x for part, x in parts if part == "back"])
        assert back[:, 0].mean() > seat[:, 0].mean() + 0.1


def test_parts_are_named(chair: tuple[ChairSpec, ArticulatedObject]) -> None:
    spec, obj = chair
    drawn_parts = {v.part for link in obj.links for v in link.visuals}
    touched = {s.part for link in obj.links for s in link.collisions}
    assert drawn_parts <= PARTS
    assert touched <= PARTS
    assert {"base", "seat"} <= touched
    for part, there in (
        ("wheel", spec.casters is not None),
        ("caster", spec.casters is not None),
        ("back", spec.back.kind != "none" or spec.base.kind == "cantilever"),
        ("arm", spec.arms.kind != "none"),
        ("headrest", spec.back.headrest is not None),
        ("footrest", spec.column is not None and spec.column.footrest_m > 0),
    ):
        assert (part in touched) == there, part
        assert (part in drawn_parts) == there, part
    rolling = [link for link in obj.links if link.joint is not None and link.joint.name.endswith("roll")]
    assert all({s.part for s in link.collisions} == {"wheel"} for link in rolling)


def test_masses_are_real(chair: tuple[ChairSpec, ArticulatedObject]) -> None:
    spec, obj = chair
    masses = [link.density_kg_m3 * shapes_volume_m3(link.collisions) for link in obj.links]
    assert sum(masses) == pytest.approx(spec.mass_kg, rel=0.02)
    assert 7 <= sum(masses) <= 20
    heights = [link_poses(obj, np.zeros(spec.joint_count))[0][i][2] for i in range(len(obj.links))]
    assert all(m > 0.02 for m in masses)
    assert heights[0] == 0.0


def test_meshes_are_sound(chair: tuple[ChairSpec, ArticulatedObject]) -> None:
    for link in chair[1].links:
        for visual in link.visuals:
            mesh = visual.mesh
            corners = mesh.vertices[mesh.faces]
            volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
            assert volume > 0, f"{link.name}: faces of {visual.part} look inwards"
            assert (triangle_areas(mesh) > 1e-12).all(), f"{link.name}: {visual.part} has triangles without area"
            assert (mesh.uvs is not None) == (visual.material.texture is not None)


def test_budgets(chair: tuple[ChairSpec, ArticulatedObject]) -> None:
    _, obj = chair
    assert sum(len(link.collisions) for link in obj.links) <= 60
    assert sum(len(v.mesh.faces) for link in obj.links for v in link.visuals) <= 10_000


def placed_links(obj: ArticulatedObject) -> list[tuple[np.ndarray, object]]:
    positions, _ = link_poses(obj, np.zeros(len(obj.jointed_links)))
    return list(zip(positions, obj.links, strict=True))  # all parallel to the object


def drawn(obj: ArticulatedObject) -> TriMesh:
    return merge(
        [TriMesh(v.mesh.vertices + p, v.mesh.faces) for p, link in placed_links(obj) for v in link.visuals]
    )


def shell(obj: ArticulatedObject) -> TriMesh:
    """The surfaces of all collision shapes."""
    meshes = [shape_mesh(s) for _, link in placed_links(obj) for s in link.collisions]
    starts = [p for p, link in placed_links(obj) for _ in link.collisions]
    return merge([TriMesh(m.vertices + p, m.faces) for p, m in zip(starts, meshes, strict=True)])


def shape_mesh(shape: CollisionShape) -> TriMesh:
    if shape.kind == "hull":
        flat = convex_hull(shape.vertices).mesh
    else:
        build = {"box": lambda *h: box(h), "cylinder": cylinder, "capsule": capsule, "sphere": sphere}
        flat = build[shape.kind](*shape.size)
    return TriMesh(flat.transformed(shape.position, shape.quaternion).vertices, flat.faces)


# --- all checks that the catalogue must pass ------------------------------------------------------


def failures(obj: ArticulatedObject) -> list[str]:
    return [f"{obj.id} {obj.metadata['family']}: {result}" for result in check_object(obj) if not result.passed]


def test_passes_the_checks_of_the_catalogue(chair: tuple[ChairSpec, ArticulatedObject]) -> None:
    assert failures(chair[1]) == []


@pytest.mark.slow
def test_many_pass_the_checks_of_the_catalogue() -> None:
    assert [failure for obj in many() for failure in failures(obj)] == []


# --- families -------------------------------------------------------------------------------------


def test_held_out_families_are_kept_apart() -> None:
    config = default_chair_config()
    kept = {f.name for f in config.families if f.held_out}
    assert {draw(seed, True).family for seed in range(40)} == kept
    assert not {draw(seed).family for seed in range(40)} & kept
    assert {draw(seed).base.kind for seed in range(40)} == {"star"}
    assert {draw(seed, True).base.kind for seed in range(40)} == {"disc", "sled", "cantilever"}


def test_variety_over_many_seeds() -> None:
    specs = [draw(seed) for seed in range(300)]
    config = default_chair_config()
    assert {s.family for s in specs} == {f.name for f in config.families if not f.held_out}
    assert {s.base.legs for s in specs} == {4, 5}
    assert {s.casters.kind for s in specs if s.casters} == {"twin", "single", "ball"}
    assert {s.seat.kind for s in specs} == {"square", "round", "waterfall", "saddle"}
    assert {s.back.kind for s in specs} == {"none", "low", "high", "mesh", "curved", "slats"}
    assert {s.arms.kind for s in specs} == {"none", "tee", "loop", "cantilever"}
    assert {s.back.headrest is None for s in specs} == {True, False}
    assert {s.column is not None and s.column.footrest_m > 0 for s in specs} == {True, False}
    assert {s.appearance.seat.finish for s in specs} == {"fabric", "leather", "plastic", "wood"}
    assert {s.appearance.base.finish for s in specs} >= {"plastic", "metal", "wood"}
    counts = {s.joint_count for s in specs}
    assert min(counts) <= 10
    assert max(counts) >= 17
    for spec in specs:
        assert spec.casters is not None
        assert 0.040 <= spec.casters.diameter_m <= 0.075
        assert 0.020 <= spec.casters.trail_m <= 0.040


def test_a_config_that_contradicts_itself_is_refused() -> None:
    values = to_mapping(default_chair_config())
    broken = [dict(values["families"][0], seats={"beanbag": 1.0}), *values["families"][1:]]
    with pytest.raises(ConfigError, match="unknown name 'beanbag'"):
        from_mapping(ChairConfig, values | {"families": broken})
    with pytest.raises(ConfigError, match="the smaller first"):
        from_mapping(ChairConfig, values | {"height_m": [1.0, 0.8]})
    with pytest.raises(ConfigError, match=r"split_probability must lie in \[0, 1\], not -0.1"):
        from_mapping(ChairConfig, values | {"split_probability": -0.1})
    impossible = from_mapping(ChairConfig, values | {"mass_kg": [90.0, 99.0]})
    with pytest.raises(AssetError, match="no legal chair"):
        sample_chair(np.random.default_rng(0), impossible)


# --- joints ---------------------------------------------------------------------------------------


def test_nothing_overlaps_within_joint_limits(chair: tuple[ChairSpec, ArticulatedObject]) -> None:
    assert overlaps(chair[1]) == []


@pytest.mark.slow
def test_nothing_overlaps_within_joint_limits_many() -> None:
    for obj in many():
        assert overlaps(obj) == []


def test_the_sweep_notices_a_seat_that_sinks_into_its_mechanism() -> None:
    obj = next(o for o in map(make, range(100)) if "tilt" in o.metadata["tags"])
    assert overlaps(obj) == []
    name = next(link.joint.name for link in obj.links if link.joint and link.joint.name.endswith("tilt"))
    assert overlaps(obj, {name: (-0.3, 0.0)}) != []


def overlaps(obj: ArticulatedObject, other_limits: dict[str, tuple[float, float]] | None = None) -> list[str]:
    """What overlaps what, at any of the joint values."""
    model = compiled(obj)
    data = mujoco.MjData(model)
    limits = np.array([joint_range(obj.links[i], other_limits or {}) for i in obj.jointed_links])
    found = []
    for shares in sweep(model.nq, np.random.default_rng(0)):
        data.qpos[:] = limits[:, 0] + shares * (limits[:, 1] - limits[:, 0])
        mujoco.mj_forward(model, data)
        for contact in data.contact:
            if contact.dist < -MOST_OVERLAP_M:
                names = [model.geom(g).name for g in (contact.geom1, contact.geom2)]
                found.append(f"{obj.id}: {names} by {-contact.dist:.5f} m at {data.qpos.round(3)}")
    return found


def sweep(joints: int, rng: np.random.Generator) -> np.ndarray:
    """Shares of the ranges: each joint alone, all together, and random combinations. (N, joints)."""
    steps = np.linspace(0.0, 1.0, 9)[:, None]
    alone = [steps * np.eye(joints)[k] for k in range(joints)]
    return np.concatenate((*alone, np.repeat(steps, joints, axis=1), rng.random((30, joints))))


def joint_range(link: object, other: dict[str, tuple[float, float]]) -> tuple[float, float]:
    low, high = other.get(link.joint.name, link.joint.limits)
    return (low, high) if math.isfinite(low) else (0.0, 2 * math.pi)


def compiled(obj: ArticulatedObject) -> "mujoco.MjModel":
    """All shapes of the object, every link colliding with every other."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    bodies = []
    for link in obj.links:
        parent = spec.worldbody if link.parent < 0 else bodies[link.parent]
        body = parent.add_body(name=link.name, pos=link.position, quat=link.quaternion)
        if link.joint is not None:
            slide = link.joint.kind == "prismatic"
            kind = mujoco.mjtJoint.mjJNT_SLIDE if slide else mujoco.mjtJoint.mjJNT_HINGE
            body.add_joint(name=link.joint.name, type=kind, axis=link.joint.axis)
        for i, shape in enumerate(link.collisions):
            name = f"{link.name}-{i}-{shape.part}"
            geom = add_shape(body, name, shape.kind, shape.size, shape.position, shape.quaternion)
            geom.density = link.density_kg_m3
            if shape.kind == "hull":
                mesh = spec.add_mesh(name=name, uservert=np.asarray(shape.vertices, dtype=float).ravel())
                geom.meshname = mesh.name
        bodies.append(body)
    return spec.compile()


# --- standing and rolling -------------------------------------------------------------------------


def on_the_ground(obj: ArticulatedObject) -> tuple["mujoco.MjModel", "mujoco.MjData"]:
    physics = PhysicsConfig(contact=ContactConfig(object_friction=0.1, ground_friction=0.1))
    spec = mujoco.MjSpec()
    set_options(spec, physics)
    ground = spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1))
    set_contact(ground, Group.GROUND, Group.LOOSE, physics.contact.ground_friction, physics)
    add_object(spec, obj, physics)
    set_joint_limits_solver(spec.joints[1:], physics)
    model = spec.compile()
    children = [link.parent for link in obj.links if link.joint and link.joint.name.endswith("roll")]
    for i in obj.jointed_links:
        joint = obj.links[i].joint
        assert joint is not None
        on_wheels = i in children or joint.name.endswith("roll")
        dof = model.joint(f"object/{joint.name}").dofadr[0]
        model.dof_frictionloss[dof] = CASTER_FRICTION if on_wheels else COLUMN_FRICTION
        model.dof_damping[dof] = CASTER_DAMPING if on_wheels else COLUMN_DAMPING
    return model, mujoco.MjData(model)


def tilt_deg(data: "mujoco.MjData") -> float:
    return math.degrees(math.acos(min(1.0, data.body("object/base").xmat[8])))


def check_settles(obj: ArticulatedObject) -> None:
    model, data = on_the_ground(obj)
    mujoco.mj_forward(model, data)
    before = data.body("object/base").xpos.copy()
    mujoco.mj_step(model, data, 1000)
    assert np.linalg.norm(data.body("object/base").xpos - before) < 0.002, obj.metadata
    assert tilt_deg(data) < 1.0
    assert np.abs(data.qvel).max() < 0.02
    for name in ("lift", "tilt", "recline"):
        for i in obj.jointed_links:
            joint = obj.links[i].joint
            if joint is not None and joint.name.endswith(name):
                assert abs(data.joint(f"object/{joint.name}").qpos[0]) < 0.003, f"{obj.id}: {joint.name} gives way"


def check_rolls(obj: ArticulatedObject, direction_rad: float) -> None:
    """A push of 60 N for half a second at the seat moves the chair and does not tip it; less on a light stool."""
    model, data = on_the_ground(obj)
    mujoco.mj_step(model, data, 250)
    start, most = data.body("object/base").xpos.copy(), 0.0
    seat = data.body("object/" + [link.name for link in obj.links if has_part(link, "seat")][-1])
    newtons = min(60.0, 0.6 * 9.81 * obj.metadata["mass_kg"])
    force = newtons * np.array((math.cos(direction_rad), math.sin(direction_rad), 0.0))
    turned = data.qpos[7:].copy()
    for step in range(500):
        data.xfrc_applied[:] = 0
        if step < 250:
            at = data.body("object/base").xpos + np.array((0.0, 0.0, obj.metadata["seat_height_m"]))
            data.xfrc_applied[seat.id] = (*force, *np.cross(at - seat.xipos, force))
        mujoco.mj_step(model, data)
        most = max(most, tilt_deg(data))
    moved = data.body("object/base").xpos - start
    assert np.hypot(*moved[:2]) > 0.15, obj.metadata
    assert moved @ force > 0
    assert most < 30.0, obj.metadata
    assert tilt_deg(data) < 5.0, obj.metadata
    what = [obj.links[i].joint.name.rsplit("_", 1)[1] for i in obj.jointed_links]
    change = np.abs(data.qpos[7:] - turned)
    if "roll" in what:
        assert max(c for c, w in zip(change, what, strict=True) if w == "roll") > 3.0
        assert max(c for c, w in zip(change, what, strict=True) if w == "swivel") > 0.3


def has_part(link: object, part: str) -> bool:
    return any(s.part == part for s in link.collisions)


def test_settles(chair: tuple[ChairSpec, ArticulatedObject]) -> None:
    check_settles(chair[1])


def test_rolls_and_swivels_when_pushed(chair: tuple[ChairSpec, ArticulatedObject]) -> None:
    check_rolls(chair[1], across(chair[0]))


@pytest.mark.slow
def test_settles_and_rolls_many() -> None:
    for key, obj in zip(MANY, many(), strict=True):
        check_settles(obj)
        check_rolls(obj, across(draw(*key)))


def test_springs_hold_more_than_the_parts_weigh(chair: tuple[ChairSpec, ArticulatedObject]) -> None:
    """A lift is only drawn out by more than the whole chair weighs, nearly: it is locked."""
    spec, obj = chair
    for link in obj.links:
        if link.joint is not None and link.joint.name.endswith("lift"):
            preload = -link.joint.stiffness * link.joint.spring_reference
            assert preload >= 0.9 * 9.81 * spec.mass_kg - 60.0
            assert link.joint.limits[1] <= 0.10


def test_centre_of_mass_lies_within_the_support(chair: tuple[ChairSpec, ArticulatedObject]) -> None:
    spec, obj = chair
    model, data = on_the_ground(obj)
    mujoco.mj_forward(model, data)
    centre = data.subtree_com[1]
    assert np.hypot(*centre[:2]) < 0.12
    assert centre[2] < 0.6
    if spec.casters is not None:
        reach = spec.base.radius_m * math.cos(math.pi / spec.base.legs) - spec.casters.trail_m
        assert reach > 0.14  # EN 1335-1 asks for 0.195 with the wheels turned the other way
