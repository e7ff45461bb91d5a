"""The exact truth of every curve in every view: against closed forms, a brute-force reference and the camera."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from frametwin.cameras import Camera, look_at
from frametwin.cameras.rigs import ring_rig
from frametwin.errors import InputError
from frametwin.formats import read_frame
from frametwin.geometry import bezier
from frametwin.geometry.parametric import named_frame
from frametwin.geometry.radii import radii_at
from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.deformations import smooth_warp
from frametwin.raster.silhouette import silhouettes
from frametwin.simulation.curve_truth import SAMPLES, CurveTruth, curve_truth, read_curves, write_curves

U = np.linspace(0.0, 1.0, SAMPLES)


def camera_at(centre: Any, target: Any = (0.0, 0.0, 0.0), **changes: Any) -> Camera:
    values = {"fl_x": 900.0, "fl_y": 950.0, "cx": 310.0, "cy": 250.0, **changes}
    return Camera("camera", 640, 480, camera_to_world=look_at(centre, target), **values)


def straight(*ends: Any, radius: Any = 1.0) -> Wireframe:
    """Struts from a to b, each with joints of its own."""
    vertices = np.array(ends, dtype=float).reshape(-1, 3)
    return Wireframe.create(vertices, np.arange(len(vertices)).reshape(-1, 2), radius=radius)


def seen(frame: Wireframe, camera: Camera, present: Any = None, thickness: Any = None) -> np.ndarray:
    """(E, S) bool."""
    whole = np.tile([0.0, 1.0], (frame.strut_count, 1))
    radii = np.repeat(frame.radius[:, None], 2, axis=1)
    found = curve_truth(
        frame, whole if present is None else present, radii if thickness is None else thickness, [camera]
    )
    return found.visible[0]


# --- What hides what


@pytest.mark.parametrize("radius", [2.0, 6.5])
@pytest.mark.parametrize("before", [50.0, 200.0])
def test_a_strut_hides_just_what_lies_behind_it(radius: float, before: float) -> None:
    frame = straight([-40, 0, 0], [40, 0, 0], [0, -before, -60], [0, -before, 60], radius=[1.0, radius])
    visible = seen(frame, camera_at((0.0, -500.0, 0.0)))
    # The ray to (x, 0, 0) passes the other axis at (500 - before) sin(angle).
    edge = 500.0 * np.tan(np.arcsin(radius / (500.0 - before)))
    x = -40.0 + 80.0 * U
    assert np.abs(np.abs(x) - edge).min() > 1e-3  # no sample lies on the edge itself
    assert np.array_equal(visible[0], np.abs(x) > edge) and not visible[0].all()
    assert visible[1].all()
    assert seen(frame, camera_at((0.0, 500.0, 0.0)))[0].all()  # from behind


@pytest.mark.parametrize(("way", "hidden"), [(1.6, False), (1.69, False), (1.71, True), (5.0, True)])
def test_struts_that_touch_do_not_hide_each_other(way: float, hidden: bool) -> None:
    # At the middle, the front strut is entered at way + 0.3 before the axis, this one at 1; one more radius is borne.
    frame = straight([-40, 0, 0], [40, 0, 0], [0, -way, -20], [0, -way, 20], radius=[1.0, 0.3])
    assert seen(frame, camera_at((0.0, -500.0, 0.0)))[0][SAMPLES // 2] != hidden


def test_struts_that_meet_in_a_joint_are_seen_up_to_it() -> None:
    ends = np.array([[0, 0, 0], [40, 0, 0], [0, 0, 40], [-30, 5, -20], [20, -5, -30]], dtype=float)
    frame = Wireframe.create(ends, [[0, 1], [0, 2], [0, 3], [0, 4]], radius=1.5)
    for centre in ((0.0, -500.0, 0.0), (100.0, -480.0, 60.0), (-120.0, -450.0, -40.0)):
        assert seen(frame, camera_at(centre)).all()


def test_only_what_is_there_hides_or_is_seen() -> None:
    ends = [[-40, 0, 0], [40, 0, 0], [-40, -30, 0.2], [40, -30, 0.2], [-40, -60, 0.1], [40, -60, 0.1]]
    frame = straight(*ends, radius=2.0).replace(printed=[True, True, False])
    present = np.array([[0.0, 1.0], [0.5, 1.0], [0.0, 1.0]])
    visible = seen(frame, camera_at((0.0, -5000.0, 0.0), fl_x=9000.0, fl_y=9000.0), present)
    assert not visible[2].any()  # not printed
    assert np.array_equal(visible[1], U >= 0.5)
    # What is left of the second strut ends in half a sphere of 2 mm.
    x = -40.0 + 80.0 * U
    assert np.array_equal(visible[0], x < -2.0) and not seen(frame, camera_at((0.0, -5000.0, 0.0)))[0].any()
    nothing = seen(frame, camera_at((0.0, -5000.0, 0.0)), np.zeros((3, 2)))
    assert not nothing.any()


def test_the_real_radius_counts() -> None:
    frame = straight([-40, 0, 0], [40, 0, 0], [-40, -30, 3], [40, -30, 3], radius=1.0)
    thickness = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 5.0]])
    visible = seen(frame, camera_at((0.0, -50_000.0, 0.0), fl_x=90_000.0, fl_y=90_000.0), thickness=thickness)
    # From afar the outline of the front strut is that of a cone: below its axis by r / sqrt(1 - r'^2).
    x = -40.0 + 80.0 * U
    radius = np.interp(x, [-40.0, 0.0, 40.0], [1.0, 1.0, 5.0])
    outline = np.where(x < 0.0, radius, radius / np.sqrt(1.0 - 0.1**2))
    assert np.abs(outline - 3.0).min() > 0.01
    assert np.array_equal(visible[0], outline < 3.0)


def test_a_strut_that_points_at_the_camera_shows_its_near_end() -> None:
    frame = straight([0, 0, 0], [0, -80, 0], radius=2.0)
    towards = seen(frame, camera_at((0.0, -500.0, 0.0)))[0]
    assert towards[-1] and not towards[:-1].any()
    for height in (12.0, 60.0):  # at a slant of a degree, and of some more
        assert seen(frame, camera_at((0.0, -500.0, height)))[0].all()
    # The camera stands on the axis of the second strut, which points past the first.
    both = straight([0, 0, 0], [0, -80, 0], [0, 0, 20], [0, -80, 20], radius=2.0)
    assert seen(both, camera_at((0.0, -500.0, 20.0)))[0].all()


def test_a_strut_hides_what_it_bends_around() -> None:
    curve = [[[0.0, -20.0, 0.0], [0.0, -20.0, 60.0], [0.0, 20.0, 60.0], [0.0, 20.0, 0.0]]]
    frame = Wireframe.create(np.array(curve)[0, [0, 3]], [[0, 1]], radius=1.5, control_points=curve)
    front = seen(frame, camera_at((0.0, -500.0, 20.0)))[0]
    assert front[U <= 0.45].all() and not front[(U >= 0.65) & (U < 0.97)].any()
    assert np.array_equal(seen(frame, camera_at((0.0, 500.0, 20.0)))[0], front[::-1])
    assert seen(frame, camera_at((500.0, 0.0, 20.0)))[0].all()


def test_what_is_outside_or_behind_is_not_seen() -> None:
    frame = straight([-400, 0, 0], [400, 0, 0], [-40, -600, 0], [40, -600, 0])
    camera = camera_at((0.0, -500.0, 0.0))
    visible = seen(frame, camera)
    x = camera.project(bezier.evaluate(frame.control_points[0], U))[0][:, 0]
    assert np.array_equal(visible[0], (x >= 0.0) & (x < 640.0)) and visible[0].any() and not visible[0].all()
    assert not visible[1].any()


def test_a_lens_does_not_fold_things_into_the_picture() -> None:
    camera = camera_at((0.0, -500.0, 0.0), distortion=np.array([-0.3, 0.0, 0.0, 0.0, 0.0]), fl_x=500.0, fl_y=500.0)
    frame = straight([740, 0, -5], [760, 0, 5], [-20, 0, 0], [20, 0, 0])
    pixels, _ = camera.project(frame.control_points[0])
    assert ((pixels >= 0.0) & (pixels < (640.0, 480.0))).all()  # says the formula of the first strut
    assert np.array_equal(seen(frame, camera), [[False] * SAMPLES, [True] * SAMPLES])


# --- Against brute force


def entries(
    rays: np.ndarray, centres: np.ndarray, radii: np.ndarray, limit: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where rays (M, 3) from the origin enter and leave spheres (C, 3), (C,): (M, C), infinite where they miss."""
    along = rays @ centres.T
    under = along**2 - (centres**2).sum(axis=1) + radii**2
    root = np.sqrt(np.maximum(under, 0.0))
    hit = under >= 0.0
    return np.where(hit, along - root, np.inf), np.where(hit, along + root, -np.inf)


