"""The robot's finishes, and the one way its drawn parts are put together."""

from artiskill.assets.articulated_object import Material, VisualMesh
from artiskill.geometry.meshes import TriMesh, merge
from artiskill.geometry.primitives import extrude, superellipse

# linear values; as displayed (sRGB) the white is 0.93 and the joints' dark grey about 0.2
WHITE = Material("robot_white", (0.85, 0.85, 0.85, 1.0), shininess=0.5)
JOINT = Material("robot_joint", (0.035, 0.037, 0.042, 1.0), shininess=0.3)
GREY = Material("robot_grey", (0.16, 0.17, 0.19, 1.0), shininess=0.4)
BLACK = Material("robot_black", (0.008, 0.008, 0.009, 1.0), shininess=0.1)
NAVY = Material("robot_navy", (0.022, 0.045, 0.095, 1.0), shininess=0.4)
ACCENT = Material("robot_accent", (0.010, 0.200, 0.600, 1.0), shininess=0.4)


def drawn(part: str, *groups: tuple[Material, list[TriMesh]]) -> tuple[VisualMesh, ...]:
    """One `VisualMesh` per finish; its part is `<part>_<finish>`."""
    return tuple(
        VisualMesh(merge(meshes), material, f"{part}_{material.name.removeprefix('robot_')}")
        for material, meshes in groups
    )


def drum(radius: float, half_length: float, sides: int = 12) -> TriMesh:
    """A plain cylinder about the origin, along z, with as few triangles as it can have."""
    return extrude(superellipse(radius, radius, 2.0, sides), half_length)
