"""What `window_test.py` does inside of Blender: each step works by keys and clicks, and looks at what has become of it.

Run by Blender itself, with its window: blender --python window_steps.py -- OUT SCRATCH
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import bpy
import numpy as np

OUT, SCRATCH = (Path(word) for word in sys.argv[sys.argv.index("--") + 1 :][:2])
MODULE = "bl_ext.user_default.frametwin"
BLINK = 0.3
"""Seconds in which Blender draws and takes over a key, with its software renderer."""

F3 = "69"
"""As a number: by its name, xdotool also presses what would change to another console."""

FIRST_FILE = 60
"""Pixels from the top of a file browser to the middle of its first file."""

Waits = Iterator[float]
found: list[dict[str, str]] = []
picture: dict[str, np.ndarray] = {}


# --- The window


def areas(kind: str) -> list[bpy.types.Area]:
    return [area for area in bpy.context.window_manager.windows[0].screen.areas if area.type == kind]


def view() -> bpy.types.Area:
    """The 3D view."""
    return max(areas("VIEW_3D"), key=lambda area: area.width * area.height)


def region_of(area: bpy.types.Area, kind: str = "WINDOW") -> bpy.types.Region:
    return next(region for region in area.regions if region.type == kind)


def settings() -> Any:
    return bpy.context.window_manager.windows[0].scene.frametwin


def addon(name: str) -> Any:
    return sys.modules[f"{MODULE}.{name}"]


def xdotool(*words: object) -> None:
    subprocess.run(["xdotool", *map(str, words)], check=True)


def to_screen(region: bpy.types.Region, across: float, up: float) -> tuple[int, int]:
    """Pixels of the screen of a place in a region, from its lower left corner: the screen counts from the top."""
    height = bpy.context.window_manager.windows[0].height
    return round(region.x + across), round(height - region.y - up)


def point_at(region: bpy.types.Region, across: float, up: float) -> Waits:
    x, y = to_screen(region, across, up)
    xdotool("mousemove", x - 4, y)
    yield BLINK / 2
    xdotool("mousemove", x, y)
    yield BLINK / 2


def press(key: str) -> Waits:
    xdotool("keydown", key)
    yield BLINK / 2
    xdotool("keyup", key)
    yield BLINK


def command(name: str) -> Waits:
    """Press F3 over the 3D view, type the name of a command, press Return."""
    region = region_of(view())
    yield from point_at(region, 0.4 * region.width, 0.5 * region.height)
    yield from press(F3)
    yield 2 * BLINK
    xdotool("type", "--delay", "15", name)
    yield 2 * BLINK
    yield from press("Return")
    yield BLINK


def drop(file: Path) -> Waits:
    """Drag a file with the mouse, out of a file browser into the 3D view."""
    (area,) = areas("PROPERTIES")
    area.ui_type = "FILES"
    yield 2 * BLINK
    area.spaces.active.show_region_toolbar = False
    params = area.spaces.active.params
    params.directory, params.filter_search, params.display_type = str(file.parent).encode(), file.name, "THUMBNAIL"
    area.tag_redraw()
    yield 3 * BLINK
    source, target = region_of(area), region_of(view())
    begin = to_screen(source, 60, source.height - FIRST_FILE)
    end = to_screen(target, 0.4 * target.width, 0.5 * target.height)
    yield from point_at(source, 60, source.height - FIRST_FILE)
    xdotool("mousedown", 1)
    yield BLINK
    for share in (0.05, 0.5, 0.9, 1.0):
        xdotool("mousemove", *(round(a + share * (b - a)) for a, b in zip(begin, end, strict=True)))
        yield BLINK
    xdotool("mouseup", 1)
    yield 3 * BLINK
    area.ui_type = "PROPERTIES"
    yield 2 * BLINK


def until(condition: Callable[[], Any], seconds: float = 40.0) -> Waits:
    while not condition():
        seconds -= 0.25
        assert seconds > 0.0, "waited too long"
        yield 0.25


def pixels(name: str) -> Waits:
    """Draw the 3D view and keep its picture (H, W, 4) under a name."""

    def read() -> None:
        import gpu

        _, _, width, height = gpu.state.viewport_get()
        buffer = gpu.state.active_framebuffer_get().read_color(0, 0, width, height, 4, 0, "UBYTE")
        buffer.dimensions = width * height * 4
        picture[name] = np.array(buffer, dtype=np.uint8).reshape(height, width, 4)

    handle = bpy.types.SpaceView3D.draw_handler_add(read, (), "WINDOW", "POST_PIXEL")
    view().tag_redraw()
    yield 2 * BLINK
    bpy.types.SpaceView3D.draw_handler_remove(handle, "WINDOW")


def differing(one: str, other: str) -> int:
    return int((np.abs(picture[one].astype(int) - picture[other]).max(axis=-1) > 4).sum())


# --- The steps


def every_command_by_f3() -> Waits:
    yield from command("nothing of this name")  # the first time, the search takes long to begin
    yield 1.0
    yield from press("Escape")
    yield from command("FrameTwin: Use Millimetres")
    assert abs(bpy.context.scene.unit_settings.scale_length - 0.001) < 1e-9
    yield from command("FrameTwin Add Frame Bridge")
    assert settings().plan is not None and settings().about_plan.struts == 76


def the_grid_is_seen() -> Waits:
    overlay = view().spaces.active.overlay
    assert abs(overlay.grid_scale_unit - 10.0) < 1e-3, overlay.grid_scale_unit
    yield from pixels("with")
    overlay.show_floor = False
    yield from pixels("without")
    overlay.show_floor = True
    assert differing("with", "without") > 2000, differing("with", "without")


def the_import_dialog() -> Waits:
    bpy.ops.wm.save_as_mainfile(filepath=str(SCRATCH / "saved.blend"))
    write_files()
    yield from command("FrameTwin: Import Frame")
    (browser,) = areas("FILE_BROWSER")
    params = browser.spaces.active.params
    assert params.filename == "" and Path(params.directory.decode()) == SCRATCH, (params.filename, params.directory)
    params.filename = "bowl.json"
    region = region_of(browser)
    yield from point_at(region, 0.5 * region.width, 0.3 * region.height)
    yield from press("Return")
    assert not areas("FILE_BROWSER") and settings().about_plan.struts == 156


def the_rig_is_dragged() -> Waits:
    yield from command("FrameTwin: Make Rig")
    bpy.ops.object.select_all(action="DESELECT")
    region = region_of(view())
    middle = 0.4 * region.width, 0.5 * region.height
    camera = min(settings().rig.objects, key=lambda obj: np.linalg.norm(np.subtract(pixel_at(obj), middle)))
    camera.select_set(True)
    bpy.context.view_layer.objects.active = camera
    bpy.ops.ed.undo_push(message="selected")
    yield 2 * BLINK
    begin = np.array(pixel_at(camera))
    away = np.subtract(pixel_at(camera, 0.2), begin)
    away /= np.linalg.norm(away)
    before, place = settings().cameras.distance, camera.matrix_world.translation.copy()
    scale = bpy.context.preferences.system.ui_scale
    head = 60.0 * scale  # of the arrow, whose size Blender keeps
    yield from point_at(region, *(begin + head * away))
    xdotool("mousedown", 1)
    yield BLINK
    for step in range(1, 6):
        xdotool("mousemove", *to_screen(region, *(begin + (head + 12.0 * step) * away)))
        yield BLINK
    xdotool("mouseup", 1)
    yield 2 * BLINK
    assert settings().cameras.distance > before + 0.02, settings().cameras.distance
    assert (camera.matrix_world.translation - place).length > 5.0
    shot("dragged")
    yield from point_at(region, *middle)
    yield from press("ctrl+z")
    assert settings().cameras.distance == before
    yield BLINK


def pixel_at(obj: bpy.types.Object, back: float = 0.0) -> tuple[float, float]:
    """Where a camera is in the 3D view, or what lies behind it by a share of its distance from the origin."""
    from bpy_extras.view3d_utils import location_3d_to_region_2d

    place = obj.matrix_world.translation
    behind = place + back * place.length * obj.matrix_world.to_3x3().col[2]
    x, y = location_3d_to_region_2d(region_of(view()), view().spaces.active.region_3d, behind)
    return float(x), float(y)


def escape_cancels() -> Waits:
    settings().render.folder = str(SCRATCH / "work")
    settings().cameras.count, settings().cameras.width, settings().cameras.height = 4, 400, 300
    yield from command("FrameTwin: Make Rig")
    settings().render.style, settings().render.samples = "photo", 4000
    yield from command("FrameTwin: Render Capture")
    runner = addon("session").runner
    yield from until(lambda: runner.busy and runner.status.stage == "rendering")
    shot("status")
    yield from press("Escape")
    yield from until(lambda: not runner.busy)
    assert runner.status.cancelled and runner.status.message == "Cancelled", runner.status
    settings().render.style = "mask"
    yield from command("FrameTwin: Render Capture")
    yield from until(lambda: not runner.busy)
    assert settings().fit.capture and not runner.status.error, runner.status.message


def side_by_side() -> Waits:
    yield from command("FrameTwin: Picture Side by Side")
    (editor,) = areas("IMAGE_EDITOR")
    first = bpy.context.scene.camera.name
    assert Path(editor.spaces.active.image.filepath).stem == first
    yield from command("FrameTwin: Next Camera")
    second = bpy.context.scene.camera.name
    assert second != first and Path(editor.spaces.active.image.filepath).stem == second
    shot("beside")
    yield from command("FrameTwin: Picture Side by Side")
    assert not areas("IMAGE_EDITOR")


def files_are_dropped() -> Waits:
    yield from drop(SCRATCH / "frames" / "bridge.json")
    assert settings().about_plan.struts == 76, settings().plan.name
    capture, settings().fit.capture = Path(settings().fit.capture), ""
    yield from drop(capture / "transforms.json")
    assert Path(settings().fit.capture) == capture, settings().fit.capture
    yield from drop(SCRATCH / "run" / "twin.json")
    assert settings().twin is not None
    shot("dropped")


def the_legend_is_seen() -> Waits:
    yield from pixels("with")
    settings().view.legend = False
    yield from pixels("without")
    settings().view.legend = True
    assert differing("with", "without") > 1000, differing("with", "without")
    settings().view.histogram = False
    yield from pixels("without")
    settings().view.histogram = True
    assert differing("with", "without") > 300, differing("with", "without")


def two_twins_are_compared() -> Waits:
    first = settings().twin
    yield from drop(SCRATCH / "run-2" / "twin.json")
    assert settings().twin not in (None, first)
    settings().view.other = first
    yield from pixels("displaced")
    yield from command("FrameTwin: Compare Twins")
    yield from until(lambda: settings().view.quantity == "difference")
    yield from pixels("compared")
    assert differing("displaced", "compared") > 1000, differing("displaced", "compared")
    shot("compared")
    settings().view.quantity = "displacement"
    settings().twin = first


def the_inspect_workspace() -> Waits:
    yield from command("FrameTwin: Inspect")
    window = bpy.context.window_manager.windows[0]
    yield from until(lambda: window.workspace.name == "Inspect" and len(areas("IMAGE_EDITOR")) == 1)
    yield 3 * BLINK
    (editor,) = areas("IMAGE_EDITOR")
    assert Path(editor.spaces.active.image.filepath).stem == bpy.context.scene.camera.name
    yield from command("FrameTwin: Pick Strut")
    region, strut = region_of(view()), 40
    yield from point_at(region, *pixel_of(strut, region))
    xdotool("mousedown", 1)
    yield BLINK
    xdotool("mouseup", 1)
    yield 3 * BLINK
    picked = bpy.context.window_manager.frametwin_inspect.at
    near = np.linalg.norm(np.subtract(pixel_of(picked, region), pixel_of(strut, region)))
    assert picked == strut or near < 60.0, (picked, strut, near)
    shot("inspect")
    window.workspace = bpy.data.workspaces["Layout"]
    yield 3 * BLINK


def pixel_of(strut: int, region: bpy.types.Region) -> tuple[float, float]:
    """Where the middle of a strut of the twin is in a 3D view."""
    from bpy_extras.view3d_utils import location_3d_to_region_2d

    from frametwin.twin.runs import load_run

    control = load_run(Path(settings().twin["frametwin_run"]))[0].control_points[strut]
    x, y = location_3d_to_region_2d(region, view().spaces.active.region_3d, control.mean(axis=0).tolist())
    return float(x), float(y)


def hidden_things_come_back() -> Waits:
    plan = settings().plan
    assert not plan.visible_get()
    region = region_of(view())
    yield from point_at(region, 0.4 * region.width, 0.5 * region.height)
    yield from press("alt+h")
    assert plan.visible_get()


def photographs_are_led_to_the_fit() -> Waits:
    rig = write_rig_of(Path(settings().fit.capture))
    yield from command("FrameTwin: Import Rig")
    (browser,) = areas("FILE_BROWSER")
    params = browser.spaces.active.params
    params.directory, params.filename = str(rig).encode(), "rig.json"
    region = region_of(browser)
    yield from point_at(region, 0.5 * region.width, 0.3 * region.height)
    yield from press("Return")
    assert settings().rig.name == "workshop" and Path(settings().pictures.rig) == rig, settings().pictures.rig
    settings().pictures.folder = str(Path(settings().fit.capture) / "images")
    yield 2 * BLINK
    shot("photographs")
    if not addon("computing").has_python():
        return  # the zip without wheels, and no Python that is named: there is nothing to read pictures with
    before, runner = settings().fit.capture, addon("session").runner
    yield from command("FrameTwin: Capture from Pictures")
    yield from until(lambda: not runner.busy)
    assert settings().fit.capture != before and not runner.status.error, runner.status.message
    yield from command("FrameTwin: Show Masks")
    yield from until(lambda: not runner.busy)
    assert settings().cameras.overlay == "mask" and not runner.status.error, runner.status.message
    yield 2 * BLINK
    shot("masks")


def open_panels(*names: str) -> None:
    """Let panels of the tab be open, before they are drawn for the first time; they come last then."""
    for name in names:
        panel = getattr(addon(name), f"FRAMETWIN_PT_{name}")
        bpy.utils.unregister_class(panel)
        panel.bl_options = set()
        bpy.utils.register_class(panel)


def write_rig_of(capture: Path) -> Path:
    """A rig folder of the cameras of a capture, as if they had been calibrated."""
    from frametwin.blender.views.rigs import read_calibration
    from frametwin.cameras.rig_file import Rig, RigCamera, write_rig

    known = np.diag(np.square([*4 * [0.3], *5 * [1e-4], *3 * [1e-4], *3 * [0.05]]))
    cameras = [RigCamera.of(camera, known) for camera in read_calibration(capture)]
    folder = SCRATCH / "workshop"
    folder.mkdir()
    write_rig(folder, Rig(tuple(cameras), world="robot", date="2026-11-20T10:00:00"))
    return folder


STEPS = (
    every_command_by_f3,
    the_grid_is_seen,
    the_import_dialog,
    the_rig_is_dragged,
    escape_cancels,
    side_by_side,
    files_are_dropped,
    the_legend_is_seen,
    two_twins_are_compared,
    hidden_things_come_back,
    the_inspect_workspace,
    photographs_are_led_to_the_fit,
)


def write_files() -> None:
    """Frames and a run to be opened: a plan that was shifted by some millimetres."""
    from frametwin.formats import write_frame
    from frametwin.geometry.parametric import named_frame
    from frametwin.twin.twin import Twin, write_twin

    bowl = named_frame("half_bowl")
    write_frame(SCRATCH / "bowl.json", bowl)
    for folder in ("frames", "run"):
        (SCRATCH / folder).mkdir()
    write_frame(SCRATCH / "frames" / "bridge.json", named_frame("bridge"))
    write_frame(SCRATCH / "run" / "frame.json", bowl)
    opacity = np.ones((bowl.strut_count, 20))
    opacity[3] = 0.0
    twin = Twin(
        control_points=bowl.control_points + 2.0,
        vertices=bowl.vertices + 2.0,
        thickness=np.repeat(bowl.radius[:, None], 20, axis=1),
        opacity=opacity,
        completeness=opacity.mean(axis=1),
        confidence=np.ones(bowl.strut_count),
    )
    write_twin(SCRATCH / "run", twin)
    (SCRATCH / "run-2").mkdir()
    write_frame(SCRATCH / "run-2" / "frame.json", bowl)
    taller = [1.0, 1.0, 1.05]
    changed = twin.replace(control_points=twin.control_points * taller, vertices=twin.vertices * taller)
    write_twin(SCRATCH / "run-2", changed)


def shot(name: str) -> None:
    """A picture of the whole window, where ImageMagick is there to take it from the X server."""
    with suppress(FileNotFoundError):
        subprocess.run(["import", "-window", "root", str(OUT / f"{name}.png")], check=False, timeout=20)


def play() -> Waits:
    area = view()
    open_panels("photographs")
    area.spaces.active.show_region_ui = True
    yield 2 * BLINK
    region_of(area, "UI").active_panel_category = "FrameTwin"
    yield BLINK
    for step in STEPS:
        problem = ""
        try:
            yield from step()
        except Exception as error:
            problem = f"{type(error).__name__} {error} in line {traceback.extract_tb(error.__traceback__)[-1].lineno}"
            shot(f"failed_{step.__name__}")
        found.append({"step": step.__name__.replace("_", " "), "problem": problem})
    found.append({"step": "end", "problem": ""})


def finish() -> None:
    (SCRATCH / "found.json").write_text(json.dumps(found), encoding="utf-8")
    addon("session").end()
    os._exit(0)  # no question whether to save


playing = play()


def tick() -> float | None:
    try:
        return next(playing)
    except StopIteration:
        finish()
    except BaseException:
        traceback.print_exc()
        finish()
    return None


bpy.app.timers.register(tick, first_interval=1.0)