def hidden_by_brute_force(
    frame: Wireframe, present: np.ndarray, thickness: np.ndarray, camera: Camera, ease: float
) -> np.ndarray:
    """(E, S) bool by many spheres along every strut; with ``ease`` above 0 surely hidden only, below 0 perhaps too."""
    pose = camera.world_to_camera
    fine = 241
    share = np.linspace(0.0, 1.0, fine)
    centres, radii = np.zeros((frame.strut_count, fine, 3)), np.zeros((frame.strut_count, fine))
    there = frame.printed & (present[:, 1] > present[:, 0])
    for e in range(frame.strut_count):
        u = present[e, 0] + share * (present[e, 1] - present[e, 0])
        centres[e] = bezier.evaluate(frame.control_points[e], u) @ pose[:3, :3].T + pose[:3, 3]
        radii[e] = np.interp(u, np.linspace(0.0, 1.0, thickness.shape[1]), thickness[e])
    points = bezier.evaluate(frame.control_points, U) @ pose[:3, :3].T + pose[:3, 3]
    tangents = bezier.derivative(frame.control_points, U) @ pose[:3, :3].T
    tangents /= np.linalg.norm(tangents, axis=2, keepdims=True)
    own = radii_at(thickness, np.tile(U, (frame.strut_count, 1)))
    hidden = np.zeros((frame.strut_count, SAMPLES), dtype=bool)
    for e in np.flatnonzero(there):
        r, p, t = own[e], points[e], tangents[e]
        away = np.linalg.norm(p, axis=1)
        rays = p / away[:, None]
        # This strut: from the point along the ray back to where its spheres end.
        enter, leave = entries(rays, centres[e], radii[e], away)
        surface = away.copy()
        for _ in range(fine):
            further = np.where(leave >= surface[:, None] - 1e-6, enter, np.inf).min(axis=1)
            if (further >= surface).all():
                break
            surface = np.minimum(surface, further)
        others = there.copy()
        others[e] = False
        for o in np.flatnonzero(others):
            enter, _ = entries(rays, centres[o], radii[o] * (1.0 - ease), away)
            hidden[e] |= enter.min(axis=1) < surface - r * (1.0 + ease)
        across = rays - (rays * t).sum(axis=1, keepdims=True) * t
        facing = p - r[:, None] * across / np.linalg.norm(across, axis=1, keepdims=True)
        away = np.linalg.norm(facing, axis=1)
        enter, _ = entries(facing / away[:, None], centres[e], radii[e] * (1.0 - ease), away)
        hidden[e] |= enter.min(axis=1) < away - r * (1.0 + ease)
    return hidden


