"""Pictures of one object from closed to open, side by side in one image file: columns are steps, rows views."""

import hashlib
import json
from dataclasses import asdict
from pathlib import Path

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.files import atomic_write
from artiskill.gallery.config import GalleryConfig
from artiskill.sensors.pictures.objects import ObjectView
from artiskill.sensors.render_config import load_render_config

_EFFORT = 5  # of WebP's encoder, 0 to 6


def draw_frames(obj: ArticulatedObject, config: GalleryConfig) -> np.ndarray:
    """All pictures of an object, (views * height, steps * width, 3) uint8.

    All steps of a view are seen by one camera, which sees the object whole in each of them.
    """
    view = ObjectView(obj, load_render_config(overrides=config.look))
    shares = joint_shares(obj, config)
    rows = []
    for place in config.views[obj.category]:
        camera = view.camera(list(shares), config.width, config.height, place.azimuth_deg, place.elevation_deg)
        rows.append(np.concatenate([view.draw(share, camera) for share in shares], axis=1))
    return np.concatenate(rows, axis=0)


def joint_shares(obj: ArticulatedObject, config: GalleryConfig) -> np.ndarray:
    """Share of each joint's range at each step, (steps, J): from 0 to 1, to less for joints without end."""
    reach = [1.0 if np.isfinite(joint.limits).all() else config.endless_turn for joint in obj.joints]
    return np.outer(np.linspace(0.0, 1.0, config.steps), reach)


def frames_name(obj: ArticulatedObject, config: GalleryConfig) -> str:
    """The file's name: another one where the object or what its pictures depend on is another."""
    settings = asdict(config) | {"sheet": None, "render": asdict(load_render_config(overrides=config.look))}
    text = json.dumps([obj.content_hash, settings], sort_keys=True, default=dict)
    return f"{obj.id}.{hashlib.sha256(text.encode()).hexdigest()[:10]}.webp"


def write_frames(frames: np.ndarray, path: Path, config: GalleryConfig) -> None:
    """Write the image; it appears whole or not at all."""
    from PIL import Image

    with atomic_write(path) as temporary:
        Image.fromarray(frames).save(temporary, format="WEBP", quality=config.webp_quality, method=_EFFORT)


def read_frame(path: Path, step: int, view: int, config: GalleryConfig) -> np.ndarray:
    """One of the pictures in a file, (height, width, 3) uint8; a negative step counts from the end."""
    from PIL import Image

    column = step % config.steps
    with Image.open(path) as image:
        pixels = np.asarray(image.convert("RGB"))
    rows = slice(view * config.height, (view + 1) * config.height)
    return pixels[rows, column * config.width : (column + 1) * config.width]
