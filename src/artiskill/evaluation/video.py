"""Frames to moving pictures (GIF, WebP, MP4), with captions."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from artiskill.errors import ConfigError, MissingExtraError, shown
from artiskill.files import atomic_write, output_path

# one colour stays free for GIF's "as in the frame before"
_GIF_COLOURS = 255
_PALETTE_FRAMES = 12
_PALETTE_PIXELS = 40_000
# colours per channel between which a GIF's colours are looked up: 6 bits, finer than the palette itself
_LOOKUP_BITS = 6
_GRAIN_LEVELS = 6  # of 255
_CAPTION_SHARE = 0.042  # height of the letters, of the picture's
_CAPTION_MIN_PX = 11


def write_video(path: Path | str, frames: Sequence[np.ndarray], frames_per_second: float) -> Path:
    """Write a moving picture; its format follows from the suffix.

    The file appears at once and whole, under a temporary name until then. GIF frames last whole hundredths of a
    second, so that other rates are met on average only.

    Args:
        path: ends in .gif, .webp or .mp4; missing folders are made.
        frames: at least one, each (H, W, 3) uint8, all of one size.
        frames_per_second: positive; at most 50 for GIF, which browsers slow down beyond.

    Returns:
        The path.

    Raises:
        ConfigError: another suffix, no frames, frames of the wrong shape or type, or an impossible rate.
        MissingExtraError: MP4 without the extra `video`.
    """
    path = output_path(path)
    writers: dict[str, Callable[[Path, np.ndarray, float], None]] = {
        ".gif": _write_gif,
        ".webp": _write_webp,
        ".mp4": _write_mp4,
    }
    suffix = path.suffix.lower()
    if suffix not in writers:
        raise ConfigError(f"a video's name must end in {', '.join(writers)}, not {shown(path.name)}")
    most = 50.0 if suffix == ".gif" else 1000.0
    if not 0 < frames_per_second <= most:
        raise ConfigError(
            f"frames_per_second must lie in (0, {most:g}] for {suffix}, not {shown(frames_per_second)}"
        )
    stacked = _checked(frames)
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(path) as temporary:
        writers[suffix](temporary, stacked, float(frames_per_second))
    return path


def caption(frame: np.ndarray, text: str) -> np.ndarray:
    """Return a copy of a frame (H, W, 3) uint8 with a line of text on a dark band at its lower edge.

    Text too wide for the picture is set smaller, down to a legible size, and then cut.
    """
    image = Image.fromarray(frame)
    size, margin = _caption_size(frame.shape[0])
    room = frame.shape[1] - 2 * margin
    font = ImageFont.load_default(size)
    while font.getlength(text) > room and size > _CAPTION_MIN_PX:
        size -= 1
        font = ImageFont.load_default(size)
    if font.getlength(text) > room:
        while text and font.getlength(text + "…") > room:
            text = text[:-1]
        text += "…"
    top = frame.shape[0] - size - 2 * margin
    band = Image.new("RGB", (frame.shape[1], frame.shape[0] - max(top, 0)), (24, 26, 30))
    under = image.crop((0, max(top, 0), frame.shape[1], frame.shape[0]))
    image.paste(Image.blend(under, band, 0.72), (0, max(top, 0)))
    place = margin, frame.shape[0] - margin - size // 2
    ImageDraw.Draw(image).text(place, text, font=font, fill=(245, 245, 242), anchor="lm")
    return np.asarray(image)


def caption_share(height: int) -> float:
    """Return the share of a picture's height, in pixels, that its caption takes up: half of it at most."""
    size, margin = _caption_size(height)
    return min((size + 2 * margin) / height, 0.5)


def _caption_size(height: int) -> tuple[int, int]:
    """Return the height of letters, before they may have to be smaller, and the margin above and below, pixels."""
    size = max(_CAPTION_MIN_PX, round(_CAPTION_SHARE * height))
    return size, size // 2


def _checked(frames: Sequence[np.ndarray]) -> np.ndarray:
    """Return all frames as one array (T, H, W, 3) uint8."""
    if len(frames) == 0:
        raise ConfigError("a video needs at least one frame, not none")
    first = np.asarray(frames[0]).shape
    for i, frame in enumerate(frames):
        frame = np.asarray(frame)
        legal = frame.ndim == 3 and frame.shape[2] == 3 and frame.size > 0 and frame.dtype == np.uint8
        if not legal or frame.shape != first:
            raise ConfigError(
                f"frames must all be (H, W, 3) uint8 of one size; frame 0 is {first}, "
                f"frame {i} is {frame.shape} {frame.dtype}"
            )
    return np.stack([np.asarray(frame) for frame in frames])