def check_against_brute_force(
    frame: Wireframe, present: np.ndarray, thickness: np.ndarray, cameras: list[Camera]
) -> None:
    found = curve_truth(frame, present, thickness, cameras)
    doubtful = 0
    for n, camera in enumerate(cameras):
        pixels, depth = camera.project(bezier.evaluate(frame.control_points, U))
        inside = (depth > 0.0) & (pixels >= 0.0).all(axis=2) & (pixels < (camera.width, camera.height)).all(axis=2)
        possible = found.present & inside
        surely = hidden_by_brute_force(frame, present, thickness, camera, 0.03)
        perhaps = hidden_by_brute_force(frame, present, thickness, camera, -0.03)
        assert not (found.visible[n] & ~possible).any()
        assert not (found.visible[n] & surely).any()
        assert not (possible & ~perhaps & ~found.visible[n]).any()
        doubtful += int((possible & perhaps & ~surely).sum())
        assert (possible & surely).any() and found.visible[n].any()
    assert doubtful < 0.05 * found.visible.size


def test_a_curved_frame_agrees_with_brute_force() -> None:
    rng = np.random.default_rng(3)
    frame = named_frame("half_bowl")
    frame = frame.subset(np.arange(frame.strut_count) % 3 > 0)[0]
    frame = smooth_warp(frame, 12.0, 1)
    curves = frame.control_points.copy()
    curves[:, 1:3] += rng.normal(scale=3.0, size=curves[:, 1:3].shape)
    frame = frame.replace(control_points=curves, printed=rng.random(frame.strut_count) < 0.9)
    present = np.tile([0.0, 1.0], (frame.strut_count, 1))
    present[::7, 1] = 0.6
    present[3::11, 0] = 0.3
    present[5] = 0.0
    thickness = frame.radius[:, None] * rng.uniform(0.7, 1.4, size=(frame.strut_count, 5))
    cameras = list(ring_rig(frame, 3, size=(300, 400)))
    middle = frame.bounds.mean(axis=0)
    near = camera_at(middle + 0.8 * (cameras[0].centre - middle), frame.bounds[1])
    check_against_brute_force(frame, present, thickness, [*cameras, near])


