"""What a task needs of an object: a category and, where links are opened, one that moves so and has a handle."""

from collections.abc import Iterable
from dataclasses import dataclass

from artiskill.assets.articulated_object import ArticulatedObject, Category, JointKind
from artiskill.errors import AssetError, UnknownNameError

_WORDS: dict[JointKind, str] = {"prismatic": "drawer", "revolute": "door"}


@dataclass(frozen=True)
class MovingLink:
    """A link with a joint; `usable`: it carries a handle with which it can be opened."""

    name: str
    motion: JointKind
    usable: bool


@dataclass(frozen=True)
class Needs:
    """What a task needs of an object."""

    task: str  # its name, for messages
    category: Category  # of the objects
    motion: JointKind | None  # joint kind of the target links; None where the whole object is moved

    def check_category(self, name: str, category: str) -> None:
        """Refuse an object of another category.

        Raises:
            AssetError: it is one; the message says which.
        """
        if category != self.category:
            raise AssetError(f"object {name!r} is a {category}; {self.task} needs a {self.category}")

    def check_links(self, name: str, links: Iterable[MovingLink]) -> None:
        """Refuse an object without a target.

        Raises:
            AssetError: no link moves as needed and carries a handle; the message says what there is.
        """
        links = tuple(links)
        if self.motion is None or self._has_target(links):
            return
        found = ", ".join(
            f"{_WORDS[link.motion]} {link.name} ({'with a' if link.usable else 'no usable'} handle)"
            for link in links
        )
        raise AssetError(
            f"object {name!r} has no {_WORDS[self.motion]} with a handle, so {self.task} has no target; it has: "
            f"{found or 'no moving link'}. list_objects(task={self.task!r}) names objects that have one"
        )

    def check_object(self, obj: ArticulatedObject) -> None:
        """Refuse an object of another category or without a target.

        Raises:
            AssetError: it is one.
        """
        self.check_category(obj.id, obj.category)
        self.check_links(obj.id, _moving_links(obj))

    def suits(self, obj: ArticulatedObject) -> bool:
        """Return whether an object is of the task's category and has a target."""
        return obj.category == self.category and self._has_target(_moving_links(obj))

    def _has_target(self, links: Iterable[MovingLink]) -> bool:
        return self.motion is None or any(link.usable and link.motion == self.motion for link in links)


def _moving_links(obj: ArticulatedObject) -> list[MovingLink]:
    links = (obj.links[i] for i in obj.jointed_links)
    return [MovingLink(k.name, k.joint.kind, bool(obj.handles_of(k.name))) for k in links if k.joint is not None]


TASK_NEEDS: dict[str, Needs] = {}  # by task; filled as tasks are registered


def task_needs(task: str) -> Needs:
    """Return what a task needs; a versioned environment id such as `ArtiSkill/OpenCabinetDoor-v0` is legal too.

    Raises:
        UnknownNameError: no such task.
    """
    name = task.split("/")[-1].split("-v")[0] if isinstance(task, str) else None
    if name not in TASK_NEEDS:
        raise UnknownNameError("task", task, TASK_NEEDS)
    return TASK_NEEDS[name]
