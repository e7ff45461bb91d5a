"""Documentation, and what a report of a bug should tell."""

# No postponed annotations here: Blender reads them as properties.
import json
import platform
from pathlib import Path
from typing import ClassVar

import bpy

from frametwin import __version__

from . import session
from .computing import chosen_python
from .steps import Step

HERE = Path(__file__).resolve().parent
PAGE, REPORT = "FrameTwin Help", "FrameTwin Bug Report"


def links() -> dict[str, str]:
    """Addresses that the extension was built with: ``documentation``, ``issues``; none where it is not published."""
    file = HERE / "links.json"
    return json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}


def bug_report() -> str:
    """Versions, platform and what was told last: what whoever mends the bug has to know."""
    try:
        python = chosen_python().python
    except Exception as error:  # that there is none may be the bug
        python = str(error)
    lines = [
        f"FrameTwin {__version__}",
        f"Blender {bpy.app.version_string} ({bpy.app.build_platform.decode(errors='replace')})",
        f"Python {platform.python_version()}, {platform.platform()}",
        f"Fitter: {python}",
        f"Last message: {session.last_words or 'none'}",
        "",
        "What I did:",
        "What I expected:",
        "What happened:",
    ]
    return "\n".join(lines) + "\n"


def show_text(name: str, content: str) -> None:
    """Put a text into the file under a name, in the place of the one before."""
    text = bpy.data.texts.get(name) or bpy.data.texts.new(name)
    text.from_string(content)
    text.cursor_set(0)
    if bpy.context.window is None or bpy.app.background:
        return
    bpy.ops.wm.window_new()
    area = bpy.context.window_manager.windows[-1].screen.areas[0]
    area.type = "TEXT_EDITOR"
    area.spaces.active.text, area.spaces.active.show_word_wrap = text, True


class FRAMETWIN_OT_show_help(Step, bpy.types.Operator):
    """Open the documentation: on the web where it is published, else the page that came with the extension"""

    bl_idname = "frametwin.show_help"
    bl_label = "FrameTwin: Documentation"
    bl_options: ClassVar = {"REGISTER"}

    def act(self, context: bpy.types.Context) -> str:
        address, page = links().get("documentation"), HERE / "blender.md"
        if address:
            bpy.ops.wm.url_open(url=address)
            return address
        show_text(PAGE, page.read_text(encoding="utf-8") if page.is_file() else "See docs/blender.md.\n")
        return f'The documentation is the text "{PAGE}"'


class FRAMETWIN_OT_report_bug(Step, bpy.types.Operator):
    """Gather versions and the last message for a report of a bug, copied to the clipboard; where bugs are reported"""

    bl_idname = "frametwin.report_bug"
    bl_label = "FrameTwin: Report a Bug"
    bl_options: ClassVar = {"REGISTER"}

    def act(self, context: bpy.types.Context) -> str:
        words, address = bug_report(), links().get("issues")
        context.window_manager.clipboard = words
        show_text(REPORT, words)
        if address:
            bpy.ops.wm.url_open(url=address)
        return f'Copied; it is also the text "{REPORT}"'


CLASSES = (FRAMETWIN_OT_show_help, FRAMETWIN_OT_report_bug)