def test_a_part_of_a_real_frame_agrees_with_brute_force(shared_frames: Path) -> None:
    frame = read_frame(shared_frames / "rl3dp" / "NodeFemur_wireframe.txt")
    frame = frame.subset(np.arange(frame.strut_count) < 100)[0]
    present = np.tile([0.0, 1.0], (100, 1))
    thickness = np.repeat(frame.radius[:, None], 2, axis=1)
    check_against_brute_force(frame, present, thickness, list(ring_rig(frame, 2, size=(600, 800), elevation_deg=5.0)))


# --- The other arrays


@pytest.fixture(scope="module")
def bridge() -> tuple[Wireframe, tuple[Camera, ...], CurveTruth]:
    frame = smooth_warp(named_frame("bridge"), 6.0, 2).replace(printed=np.arange(76) != 4)
    present = np.tile([0.0, 1.0], (76, 1))
    present[7] = 0.25, 0.75
    rng = np.random.default_rng(0)
    thickness = frame.radius[:, None] * rng.uniform(0.8, 1.2, size=(76, 4))
    cameras = ring_rig(frame, 3, size=(480, 640))
    bent = Camera("bent", 640, 480, 500.0, 510.0, 330.0, 230.0, cameras[0].camera_to_world,
                  distortion=np.array([-0.2, 0.05, 0.01, -0.02, 0.0]))  # fmt: skip
    cameras = (*cameras, bent)
    return frame, cameras, curve_truth(frame, present, thickness, cameras)


