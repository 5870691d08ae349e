"""`Images`: what cameras saw, by channel, and the arrays that hold it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from artiskill.errors import StateError, UnknownNameError, check_name
from artiskill.sensors.resolve import Channels

CHANNELS = ("rgb", "depth", "position_w", "geom", "body", "part")
_NUMBERS = {"rgb": (np.uint8, 3), "depth": (np.float32, 0), "position_w": (np.float32, 3)}


@dataclass(frozen=True, eq=False)
class Images:
    """What C cameras saw; only the channels that were asked for are there.

    From `Renderer.render_batch` all have a leading dimension B, the environment.
    """

    _channels: dict[str, np.ndarray] = field(default_factory=dict)

    def __getitem__(self, channel: str) -> np.ndarray:
        """A channel by its name.

        Raises:
            UnknownNameError: it was not rendered.
        """
        if channel not in self._channels:
            raise UnknownNameError("image channel", channel, self._channels, "Ask for it when rendering.")
        return self._channels[channel]

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels that are there."""
        return tuple(self._channels)

    @property
    def rgb(self) -> np.ndarray:
        """(C, H, W, 3) uint8 sRGB."""
        return self["rgb"]

    @property
    def depth(self) -> np.ndarray:
        """(C, H, W) float32 metres along the optical axis, 0 where nothing is."""
        return self["depth"]

    @property
    def position_w(self) -> np.ndarray:
        """(C, H, W, 3) float32 world positions, 0 where nothing is."""
        return self["position_w"]

    @property
    def geom(self) -> np.ndarray:
        """(C, H, W) int32 index of the visual; `backdrop.NOTHING` (-1) or `FLOOR` (-2) where there is none."""
        return self["geom"]

    @property
    def body(self) -> np.ndarray:
        """(C, H, W) int32 index of the body; -1 where nothing is, -2 for the floor and all that never moves."""
        return self["body"]

    @property
    def part(self) -> np.ndarray:
        """(C, H, W) int32 index into `Renderer.part_names`; -1 where nothing is, -2 for the floor."""
        return self["part"]


def check_channels(channels: Sequence[str]) -> None:
    """Raise `UnknownNameError` for the first that is none of `CHANNELS`."""
    for channel in channels:
        check_name("image channel", channel, CHANNELS)


def allocate_images(channels: Sequence[str], shape: tuple[int, ...], out: Images | None) -> Images:
    """Arrays for the channels, new ones or those of an earlier result.

    Args:
        channels: any of `CHANNELS`.
        shape: (..., C, H, W).
        out: what to write into, or None.

    Raises:
        StateError: an array of `out` has the wrong shape or is not contiguous.
    """
    arrays = {}
    for name in CHANNELS:
        if name not in channels:
            continue
        kind, numbers = _NUMBERS.get(name, (np.int32, 0))
        size = (*shape, numbers) if numbers else shape
        if out is None:
            arrays[name] = np.empty(size, dtype=kind)
            continue
        arrays[name] = array = out[name]
        if array.shape != size or array.dtype != kind or not array.flags.c_contiguous:
            raise StateError(
                f"out[{name!r}] must be a contiguous {np.dtype(kind).name} array of shape {size}, "
                f"not {array.dtype.name} of shape {array.shape}"
            )
    return Images(arrays)


def as_kernel_channels(images: Images, leave_out: Sequence[str] = ()) -> Channels:
    """The same arrays with one leading dimension for all views, empty where there is no such channel."""
    arrays = []
    for name in CHANNELS:
        kind, numbers = _NUMBERS.get(name, (np.int32, 0))
        tail = (numbers,) if numbers else ()
        if name in images.channels and name not in leave_out:
            array = images[name]
            arrays.append(array.reshape(-1, *array.shape[array.ndim - len(tail) - 2 :]))
        else:
            arrays.append(np.empty((0, 0, 0, *tail), dtype=kind))
    return Channels(*arrays)
