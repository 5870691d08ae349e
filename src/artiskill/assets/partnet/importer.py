"""`import_partnet`: a PartNet-Mobility object to an `ArticulatedObject`.

What is decided here, and written to `metadata`:

- Frame: z up, ground at z = 0, front to -x (the data set's own after its fixed joint), the origin in the middle of
  a cabinet's bounds or of a chair's or bucket's footprint. All link frames are parallel to the object's with all
  joints at 0; a hinged link's frame sits on its axis, a sliding link's in the middle of its bounds. The wall of a
  cabinet that ArtiSkill exported stays a link of its own.
- Scale: the data set's models measure about 2 across; `placing.default_scale` says what they become. Folders that
  are in metres already say so themselves (`own_frame`).
- At rest every joint is at its lower limit: closed in cabinets, let down in chairs (`closing`). Bodies that are
  rigid with the root are `base`. Links on which nothing drawn hangs are left out.
- Parts of chairs and buckets bear the benchmark's names (`part_names`); `metadata["parts"]` has both.
- Handles are the parts named so; on links that move. Where there are none, the object imports and a warning in
  `metadata["warnings"]` says so; it has no target links then.
- What has more drawn triangles than are quick is drawn with fewer (`thinning`); `metadata["warnings"]` says so.
- Collision shapes follow the drawn surfaces, part by part (`collisions`); the URDF's own are the same meshes
  again, not convex, and are left out.

The costly part, the convex decomposition, is kept on disk (`hull_cache`): a second import takes 0.1 to 0.3 s.
"""

import numbers
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from artiskill.assets.articulated_object import ROOM_WALL, ArticulatedObject, Category, check_object_id
from artiskill.assets.needs import Needs
from artiskill.assets.partnet.bodies import body_poses, build_bodies, drop_empty, transform
from artiskill.assets.partnet.closing import RestRule, rest_joints
from artiskill.assets.partnet.collisions import Decompose
from artiskill.assets.partnet.decompose import DecompositionPart, import_coacd
from artiskill.assets.partnet.drawn import read_drawn, vertices_of
from artiskill.assets.partnet.folder import URDF_NAME, find_partnet_folder, open_object
from artiskill.assets.partnet.hull_cache import OnProgress, decompose_cached, default_cache_dir
from artiskill.assets.partnet.links import Source, build_links
from artiskill.assets.partnet.own_frame import read_own_frame
from artiskill.assets.partnet.placing import check_size, default_scale, find_placement
from artiskill.assets.partnet.preview import moving_links
from artiskill.assets.partnet.progress import ProgressLines
from artiskill.assets.partnet.remarks import find_remarks, measures, part_names
from artiskill.assets.partnet.semantics import read_category, read_part_names
from artiskill.assets.partnet.thinning import thin_out
from artiskill.assets.partnet.urdf import read_urdf
from artiskill.errors import AssetError, shown

__all__ = ["default_scale", "find_partnet_folder", "import_partnet"]

_REST_RULES: dict[Category, RestRule] = {"cabinet": "close", "chair": "settle", "bucket": "keep"}