def test_samples_lie_on_the_curves(bridge: tuple[Wireframe, tuple[Camera, ...], CurveTruth]) -> None:
    frame, cameras, truth = bridge
    assert np.array_equal(truth.parameters, U) and truth.cameras == tuple(camera.name for camera in cameras)
    assert np.allclose(truth.points, bezier.evaluate(frame.control_points, U), rtol=0.0, atol=1e-4)
    velocity = bezier.derivative(frame.control_points, U)
    assert np.allclose(truth.tangents, velocity / np.linalg.norm(velocity, axis=2, keepdims=True), atol=1e-6)
    assert not truth.present[4].any() and np.array_equal(truth.present[7], (U >= 0.25) & (U <= 0.75))
    assert truth.present[[e for e in range(76) if e not in (4, 7)]].all()
    dtypes = {name: value.dtype for name, value in vars(truth).items() if isinstance(value, np.ndarray)}
    assert {name for name, dtype in dtypes.items() if dtype == np.float32} == {
        "points", "tangents", "radius", "pixels", "pixel_tangents", "depth"
    }  # fmt: skip


def test_the_radius_is_linear_between_its_knots() -> None:
    frame = straight([0, 0, 0], [1, 0, 0], radius=1.0)
    truth = curve_truth(frame, np.array([[0.0, 1.0]]), np.array([[1.0, 3.0, 2.0]]), [])
    assert np.allclose(truth.radius[0], np.interp(U, [0.0, 0.5, 1.0], [1.0, 3.0, 2.0]), atol=1e-6)
    assert truth.visible.shape == (0, 1, SAMPLES) and truth.pixels.shape == (0, 1, SAMPLES, 2)


def test_samples_are_projected_as_the_camera_does(bridge: tuple[Wireframe, tuple[Camera, ...], CurveTruth]) -> None:
    frame, cameras, truth = bridge
    points = bezier.evaluate(frame.control_points, U)
    tangents = bezier.derivative(frame.control_points, U)
    tangents /= np.linalg.norm(tangents, axis=2, keepdims=True)
    for n, camera in enumerate(cameras):
        pixels, depth = camera.project(points)
        assert np.allclose(truth.pixels[n], pixels, rtol=0.0, atol=1e-3)
        assert np.allclose(truth.depth[n], depth, rtol=1e-6)
        step = camera.project(points + 1e-3 * tangents)[0] - camera.project(points - 1e-3 * tangents)[0]
        unit = step / np.linalg.norm(step, axis=2, keepdims=True)
        assert np.allclose(truth.pixel_tangents[n], unit, rtol=0.0, atol=1e-5)


def test_a_curve_has_no_direction_where_it_points_at_the_camera() -> None:
    frame = straight([0, 0, 0], [0, -80, 0], [0, -700, 0], [0, -800, 10], radius=2.0)
    truth = curve_truth(frame, np.tile([0.0, 1.0], (2, 1)), np.full((2, 2), 2.0), [camera_at((0.0, -500.0, 0.0))])
    assert not truth.pixel_tangents.any() and (truth.depth[0, 1] < 0.0).all()
    assert np.isnan(truth.pixels[0, 1]).all() and np.isfinite(truth.pixels[0, 0]).all()
    slanted = straight([0, 0, 0], [0, -80, 0.01], radius=2.0)
    truth = curve_truth(slanted, np.array([[0.0, 1.0]]), np.full((1, 2), 2.0), [camera_at((0.0, -500.0, 0.0))])
    assert np.allclose(truth.pixel_tangents, (0.0, -1.0), atol=1e-5)


def test_samples_lie_on_the_silhouettes(bridge: tuple[Wireframe, tuple[Camera, ...], CurveTruth]) -> None:
    frame, _, _ = bridge
    present = np.tile([0.0, 1.0], (76, 1))
    cameras = ring_rig(frame, 2, size=(900, 1200))
    truth = curve_truth(frame, present, np.repeat(frame.radius[:, None], 2, axis=1), cameras)
    for n, picture in enumerate(silhouettes(frame, cameras)):
        column, row = np.floor(truth.pixels[n][truth.visible[n]]).astype(int).T
        assert picture[row, column].all() and len(row) > 500


