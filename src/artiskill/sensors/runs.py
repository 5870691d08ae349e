"""Kernels that find runs: neighbouring pixels of a row that show one face. What follows is done once per run."""

from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.lanes import LANES, equal_lanes

# what is known of a face in the present view, see `paint`
UNSEEN, SEEN = 0, 1


@kernel
def list_runs(triangle: Array, drawn: Array, face_state: Array, seen: Array, runs: Array, row_runs: Array) -> int:
    """List the runs of a view, row by row, and its faces, each once.

    Args:
        triangle: (H, W) buffer.
        drawn: (H, 2) where it has values; elsewhere is no face.
        face_state: (F,) uint8 all `UNSEEN`; `SEEN` written for the faces that are seen.
        seen: (F,) int32 written: the faces that are seen.
        runs: (H * W, 2) int32 written: number of the first pixel in the image, and how many, at most `LANES`.
        row_runs: (H + 1,) int32 written: the first run of each row, and how many there are.

    Returns:
        How many faces are seen.
    """
    count, faces = 0, 0
    height, width = triangle.shape
    for row in range(height):
        row_runs[row] = count
        column, end = drawn[row, 0], drawn[row, 1]
        while column < end:
            index = row * width + column
            t = triangle[row, column]
            length = min(equal_lanes(triangle, index), end - column) if index + LANES <= triangle.size else 1
            if t >= 0:
                runs[count, 0], runs[count, 1] = index, length
                count += 1
                if face_state[t] == UNSEEN:
                    face_state[t] = SEEN
                    seen[faces] = t
                    faces += 1
            column += length
    row_runs[height] = count
    return faces
