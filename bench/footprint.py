"""Measures how much has to be downloaded for each extra, and how much disk space and time it takes.

For each extra that is named (by default all; `-` is the package without extras), the script downloads the
packages and installs them from there into an empty environment. It prints a table in Markdown.

    python bench/footprint.py dist/codebotler-0.1.0-py3-none-any.whl - inspect
"""

import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

EXTRAS = ("-", "inspect", "pyrobosim", "ray", "transformers")
MEGABYTE = 1_000_000


def size(folder: Path) -> int:
    """Return the number of bytes of all files below a folder."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file() and not path.is_symlink())


def pip(environment: Path, *arguments: str) -> None:
    """Run the pip of an environment quietly."""
    python = str(environment / "bin" / "python")
    subprocess.run([python, "-m", "pip", "--quiet", "--disable-pip-version-check", *arguments], check=True)


def row(wheel: Path, extra: str, work: Path) -> str:
    """Measure an extra, and return its row of the table."""
    wanted = str(wheel) if extra == "-" else f"{wheel}[{extra}]"
    environment, downloads = work / "environment", work / "downloads"
    venv.create(environment, with_pip=True)
    pip(environment, "download", "--dest", str(downloads), wanted)
    before = size(environment)
    began = time.monotonic()
    pip(environment, "install", "--no-index", "--find-links", str(downloads), wanted)
    took = time.monotonic() - began
    packages = len([*environment.glob("lib/*/site-packages/*.dist-info")])
    numbers = (size(downloads) / MEGABYTE, (size(environment) - before) / MEGABYTE)
    name = "`codebotler`" if extra == "-" else f"`codebotler[{extra}]`"
    return f"| {name} | {packages} | {numbers[0]:,.0f} MB | {numbers[1]:,.0f} MB | {took:.0f} s |"


def main() -> None:
    """Print the table row by row."""
    wheel, *extras = sys.argv[1:]
    print("| | packages | to download | on the disk | to install |\n|---|---|---|---|---|", flush=True)
    for extra in extras or EXTRAS:
        with tempfile.TemporaryDirectory() as work:
            print(row(Path(wheel).resolve(), extra, Path(work)), flush=True)


if __name__ == "__main__":
    main()
