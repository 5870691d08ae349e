"""What an HDF5 file may hold before anything in it is read: what we write, and nothing that leads elsewhere.

HDF5 follows links, raw data in other files and datasets that are views of others, wherever they lead: a
stranger's demonstration could have a private file read into a training file. And a file of 4 kB can declare an
array of 12 GB.
"""

import math
from typing import Any

MOST_ARRAY_BYTES = 1 << 28  # of an array of demonstrations; a long trajectory's states have 1 MB
MOST_FRAMES_BYTES = 1 << 34  # of an array of a training file; 200 frames of full clouds have 500 MB
# deflate's own limit: 258 bytes are told in two bits
_MOST_RATIO, _CHUNK_OVERHEAD = 1032, 64
_MOST_CHUNK_BYTES = 1 << 25
_MOST_ATTRIBUTES, _MOST_ATTRIBUTE_BYTES = 64, 1 << 20
_MOST_DEPTH = 8  # of groups; the deepest of ours are 3
_NUMBERS = "biuf"


def check_content(file: Any, most_bytes: int) -> None:
    """See whether an open file holds groups and arrays of numbers, all in itself, none larger than it can be.

    Args:
        file: an h5py file.
        most_bytes: of an array, unpacked.

    Raises:
        ValueError: it holds a link to elsewhere, another kind of thing, a filter that we do not use, or a size
            that its bytes on the disk cannot unpack to. Besides, whatever h5py raises of damaged files.
    """
    _Checker(most_bytes).check_group(file.id, "", 0)


class _Checker:
    """Walks a file's groups once; a group that is met twice would make it walk for ever."""

    def __init__(self, most_bytes: int) -> None:
        import h5py

        self._h5, self._most_bytes = h5py, most_bytes
        self._groups: set[int] = set()
        self._arrays: set[int] = set()

    def check_group(self, group: Any, path: str, depth: int) -> None:
        """A group's attributes, links and what they lead to."""
        h5 = self._h5
        address = h5.h5o.get_info(group).addr
        if address in self._groups or depth > _MOST_DEPTH:
            raise ValueError(f"group {path or '/'} is in itself, in two places, or nested too deeply")
        self._groups.add(address)
        self._check_attributes(group, path)
        links: list[tuple[bytes, int]] = []
        group.links.iterate(lambda name, info: links.append((name, info.type)), info=True)
        for raw, kind in links:
            name = f"{path}/{raw.decode('utf-8', 'replace')}"
            if kind != h5.h5l.TYPE_HARD:
                raise ValueError(f"{name} is a link to elsewhere, which is not followed")
            item = h5.h5o.open(group, raw)
            if isinstance(item, h5.h5g.GroupID):
                self.check_group(item, name, depth + 1)
            elif isinstance(item, h5.h5d.DatasetID):
                self._check_array(item, name)
            else:
                raise ValueError(f"{name} is neither a group nor an array")

    def _check_array(self, array: Any, name: str) -> None:
        address = self._h5.h5o.get_info(array).addr
        if address in self._arrays:  # another name of an array that is in order
            return
        self._arrays.add(address)
        self._check_attributes(array, name)
        if not _is_numbers(array.dtype):
            raise ValueError(f"{name} holds {array.dtype}, not numbers")
        made, h5d = array.get_create_plist(), self._h5.h5d
        layout = made.get_layout()
        if layout not in (h5d.COMPACT, h5d.CONTIGUOUS, h5d.CHUNKED) or made.get_external_count():
            raise ValueError(f"{name} has its values in another file or array, which is not followed")
        z = self._h5.h5z
        filters = [made.get_filter(i)[0] for i in range(made.get_nfilters())]
        if not set(filters) <= {z.FILTER_DEFLATE, z.FILTER_SHUFFLE} or len(filters) != len(set(filters)):
            raise ValueError(f"{name} has the filters {filters}; only gzip and shuffle are legal, each once")
        size = math.prod(array.shape) * array.dtype.itemsize
        if size > self._most_bytes:
            raise ValueError(f"{name} has {size} bytes, more than the {self._most_bytes} that are legal")
        stored = array.get_storage_size() if size else 0
        packed = z.FILTER_DEFLATE in filters
        if layout == h5d.CHUNKED and math.prod(made.get_chunk()) * array.dtype.itemsize > max(
            size, _MOST_CHUNK_BYTES
        ):
            raise ValueError(f"{name} has chunks of {made.get_chunk()}, larger than the array")
        if size > (stored * _MOST_RATIO + _CHUNK_OVERHEAD if packed else stored):
            raise ValueError(f"{name} declares {size} bytes, but has {stored} on the disk")

    def _check_attributes(self, item: Any, name: str) -> None:
        h5a = self._h5.h5a
        count = h5a.get_num_attrs(item)
        if count > _MOST_ATTRIBUTES:
            raise ValueError(f"{name or '/'} has {count} attributes; at most {_MOST_ATTRIBUTES} are legal")
        for i in range(count):
            attribute = h5a.open(item, index=i)
            kind = attribute.get_type()
            size = math.prod(attribute.shape) * kind.get_size()
            is_text = isinstance(kind, self._h5.h5t.TypeStringID)
            if size > _MOST_ATTRIBUTE_BYTES or not (is_text or _is_numbers(attribute.dtype)):
                raise ValueError(f"{name or '/'} has an attribute that is no text and no few numbers")


def _is_numbers(dtype: Any) -> bool:
    """Whether an array's elements are numbers, or rows of them."""
    if dtype.names is None:
        return dtype.kind in _NUMBERS
    return all(dtype[name].kind in _NUMBERS for name in dtype.names)
