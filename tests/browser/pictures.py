"""Makes the pictures of the guide: python pictures.py SHOTS docs/pictures.

SHOTS holds the screenshots of tests, and in report/ a report of the programs that ship with the package.
"""

import sys
from pathlib import Path

from PIL import Image

CHOSEN = {
    "checked-desk-light": "checked-desk-light.png",
    "continue-desk-light": "continue-desk-light.png",
    "running-desk-light": "running-desk-light.png",
    "running-desk-dark": "running-desk-dark.png",
    "operator-asked-desk-light": "operator-asked-desk-light.png",
    "face-asks-tablet-light": "face-asks-tablet-light.png",
    "face-moves-tablet-light": "face-moves-tablet-light.png",
    "run-desk-light": "run-desk-light.png",
    "report-tasks": "report/figures/tasks.png",
    "report-causes": "report/figures/causes.png",
}
"""The source of each picture, in the folder of screenshots."""

WIDEST, TALLEST, COLOURS = 1200, 850, 128
"""Limits of a picture, in pixels and colours; narrow screenshots get half the width."""


def main() -> None:
    """Shrink the chosen screenshots, so that they load quickly."""
    shots, pictures = map(Path, sys.argv[1:])
    pictures.mkdir(exist_ok=True)
    for name, path in CHOSEN.items():
        shot = Image.open(shots / path).convert("RGB")
        shot.thumbnail(
            (WIDEST if shot.width > WIDEST else WIDEST // 2, 10 * TALLEST), Image.Resampling.LANCZOS
        )
        shot = shot.crop((0, 0, shot.width, min(shot.height, TALLEST)))
        few = shot.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=2, dither=Image.Dither.NONE)
        few.save(pictures / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()
