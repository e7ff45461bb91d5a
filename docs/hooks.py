"""What the build of the documentation does besides: it takes the pictures from where the README has them too."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parent.parent
PICTURES = ROOT / "addon" / "pictures"


def on_files(files: Files, config: Any) -> Files:
    """Add the pictures of the add-on, as if they lay in ``docs/pictures``."""
    for path in sorted(PICTURES.glob("*.png")):
        files.append(File.generated(config, f"pictures/{path.name}", abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Lead links to them there; as they are written they lead to the folder of the repository."""
    return markdown.replace("](../addon/pictures/", "](pictures/")
