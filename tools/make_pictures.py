"""Make the README's moving picture anew: `python tools/make_pictures.py`. It is small: pages should load fast."""

import tempfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageSequence

from artiskill.evaluation.plan import make_plan
from artiskill.evaluation.recording import record_video
from artiskill.evaluation.video import write_video

OBJECTS = ("cabinet-0003", "cabinet-0005", "cabinet-0015")
WIDTH, HEIGHT = 448, 336
EVERY, FRAMES_PER_S = 2, 5
OUT = Path(__file__).resolve().parents[1] / "docs" / "images" / "drawers.gif"


def main() -> None:
    """Record the expert on three test cabinets and shrink the film."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "episodes.webp"
        record_video(make_plan("OpenCabinetDrawer", "expert", list(OBJECTS), episodes=1), path, count=len(OBJECTS))
        with Image.open(path) as film:
            frames = [
                np.asarray(frame.convert("RGB").resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS))
                for i, frame in enumerate(ImageSequence.Iterator(film))
                if i % EVERY == 0
            ]
    write_video(OUT, frames, FRAMES_PER_S)
    print(f"{OUT}: {len(frames)} frames, {OUT.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