def _write_gif(path: Path, frames: np.ndarray, frames_per_second: float) -> None:
    """Write a GIF: one palette for all frames and the same dither in each, so that still parts stay still."""
    palette = _shared_palette(frames)
    table = _nearest_colours(palette)
    shift = 8 - _LOOKUP_BITS
    images = []
    grain = _grain(frames.shape[1], frames.shape[2])
    for frame in frames:
        grainy = np.clip(frame + grain, 0, 255).astype(np.uint8)
        r, g, b = (grainy[..., k] >> shift for k in range(3))
        image = Image.fromarray(table[r, g, b])
        image.putpalette(palette.astype(np.uint8).tobytes())
        images.append(image)
    ends = [math.floor(100.0 * (i + 1) / frames_per_second + 0.5) for i in range(len(images))]
    durations = [10 * (end - start) for start, end in zip([0, *ends[:-1]], ends, strict=True)]
    images[0].save(
        path, format="GIF", save_all=True, append_images=images[1:], duration=durations, loop=0, optimize=False
    )


def _grain(height: int, width: int) -> np.ndarray:
    """Return ordered dither, (H, W, 1): the 4 x 4 Bayer matrix, a palette's step from least to most."""
    two = np.array([[0, 2], [3, 1]])
    four = np.block([[4 * two + two[0, 0], 4 * two + two[0, 1]], [4 * two + two[1, 0], 4 * two + two[1, 1]]])
    tile = ((four + 0.5) / 16 - 0.5) * _GRAIN_LEVELS
    return np.tile(tile, (height // 4 + 1, width // 4 + 1))[:height, :width, None].round().astype(np.int16)


def _shared_palette(frames: np.ndarray) -> np.ndarray:
    """Return (C, 3) colours that serve all frames, by median cut over samples of some of them."""
    chosen = np.unique(np.linspace(0, len(frames) - 1, _PALETTE_FRAMES).round().astype(int))
    pixels = frames[chosen].reshape(-1, 3)
    stride = max(1, len(pixels) // _PALETTE_PIXELS)
    sample = Image.fromarray(np.ascontiguousarray(pixels[None, ::stride]))
    quantised = sample.quantize(_GIF_COLOURS, method=Image.Quantize.MEDIANCUT, kmeans=2)
    flat = quantised.getpalette() or []
    return np.array(flat, dtype=np.int32).reshape(-1, 3)[:_GIF_COLOURS]


def _nearest_colours(palette: np.ndarray) -> np.ndarray:
    """Return the index of the palette's nearest colour for each cell of a coarse colour cube, (n, n, n) uint8."""
    from scipy.spatial import cKDTree  # slow, and of use for GIFs alone

    n = 1 << _LOOKUP_BITS
    centres = (np.arange(n) * 256 + 128) // n
    cube = np.stack(np.meshgrid(centres, centres, centres, indexing="ij"), axis=-1).reshape(-1, 3)
    _, nearest = cKDTree(palette).query(cube)
    return nearest.astype(np.uint8).reshape(n, n, n)


def _write_webp(path: Path, frames: np.ndarray, frames_per_second: float) -> None:
    images = [Image.fromarray(frame) for frame in frames]
    milliseconds = max(1, round(1000.0 / frames_per_second))
    images[0].save(
        path, format="WEBP", save_all=True, append_images=images[1:], duration=milliseconds, loop=0, quality=82
    )


def _write_mp4(path: Path, frames: np.ndarray, frames_per_second: float) -> None:
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise MissingExtraError("writing MP4", "video") from error
    # H.264 with shared colour samples needs even sides: repeat the last row or column
    padded = np.pad(frames, ((0, 0), (0, frames.shape[1] % 2), (0, frames.shape[2] % 2), (0, 0)), mode="edge")
    writer = imageio_ffmpeg.write_frames(
        str(path),
        (padded.shape[2], padded.shape[1]),
        fps=frames_per_second,
        codec="libx264",
        pix_fmt_out="yuv420p",
        macro_block_size=1,
        output_params=["-crf", "20", "-preset", "medium", "-movflags", "+faststart"],
        ffmpeg_log_level="error",
    )
    try:
        writer.send(None)
        for frame in padded:
            writer.send(np.ascontiguousarray(frame))
    finally:
        writer.close()
