"""Where collision shapes of a moving link run into its parent's, closed or on the way: facts for warnings."""

import numpy as np

from artiskill.assets.articulated_object import CollisionShape, Joint, Link
from artiskill.geometry.meshes import ConvexHull, convex_hull, depth_inside, sample_surface
from artiskill.geometry.primitives import box, cylinder, sphere
from artiskill.geometry.rotations import quat_from_axis_angle, quat_to_matrix, transform_points

# Sheets are made 3 mm thick, so neighbours that touch in the drawing overlap by less than this.
DEPTH_M = 0.0035
_PROBES = 150
_FRACTIONS = (0.0, 0.1, 0.3, 0.6, 1.0)  # of the joint's range


def find_overlaps(links: tuple[Link, ...]) -> list[str]:
    """One sentence per moving link whose shapes enter its parent's by more than `DEPTH_M` somewhere."""
    found = []
    for link in links:
        if link.joint is None or not np.isfinite(link.joint.limits).all() or not link.collisions:
            continue
        parent = links[link.parent]
        others = [shape_hull(shape) for shape in parent.collisions]
        points = _probe_points(link)
        depths = [
            _deepest(others, _moved(points, link.joint, value) + link.position)
            for value in (link.joint.limits[0] + f * np.diff(link.joint.limits)[0] for f in _FRACTIONS)
        ]
        if max(depths) > DEPTH_M:
            worst = int(np.argmax(depths))
            when = "closed" if worst == 0 else f"{100 * _FRACTIONS[worst]:g} % open"
            found.append(
                f"collision shapes of {link.name!r} overlap those of {parent.name!r}: "
                f"{1e3 * depths[0]:.0f} mm closed, at most {1e3 * depths[worst]:.0f} mm ({when})"
            )
    return found


def shape_hull(shape: CollisionShape) -> ConvexHull:
    """The hull, in the link's frame, of a shape that this importer makes."""
    if shape.vertices is not None:
        points = shape.vertices
    elif shape.kind == "cylinder":
        points = cylinder(shape.size[0], shape.size[1]).vertices
    else:
        points = sphere(shape.size[0]).vertices if shape.kind == "sphere" else box(shape.size).vertices
    return convex_hull(transform_points(shape.position, shape.quaternion, points))


def moved_hull(hull: ConvexHull, shift: np.ndarray) -> ConvexHull:
    """A hull moved by a vector (3,)."""
    offsets = hull.planes[:, 3] - hull.planes[:, :3] @ shift
    planes = np.column_stack((hull.planes[:, :3], offsets))
    return ConvexHull(hull.mesh.transformed(shift), planes, hull.volume_m3)


def _probe_points(link: Link) -> np.ndarray:
    rng = np.random.default_rng(0)
    meshes = [shape_hull(shape).mesh for shape in link.collisions]
    return np.concatenate([np.concatenate((m.vertices, sample_surface([m], _PROBES, rng))) for m in meshes])


def _moved(points: np.ndarray, joint: Joint, value: float) -> np.ndarray:
    """Points of the link's frame when the joint has moved, still relative to the link's rest position."""
    if joint.kind == "prismatic":
        return points + joint.axis * value
    rotation = quat_to_matrix(quat_from_axis_angle(joint.axis, value))
    return (points - joint.origin) @ rotation.T + joint.origin


def _deepest(hulls: list[ConvexHull], points: np.ndarray) -> float:
    return max((float(depth_inside(hull.planes, points).max()) for hull in hulls), default=0.0)
