"""Kinds of damage to the views, poses and pictures of a capture (data for the tests)."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from damaged_frames import KINDS, change, each_key, kind, value


def view(index: int, key: str, new: Any, name: str, field: str | None = None) -> None:
    """Register a damage of one field of one view."""
    value("transforms.json", "frames", (index, key), new, name, field or f"frames[{index}]")


# --- the views

each_key("transforms.json", {"frames": "frames"}, lambda data, key: data.pop(key), "missing")
value("transforms.json", "frames", (), {}, "frames_no_list")
value("transforms.json", "frames", (), [1, 2, 3], "frames_no_objects")
value("transforms.json", "frames", (), [], "no_views")
value("transforms.json", "camera_model", (), "EQUIRECTANGULAR", "panorama", "camera_model")
value("transforms.json", "version", (), "1", "version_text")
for _key in ("file_path", "transform_matrix", "fl_x", "fl_y", "cx", "cy", "w", "h"):

    def _without(folder: Path, key: str = _key) -> None:
        change(folder / "transforms.json", lambda data: data["frames"][1].pop(key))

    _without.__name__ = f"view_without_{_key}"
    kind("transforms.json", _key)(_without)
for _key in ("fl_x", "fl_y", "w", "h"):
    view(0, _key, 0, f"{_key}_zero", _key)
    view(0, _key, -800, f"{_key}_negative", _key)
for _key in ("fl_x", "cy", "w", "k1", "p2"):
    view(0, _key, "12", f"{_key}_text", "transforms.json: frames[0]")
    view(0, _key, float("nan"), f"{_key}_nan", "NaN")
view(0, "w", 160.5, "width_not_whole", "w")
view(0, "k1", -1e5, "distortion_absurd", "k1")
view(0, "k1", -12.0, "distortion_folds_the_picture", "k1")
view(0, "k4", 0.1, "coefficient_unknown", "k4")
view(1, "file_path", 7, "file_path_number", "frames[1].file_path")
view(1, "file_path", "", "file_path_empty", "frames[1].file_path")
view(1, "file_path", "images", "file_path_a_folder", "frames[1].file_path")
view(1, "file_path", "images/none.png", "image_missing", "frames[1].file_path")
view(1, "file_path", "../capture/images/camera_01.png", "path_leaves_the_folder", "frames[1].file_path")
view(1, "file_path", "images/../../x.png", "path_leaves_the_folder_later", "frames[1].file_path")
view(1, "file_path", "/pictures/a.png", "path_absolute", "frames[1].file_path")
view(1, "file_path", "C:/pictures/a.png", "path_absolute_windows", "frames[1].file_path")
view(1, "file_path", "images\\camera_01.png", "path_with_backslash", "frames[1].file_path")
view(1, "file_path", "images/camera\0.png", "path_with_a_zero_byte", "frames[1].file_path")
view(1, "file_path", "images/camera_00.png", "picture_twice", "frames[1].file_path")
view(1, "file_path", "./images//camera_00.png", "picture_twice_spelled_otherwise", "frames[1].file_path")
value("transforms.json", "frames", (1, "file_path"), "frame.json", "not_an_image", "not a PNG or JPEG")
KINDS["not_an_image"] = (KINDS["not_an_image"][0], "frame.json", "not a PNG or JPEG")


@kind("transforms.json", "frames")
def one_view(folder: Path) -> None:
    change(folder / "transforms.json", lambda data: data.update(frames=data["frames"][:1]))


@kind("transforms.json", "frames[1].file_path")
def image_link_out(folder: Path) -> None:
    os.rename(folder / "images" / "camera_01.png", folder.parent / "outside.png")
    os.symlink(folder.parent / "outside.png", folder / "images" / "camera_01.png")


@kind("transforms.json", "frames[0].file_path")
def folder_link_out(folder: Path) -> None:
    os.rename(folder / "images", folder.parent / "outside")
    os.symlink(folder.parent / "outside", folder / "images")


@kind("transforms.json", "frames[1].file_path")
def image_link_to_itself(folder: Path) -> None:
    (folder / "images" / "camera_01.png").unlink()
    os.symlink("camera_01.png", folder / "images" / "camera_01.png")


def pose(name: str, field: str = "frames[2].transform_matrix") -> Callable[[Callable[[np.ndarray], Any]], None]:
    """Register a damage of one pose, which may return a new matrix or change it in place."""

    def register(edit: Callable[[np.ndarray], Any]) -> None:
        def damage(folder: Path) -> None:
            def apply(data: dict[str, Any]) -> None:
                matrix = np.array(data["frames"][2]["transform_matrix"])
                result = edit(matrix)
                data["frames"][2]["transform_matrix"] = (matrix if result is None else np.asarray(result)).tolist()

            change(folder / "transforms.json", apply)

        damage.__name__ = name
        kind("transforms.json", field)(damage)

    return register


pose("pose_zero")(lambda matrix: matrix * [[0], [0], [0], [1]])
pose("pose_singular")(lambda matrix: np.column_stack([matrix[:, 1], matrix[:, 1:]]))
pose("pose_scaled")(lambda matrix: matrix * [[2], [2], [2], [1]])
pose("pose_sheared")(lambda matrix: matrix + 0.1 * np.eye(4, k=1) * [[1], [0], [0], [0]])
pose("pose_mirrored")(lambda matrix: matrix * [-1, 1, 1, 1])
pose("pose_three_rows")(lambda matrix: matrix[:3])
pose("pose_last_row")(lambda matrix: matrix + np.eye(4)[[1, 2, 0, 3]] * [[0], [0], [0], [1]])
pose("pose_transposed")(lambda matrix: matrix.T)
pose("pose_nan", "NaN")(lambda matrix: matrix * np.nan)
pose("pose_opencv_axes")(lambda matrix: matrix * [1, -1, -1, 1])  # looks the other way
pose("pose_in_metres")(lambda matrix: matrix * np.array([[1, 1, 1, 1e-3]] * 3 + [[1, 1, 1, 1]]))


@pose("camera_inside")
def _inside(matrix: np.ndarray) -> None:
    matrix[:3, 3] = 9.0, 11.0, 21.0


@pose("camera_at_a_strut")
def _at_a_strut(matrix: np.ndarray) -> None:
    matrix[:3, 3] = -0.5, 10.0, 20.0


@pose("frame_beside_the_picture")
def _beside(matrix: np.ndarray) -> None:
    matrix[:3, 3] += 500.0 * matrix[:3, 0]


# --- the pictures


@kind("camera_00.png", "image")
def image_cut_short(folder: Path) -> None:
    file = folder / "images" / "camera_00.png"
    file.write_bytes(file.read_bytes()[:-20])


@kind("camera_00.png", "image")
def image_cut_after_the_signature(folder: Path) -> None:
    file = folder / "images" / "camera_00.png"
    file.write_bytes(file.read_bytes()[:8])


@kind("camera_00.png", "image")
def image_of_no_bytes(folder: Path) -> None:
    (folder / "images" / "camera_00.png").write_bytes(b"")


@kind("camera_00.png", "image")
def image_with_a_flipped_bit(folder: Path) -> None:
    file = folder / "images" / "camera_00.png"
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 0x10
    file.write_bytes(data)


@kind("camera_00.png", "image")
def image_a_text(folder: Path) -> None:
    (folder / "images" / "camera_00.png").write_text("<html>404</html>")


@kind("camera_00.png", "image")
def jpeg_cut_short(folder: Path) -> None:
    file = folder / "images" / "camera_00.png"
    image = np.random.default_rng(0).integers(0, 255, (120, 160, 3), dtype=np.uint8)
    file.write_bytes(cv2.imencode(".jpg", image)[1].tobytes()[:-500])


def paint(name: str, field: str, image: np.ndarray, file: str = "images/camera_02.png") -> None:
    def damage(folder: Path) -> None:
        (folder / file).parent.mkdir(exist_ok=True)
        cv2.imwrite(str(folder / file), image)

    damage.__name__ = name
    kind("camera_02.png" if "camera_02" in file else "background", field)(damage)


_DOT = np.zeros((120, 160), dtype=np.uint8)
_DOT[50:60, 50:60] = 255
paint("image_of_another_size", "size", np.zeros((60, 80), dtype=np.uint8))
paint("image_on_its_side", "size", np.ascontiguousarray(_DOT.T))
paint("all_black", "all black", np.zeros((120, 160), dtype=np.uint8))
paint("all_white", "white all over", np.full((120, 160), 255, dtype=np.uint8))
paint("all_grey", "image", np.full((120, 160), 90, dtype=np.uint8))
paint("black_photo", "all black", np.full((120, 160, 3), (90, 20, 20), dtype=np.uint8))
paint("white_photo", "white all over", np.full((120, 160, 3), (250, 240, 245), dtype=np.uint8))
paint("mask_inverted", "white background", 255 - _DOT)
paint("background_of_one_view_only", "is missing", _DOT, "background/camera_00.png")


def _backgrounds(folder: Path, image: np.ndarray) -> None:
    (folder / "background").mkdir()
    for i in range(3):
        cv2.imwrite(str(folder / "background" / f"camera_0{i}.png"), image)


@kind("background/camera_00.png", "size")
def background_of_another_size(folder: Path) -> None:
    _backgrounds(folder, _DOT[:50])


@kind("background/camera_00.png", "cut short")
def background_cut_short(folder: Path) -> None:
    _backgrounds(folder, _DOT)
    file = folder / "background" / "camera_00.png"
    file.write_bytes(file.read_bytes()[:-20])


@kind("images/camera_00.png", "shows nothing")
def background_is_the_picture_itself(folder: Path) -> None:
    (folder / "background").mkdir()
    for file in (folder / "images").iterdir():
        (folder / "background" / file.name).write_bytes(file.read_bytes())


@kind("background", "link that leaves the folder")
def background_link_out(folder: Path) -> None:
    (folder.parent / "outside").mkdir()
    os.symlink(folder.parent / "outside", folder / "background")
