"""Faces that no one can see: the data set lists most faces twice, once for each side."""

from collections.abc import Sequence

import numpy as np


def needed_faces(points: np.ndarray, sections: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Which faces are needed so that every side looks as it should.

    Of two faces with the same corners and one material, one is enough. Of the two sides of a closed surface that
    have each a material of their own, the inner one is never seen.

    Args:
        points: (P, 3).
        sections: for each material its faces, (F, 3) point numbers.

    Returns:
        For each material (F,) bool.
    """
    keep = [_first_of_each(faces) for faces in sections]
    if len(sections) == 2:
        pair = [faces[kept] for faces, kept in zip(sections, keep, strict=True)]
        inner = _inner_side(points, *pair)
        if inner is not None:
            keep[inner] = np.zeros_like(keep[inner])
    return keep


def _first_of_each(faces: np.ndarray) -> np.ndarray:
    """(F,) bool: the first of those with the same three corners, whichever way round."""
    _, first = np.unique(_corner_sets(faces), return_index=True)
    kept = np.zeros(len(faces), dtype=bool)
    kept[first] = True
    return kept


def _inner_side(points: np.ndarray, front: np.ndarray, back: np.ndarray) -> int | None:
    """0 or 1: which of two back-to-back skins is the inside of a closed surface; None where they are not that."""
    if len(front) != len(back) or not np.array_equal(np.sort(_corner_sets(front)), np.sort(_corner_sets(back))):
        return None
    if not (_is_closed(front) and _is_closed(back)):
        return None
    corners = points[front] - points[front].mean(axis=(0, 1))
    volume = np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return 1 if volume > 0 else 0


def _is_closed(faces: np.ndarray) -> bool:
    """Whether every edge is run along once in each direction."""
    count = int(faces.max()) + 1
    ends = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])
    forward, backward = ends[:, 0] * count + ends[:, 1], ends[:, 1] * count + ends[:, 0]
    return np.array_equal(np.sort(forward), np.sort(backward)) and len(np.unique(forward)) == len(forward)


def _corner_sets(faces: np.ndarray) -> np.ndarray:
    """One number per face that is the same for faces of the same three corners."""
    ordered = np.sort(faces.astype(np.int64), axis=1)
    if not len(ordered):
        return np.empty(0, dtype=np.int64)
    # point numbers are below 2^21 in any file that can be read in reasonable time
    return (ordered[:, 0] << 42) | (ordered[:, 1] << 21) | ordered[:, 2]
