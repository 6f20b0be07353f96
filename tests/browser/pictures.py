"""Takes the pictures of the guide from the screenshots of tests: python pictures.py SHOTS docs/pictures."""

import sys
from pathlib import Path

from PIL import Image

CHOSEN = (
    "checked-desk-light",
    "operator-asked-desk-light",
    "face-asks-tablet-light",
    "face-moves-tablet-light",
)
WIDEST, TALLEST, COLOURS = 1200, 900, 256
"""Pixels of a picture; those of a tablet are half as wide and not cut off."""


def main() -> None:
    """Shrink those that are chosen, so that they are quickly loaded."""
    shots, pictures = map(Path, sys.argv[1:])
    pictures.mkdir(exist_ok=True)
    for name in CHOSEN:
        shot = Image.open(shots / f"{name}.png").convert("RGB")
        shot.thumbnail(
            (WIDEST if shot.width > WIDEST else WIDEST // 2, 10 * TALLEST), Image.Resampling.LANCZOS
        )
        shot = shot.crop((0, 0, shot.width, min(shot.height, TALLEST)))
        shot.quantize(COLOURS, dither=Image.Dither.NONE).save(pictures / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()
