"""One short digest of nested values, so that a changed generator is noticed."""

import hashlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


def content_hash(*values: Any) -> str:
    """Hex digest, 16 characters, of values made of dataclasses, mappings, sequences, arrays and plain values.

    Floats are rounded to nine digits (a nanometre, a nanoradian), as the last bits of sines differ between C
    libraries. At the edge of a rounding that does not help: processors must give the same bits (`arrays`).
    """
    digest = hashlib.sha256()
    for value in values:
        _feed(digest, value)
    return digest.hexdigest()[:16]


def _feed(digest: Any, value: Any) -> None:
    """Feed any nested value of this module's types into a hash, each piece with its length, so that none merge."""
    if isinstance(value, np.ndarray):
        _feed_bytes(digest, f"{value.dtype}{value.shape}".encode())
        stable = np.round(value, 9) + 0.0 if value.dtype.kind == "f" else value  # + 0.0: no negative zeros
        _feed_bytes(digest, np.ascontiguousarray(stable).tobytes())
    elif is_dataclass(value):
        for f in fields(value):
            _feed_bytes(digest, f.name.encode())
            _feed(digest, getattr(value, f.name))
    elif isinstance(value, Mapping):
        _feed_bytes(digest, f"mapping of {len(value)}".encode())
        for key in sorted(value):
            _feed_bytes(digest, repr(key).encode())
            _feed(digest, value[key])
    elif isinstance(value, tuple | list):
        _feed_bytes(digest, f"sequence of {len(value)}".encode())
        for item in value:
            _feed(digest, item)
    elif isinstance(value, float):
        _feed_bytes(digest, repr(round(float(value), 9) + 0.0).encode())
    else:
        _feed_bytes(digest, repr(value).encode())


def _feed_bytes(digest: Any, data: bytes) -> None:
    digest.update(b"%d:" % len(data))
    digest.update(data)