def test_shapes_that_do_not_belong_together() -> None:
    frame = straight([0, 0, 0], [1, 0, 0])
    for present, thickness in ((np.zeros((2, 2)), np.ones((1, 2))), (np.zeros((1, 2)), np.ones((1, 1)))):
        with pytest.raises(ValueError, match="not those of 1 struts"):
            curve_truth(frame, present, thickness, [])


# --- The file


def test_the_file_gives_back_the_same_bits(
    bridge: tuple[Wireframe, tuple[Camera, ...], CurveTruth], tmp_path: Path
) -> None:
    truth = bridge[2]
    write_curves(tmp_path / "curves.npz", truth)
    for path in (tmp_path, tmp_path / "curves.npz"):
        back = read_curves(path)
        assert back.cameras == truth.cameras
        for name, value in vars(truth).items():
            if isinstance(value, np.ndarray):
                found = getattr(back, name)
                assert found.dtype == value.dtype and np.array_equal(found, value, equal_nan=value.dtype.kind == "f")
    write_curves(tmp_path / "again.npz", truth)
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "curves.npz").read_bytes()
    with np.load(tmp_path / "curves.npz", allow_pickle=False) as arrays:
        assert {arrays[name].dtype.kind for name in arrays.files} == {"f", "b", "U"}


def negative_radius(arrays: dict[str, Any]) -> None:
    arrays["radius"] = -arrays["radius"]


def visible_where_nothing_is(arrays: dict[str, Any]) -> None:
    arrays["visible"] = np.ones_like(arrays["visible"])


def not_finite(arrays: dict[str, Any]) -> None:
    arrays["points"] = np.full_like(arrays["points"], np.nan)


def other_type(arrays: dict[str, Any]) -> None:
    arrays["depth"] = arrays["depth"].astype(np.float64)


def fewer_views(arrays: dict[str, Any]) -> None:
    arrays["visible"] = arrays["visible"][1:]


def without_names(arrays: dict[str, Any]) -> None:
    del arrays["cameras"]


def objects(arrays: dict[str, Any]) -> None:
    arrays["cameras"] = np.array([{"a": 1}], dtype=object)


def flat_points(arrays: dict[str, Any]) -> None:
    arrays["points"] = arrays["points"].ravel()


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (negative_radius, "radius: is not above 0"),
        (visible_where_nothing_is, "visible: is true where nothing is"),
        (not_finite, "points: holds values that are not finite"),
        (other_type, "depth: is float64 of the shape"),
        (fewer_views, r"visible: is bool of the shape \(3, 76, 33\) where bool \(4, 76, 33\)"),
        (without_names, "cameras: is missing"),
        (objects, "file: cannot be read"),
        (flat_points, "points: is of the shape"),
    ],
)
def test_a_damaged_file_is_refused_in_words(
    damage: Callable[[dict[str, Any]], None],
    words: str,
    bridge: tuple[Wireframe, tuple[Camera, ...], CurveTruth],
    tmp_path: Path,
) -> None:
    arrays = {**vars(bridge[2]), "cameras": np.array(bridge[2].cameras)}
    damage(arrays)
    np.savez(tmp_path / "curves.npz", **arrays)
    with pytest.raises(InputError, match=f"curves.npz: {words}.*; make the sample again"):
        read_curves(tmp_path / "curves.npz")


def test_a_file_that_is_none(tmp_path: Path, bridge: tuple[Wireframe, tuple[Camera, ...], CurveTruth]) -> None:
    path = tmp_path / "curves.npz"
    with pytest.raises(InputError, match="does not exist"):
        read_curves(tmp_path)
    write_curves(path, bridge[2])
    whole = path.read_bytes()
    middle = len(whole) // 2
    flipped = whole[:middle] + bytes(255 - byte for byte in whole[middle : middle + 50]) + whole[middle + 50 :]
    np.save(tmp_path / "one.npy", np.arange(3))
    for data in (b"", b"text", whole[:middle], flipped, (tmp_path / "one.npy").read_bytes()):
        path.write_bytes(data)
        with pytest.raises(InputError, match="curves.npz: file: "):
            read_curves(path)