def import_partnet(
    path: Path | str,
    *,
    object_id: str | None = None,
    scale: float | None = None,
    cache_dir: Path | None = None,
    needs: Needs | None = None,
    workers: int | None = None,
    on_progress: OnProgress | None = None,
) -> ArticulatedObject:
    """Read one object of the data set.

    The first import finds collision shapes, which takes seconds to a minute. What is done is kept, part by part:
    an import that was ended goes on from there.

    Args:
        path: its folder, or a zip of it.
        object_id: name in catalogues; the folder's name where None.
        scale: metres per unit of the file; `default_scale` where None.
        cache_dir: where convex decompositions are kept; `hull_cache.default_cache_dir()` where None.
        needs: what it is wanted for; an object of no use for that is refused before anything costly is computed.
        workers: processes that decompose parts; one per core where None. The object is the same for any number.
        on_progress: called with the parts done and those in all, a few times a second while collision shapes are
            found; where None, lines on standard error say so if it takes longer than a second.

    Raises:
        AssetError: the folder or a file in it is missing or not as it must be; the message names it. Or the object
            is absurdly small or large, or does not meet `needs`.
        MissingExtraError: coacd is not installed.
    """
    import_coacd()
    if not isinstance(path, Path | str):
        raise AssetError(f"path must be an object's folder or a zip of one, not {shown(path)}")
    if scale is not None and not (isinstance(scale, numbers.Real) and 0 < scale < np.inf):
        raise AssetError(f"scale must be a positive number (metres per unit of the file), not {shown(scale)}")
    if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or workers < 1):
        raise AssetError(f"workers must be a positive number of processes, not {shown(workers)}")
    with open_object(Path(path)) as (folder, name):
        identifier = object_id if object_id is not None else re.sub(r"[^A-Za-z0-9._-]", "-", name)
        check_object_id(identifier)

        def decompose(parts: Sequence[DecompositionPart], most: int | None) -> list[list[np.ndarray]]:
            told = on_progress or ProgressLines(name)
            return decompose_cached(parts, cache_dir or default_cache_dir(), most, workers, told)

        return _import_folder(folder, name, identifier, scale, decompose, needs)


def _import_folder(
    folder: Path, name: str, identifier: str, scale: float | None, decompose: Decompose, needs: Needs | None
) -> ArticulatedObject:
    """Read the files, the small ones first, so that an object of no use is refused at once."""
    category, model_category = read_category(folder)
    if needs is not None:
        needs.check_category(name, category)
    own_frame = read_own_frame(folder)
    apart = None if own_frame is None else ROOM_WALL  # what an export wrote
    bodies, names = build_bodies(read_urdf(folder / URDF_NAME), apart), read_part_names(folder, category)
    if needs is not None:
        needs.check_links(name, moving_links(bodies, names, category))
    if own_frame is None:
        bodies, warnings = drop_empty(bodies)
    else:  # what an export wrote is taken as it is
        warnings = []
    drawn = read_drawn(bodies, folder, names)
    points = [vertices_of(meshes) for meshes in drawn]
    if not sum(map(len, points)):
        raise AssetError(f"{name}/{URDF_NAME}: no link has a <visual> mesh")
    rule = "keep" if own_frame is not None and category != "cabinet" else _REST_RULES[category]
    rest, said = rest_joints(bodies, points, rule, name)
    warnings += said
    standing = body_poses(bodies, [joint.standing if joint else 0.0 for joint in rest])
    of_object = [i for i, body in enumerate(bodies) if i == 0 or body.joint is not None]
    world = np.concatenate([transform(standing[i], points[i]) for i in of_object])
    place = find_placement(category, world, own_frame, scale)
    bounds = np.stack((place.apply(world.min(axis=0)), place.apply(world.max(axis=0))))
    check_size(np.ptp(bounds, axis=0), place.scale, name)
    poses = body_poses(bodies, [joint.value if joint else 0.0 for joint in rest])
    links, grips = build_links(Source(category, bodies, drawn, rest, poses), place, decompose, warnings)
    handles = tuple(grip.handle for grip in grips)
    links, said = thin_out(links, category)
    warnings += said + find_remarks(links, handles, category)
    return ArticulatedObject(
        id=identifier,
        category=category,
        links=links,
        handles=handles,
        bounds=bounds,
        metadata={
            "source": "PartNet-Mobility",
            "partnet_id": name,
            "model_category": model_category,
            "scale": place.scale,
            **measures([links[i] for i in of_object], handles, bounds),
            "parts": part_names(drawn),
            "handle_gaps_m": tuple(grip.gap_m for grip in grips),
            "warnings": tuple(dict.fromkeys(warnings)),
        },
    )
