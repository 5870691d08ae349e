"""Is an object the one that its name promises?"""

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import load_object
from artiskill.assets.entries import read_catalog
from artiskill.errors import AssetError


def checked_hash(item: str | ArticulatedObject) -> str:
    """The hash of an object's content; under an id of the catalogue it must be the catalogue's.

    Args:
        item: an element of `resolve_objects`' result.

    Raises:
        AssetError: it is another one.
    """
    found = load_object(item) if isinstance(item, str) else item
    given, listed = found.content_hash, read_catalog().get(found.id)
    if listed is not None and listed[1].content_hash != given:
        raise AssetError(
            f"object {found.id!r} has the content hash {given}, but the catalogue's has {listed[1].content_hash}: "
            "its numbers could not be compared with those of others; an object of one's own needs another id"
        )
    return given
