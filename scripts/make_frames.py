"""Write the project's own frames, ``datasets/frames/*.json``, from ``frametwin.geometry.parametric``."""

from __future__ import annotations

import argparse
from pathlib import Path

from frametwin.formats import write_frame
from frametwin.geometry.parametric import FRAMES

FOLDER = Path(__file__).resolve().parent.parent / "datasets" / "frames"


def main() -> None:
    """Write every frame into the folder and say what it is."""
    parser = argparse.ArgumentParser(description="Write the project's own frames as frame files.")
    parser.add_argument("--out", type=Path, default=FOLDER, help="the folder (default: datasets/frames)")
    folder = parser.parse_args().out
    folder.mkdir(parents=True, exist_ok=True)
    for name, make in FRAMES.items():
        frame = make()
        write_frame(folder / f"{name}.json", frame)
        print(f"{name}.json: {frame.vertex_count} vertices, {frame.strut_count} struts")


if __name__ == "__main__":
    main()
