"""What an object can be used for, from its small files alone: no mesh is read, nothing decomposed."""

import numpy as np

from artiskill.assets.articulated_object import Category
from artiskill.assets.needs import MovingLink
from artiskill.assets.partnet.bodies import Body
from artiskill.assets.partnet.semantics import PartNames


def moving_links(bodies: tuple[Body, ...], names: PartNames, category: Category) -> tuple[MovingLink, ...]:
    """The links that the finished object's joints will move, and whether they will have handles.

    Doors that turn without end have no closed pose; their handles do not count.
    """
    found = []
    for body in bodies:
        if body.joint is None:
            continue
        endless = body.joint.kind == "continuous" or body.joint.limits == (-np.inf, np.inf)
        usable = any(names.label(placed.mesh, placed.link).is_handle for placed in body.meshes)
        found.append(
            MovingLink(
                body.name,
                "prismatic" if body.joint.kind == "prismatic" else "revolute",
                usable and not (endless and category == "cabinet"),
            )
        )
    return tuple(found)
