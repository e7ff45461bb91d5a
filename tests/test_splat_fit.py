"""The paper's fit on a small frame: it converges, repeats itself, reports, stops and refuses."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

from frametwin.cameras import Camera
from frametwin.cameras.rigs import ring_rig
from frametwin.errors import Cancelled, InputError
from frametwin.fields.network import NetworkField
from frametwin.fields.sampling import CurveSampling
from frametwin.fitting.api import fit_views
from frametwin.fitting.part_fit import PartFit
from frametwin.fitting.settings import FIELD_KINDS, PRESETS, FitSettings, preset
from frametwin.fitting.splat_fit import SplatFitter
from frametwin.fitting.splat_fit import _rate as rate_at
from frametwin.fitting.splat_model import stretched
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import Progress, ProgressCallback
from frametwin.raster.silhouette import silhouettes

pytestmark = pytest.mark.usefixtures("one_thread")

QUICK = {"iterations": 4, "samples": 4, "kernels_per_strut": 4, "bending_samples": 64}
SIZE = (72, 96)


def bent(frame: Wireframe) -> Wireframe:
    """The frame leaning over more and more with height, 3 mm at its top, and sinking a little."""

    def displacement(points: np.ndarray) -> np.ndarray:
        z = points[..., 2] / 40.0
        return np.stack([3.0 * z**2, -1.0 * z, -0.8 * z**2], axis=-1)

    samples = bezier.evaluate(frame.control_points, np.linspace(0.0, 1.0, 13))
    curves = bezier.refit_matrix(12) @ (samples + displacement(samples))
    vertices = frame.vertices + displacement(frame.vertices)
    curves[:, 0], curves[:, 3] = vertices[frame.edges[:, 0]], vertices[frame.edges[:, 1]]
    return frame.replace(vertices=vertices, control_points=curves)


def pictures(frame: Wireframe, cameras: list[Camera]) -> list[np.ndarray]:
    return [picture.astype(np.float32) / 255.0 for picture in silhouettes(frame, cameras, supersampling=4)]


def error(curves: np.ndarray, truth: Wireframe) -> float:
    """Mean distance in mm between two sets of curves, both ways."""
    u = np.linspace(0.0, 1.0, 41)
    one, other = (bezier.evaluate(c, u).reshape(-1, 3) for c in (curves, truth.control_points))
    return float(0.5 * (cKDTree(one).query(other)[0].mean() + cKDTree(other).query(one)[0].mean()))


@pytest.fixture
def scene(curved_frame: Wireframe) -> tuple[Wireframe, Wireframe, list[Camera], list[np.ndarray]]:
    """Plan, truth, cameras of two sizes and masks."""
    truth = bent(curved_frame)
    cameras = list(ring_rig(curved_frame, 5, size=SIZE))
    cameras[1] = cameras[1].resized(128, 96)
    return curved_frame, truth, cameras, pictures(truth, cameras)


def fit_splats(
    plan: Wireframe,
    cameras: list[Camera],
    masks: list[np.ndarray],
    settings: FitSettings,
    callback: ProgressCallback | None = None,
) -> PartFit:
    return SplatFitter(settings).fit(plan, cameras, masks, callback=callback)


class TestFit:
    @pytest.mark.parametrize(
        ("name", "rates", "share"),
        [
            ("paper", (1e-4, 1e-5), 0.3),
            ("paper-letter", (5e-4, 5e-5), 0.3),
            ("paper-lattice", (1e-2, 1e-3), 0.25),
        ],
    )
    def test_converges(self, name: str, rates: tuple[float, float], share: float, scene: tuple) -> None:
        plan, truth, cameras, masks = scene
        settings = preset(
            name, iterations=80, samples=5, kernels_per_strut=8, bending_samples=64,
            learning_rate=rates[0], learning_rate_end=rates[1],
        )  # fmt: skip
        fit = fit_splats(plan, cameras, masks, settings)
        before = error(plan.control_points, truth)
        assert before > 1.0
        assert error(fit.control_points, truth) < share * before
        assert fit.loss[-1] < 0.5 * fit.loss[0]
        assert len(fit.loss) == 80

    @pytest.mark.parametrize(("kind", "rate"), [("free", 1.6e-3), ("nodes", 1.2e-3)])
    def test_other_fields_follow_the_pictures(self, kind: str, rate: float, scene: tuple) -> None:
        plan, _, cameras, masks = scene
        changes = {**QUICK, "iterations": 40, "learning_rate": rate, "node_count": 30, "field": kind}
        fit = fit_splats(plan, cameras, masks, preset("paper", **changes))
        assert fit.loss[-1] < 0.5 * fit.loss[0]

    def test_thickness_comes_out_as_the_radius(self, scene: tuple) -> None:
        plan, _, cameras, _ = scene
        settings = preset("paper", **{**QUICK, "iterations": 60, "thickness_rate": 2e-2})
        fit = fit_splats(plan.replace(radius=np.full(24, 1.4)), cameras, pictures(plan, cameras), settings)
        assert fit.thickness.shape == (24, 4)
        assert np.median(fit.thickness) == pytest.approx(1.0, rel=0.15)  # the pictures' struts, not the plan's

    def test_a_missing_strut_fades(self, scene: tuple) -> None:
        plan, _, cameras, _ = scene
        gone = np.arange(24) == 7
        masks = pictures(plan.subset(~gone)[0], cameras)
        settings = preset("paper", **{**QUICK, "iterations": 40, "kernels_per_strut": 8, "opacity_rate": 0.1})
        fit = fit_splats(plan, cameras, masks, settings)
        assert np.median(fit.opacity[7]) < 0.3 < np.median(fit.opacity[~gone])
        assert np.argmin(np.median(fit.opacity, axis=1)) == 7

    def test_struts_stay_joined_exactly(self, scene: tuple) -> None:
        plan, _, cameras, masks = scene
        fit = fit_splats(plan, cameras, masks, preset("paper", **QUICK))
        ends = fit.control_points[:, [0, 3]].reshape(-1, 3)
        joint = plan.edges.ravel()
        for vertex in range(plan.vertex_count):
            assert len(np.unique(ends[joint == vertex], axis=0)) == 1

    @pytest.mark.parametrize("kind", ["network", "lattice", "nodes"])
    def test_the_field_moves_the_plan_to_the_curves(self, kind: str, scene: tuple) -> None:
        plan, _, cameras, masks = scene
        fit = fit_splats(plan, cameras, masks, preset("paper", field=kind, learning_rate=5e-3, **QUICK))
        samples = bezier.evaluate(plan.control_points, np.arange(5) / 4)
        moved = samples + fit.field.evaluate(samples.reshape(-1, 3)).reshape(samples.shape)
        np.testing.assert_allclose(bezier.refit_matrix(4) @ moved, fit.control_points, atol=1e-4)
        assert np.abs(fit.control_points - plan.control_points).max() > 0.01

    def test_what_is_not_learnt_stays(self, scene: tuple) -> None:
        plan, _, cameras, masks = scene
        settings = preset("paper", learn_thickness=False, learn_opacity=False, opacity_start=0.8, **QUICK)
        fit = fit_splats(plan, cameras, masks, settings)
        np.testing.assert_allclose(fit.opacity, 0.8, rtol=1e-6)
        np.testing.assert_allclose(fit.thickness, 1.0, rtol=1e-5)

    def test_struts_with_fewer_kernels_repeat_theirs(self, scene: tuple) -> None:
        plan, _, cameras, masks = scene
        settings = preset("paper", adaptive_kernels=True, **{**QUICK, "kernels_per_strut": 30})
        fit = fit_splats(plan, cameras, masks, settings)
        assert fit.thickness.shape == fit.opacity.shape and np.isfinite(fit.thickness).all()
        width = fit.opacity.shape[1]
        learnt = fit.opacity + 1j * fit.thickness  # no two kernels learn the very same of both
        counts = np.array([len(np.unique(row)) for row in learnt])
        assert counts.min() < counts.max() <= width
        assert np.corrcoef(counts, plan.lengths)[0, 1] > 0.95
        for row in learnt:
            runs = np.diff(np.flatnonzero(np.concatenate([[True], np.diff(row) != 0.0, [True]])))
            assert runs.max() - runs.min() <= 1  # each repeats as often as the others

    def test_rows_of_kernels_are_stretched_to_the_widest(self) -> None:
        counts = np.array([4, 2, 1, 3])
        wanted = [[0.1, 0.2, 0.3, 0.4], [0.5, 0.5, 0.6, 0.6], [0.7] * 4, [0.1, 0.1, 0.5, 0.9]]
        values = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.1, 0.5, 0.9])
        np.testing.assert_array_equal(stretched(values, counts), wanted)

    def test_joints_and_confidence_belong_to_the_curves(self, scene: tuple) -> None:
        plan, _, cameras, masks = scene
        fit = fit_splats(plan, cameras, masks, preset("paper", **QUICK))
        for side, corner in ((0, 0), (1, 3)):
            assert np.array_equal(fit.vertices[plan.edges[:, side]], fit.control_points[:, corner])
        assert fit.confidence.shape == (24,) and ((fit.confidence > 0.0) & (fit.confidence <= 1.0)).all()

    @pytest.mark.parametrize(("image_loss", "share"), [("sum", 0.25), ("mean", 1.0)])
    def test_smaller_pictures(self, image_loss: str, share: float, scene: tuple) -> None:
        plan, _, cameras, masks = scene
        losses = [
            fit_splats(plan, cameras, masks, preset("paper", image_scale=scale, image_loss=image_loss, **QUICK)).loss[0]
            for scale in (1.0, 0.5)
        ]
        assert losses[1] == pytest.approx(share * losses[0], rel=0.25)  # of a quarter of the pixels

    def test_the_image_loss_is_a_sum_or_a_mean_of_the_same(self, scene: tuple) -> None:
        plan, _, cameras, masks = scene
        wide = [one.resized(96, 72) for one in cameras]  # all of one size, so that the two differ by a factor alone
        seen = pictures(bent(plan), wide)
        first = {
            name: fit_splats(plan, wide, seen, preset("paper", image_loss=name, bending_weight=0.0, **QUICK)).loss[0]
            for name in ("sum", "mean")
        }
        assert first["sum"] == pytest.approx(96 * 72 * first["mean"], rel=1e-5)

    @pytest.mark.parametrize("decay", ["cosine", "geometric"])
    def test_rates_fall_from_the_first_to_the_last(self, decay: str) -> None:
        settings = preset("paper", iterations=11, learning_rate=4e-3, learning_rate_end=1e-3, decay=decay)
        rates = [rate_at(settings, i) for i in range(11)]
        middle = {"cosine": (4e-3 + 1e-3) / 2, "geometric": math.sqrt(4e-3 * 1e-3)}[decay]
        assert (rates[0], rates[5], rates[10]) == pytest.approx((5 * 4e-3, 5 * middle, 5 * 1e-3))
        assert all(one > other for one, other in itertools.pairwise(rates))

    def test_the_scale_multiplies_the_rates(self, scene: tuple) -> None:
        plan, _, cameras, masks = scene
        rates = {"learning_rate": 1e-3, "learning_rate_end": 2e-4}
        scaled = preset("paper", **rates, learning_rate_scale=4.0, **QUICK)
        given = preset("paper", learning_rate=4e-3, learning_rate_end=8e-4, learning_rate_scale=1.0, **QUICK)
        one, other = (fit_splats(plan, cameras, masks, settings) for settings in (scaled, given))
        assert np.array_equal(one.control_points, other.control_points)

    @pytest.mark.parametrize(
        ("name", "value"),
        [("encoding", "with_pi"), ("learning_rate_scale", 1.0), ("initial_weights", "he"), ("image_loss", "sum")],
    )
    def test_each_choice_counts_and_starts_at_the_plan(self, name: str, value: object, scene: tuple) -> None:
        plan, _, cameras, masks = scene
        fits, starts = [], []
        for changes in ({}, {name: value}):
            seen: list[Progress] = []
            settings = preset("paper", **{**QUICK, "bending_weight": 1e-3}, **changes)
            fits.append(fit_splats(plan, cameras, masks, settings, seen.append))
            starts.append(seen[0].control_points)
        for curves in starts:
            np.testing.assert_allclose(curves, plan.control_points, atol=1e-12)
        assert not np.array_equal(fits[0].control_points, fits[1].control_points)


class TestRepeatability:
    @pytest.mark.parametrize("kind", FIELD_KINDS)
    def test_same_seed_same_bits(self, kind: str, scene: tuple) -> None:
        plan, _, cameras, masks = scene
        settings = preset("paper", field=kind, **QUICK)
        one, other = (fit_splats(plan, cameras, masks, settings) for _ in range(2))
        for field in ("control_points", "thickness", "opacity"):
            assert np.array_equal(getattr(one, field), getattr(other, field))
        assert one.loss == other.loss
        for name, tensor in one.field.tensors().items():
            assert np.array_equal(tensor, other.field.tensors()[name])

    def test_another_seed_gives_another_network(self, scene: tuple) -> None:
        plan, _, cameras, masks = scene
        fits = [fit_splats(plan, cameras, masks, preset("paper", seed=seed, **QUICK)) for seed in (0, 1)]
        assert not np.array_equal(fits[0].control_points, fits[1].control_points)

    def test_the_callers_choices_in_torch_are_left_alone(self, scene: tuple) -> None:
        plan, _, cameras, masks = scene
        state = torch.get_rng_state()
        fit_splats(plan, cameras, masks, preset("paper", **QUICK))
        assert not torch.are_deterministic_algorithms_enabled()
        assert torch.equal(state, torch.get_rng_state())


class TestProgress:
    def test_every_iteration_is_reported(self, scene: tuple) -> None:
        plan, _, cameras, masks = scene
        seen: list[Progress] = []
        fit = fit_splats(plan, cameras, masks, preset("paper", **QUICK), seen.append)
        assert [p.iteration for p in seen] == [1, 2, 3, 4]
        assert {p.total for p in seen} == {4}
        assert [p.loss for p in seen] == fit.loss
        assert seen[0].control_points is not None
        np.testing.assert_allclose(seen[0].control_points, plan.control_points, atol=1e-12)  # starts at the plan

    def test_the_callback_stops_the_fit(self, scene: tuple) -> None:
        plan, _, cameras, masks = scene
        seen: list[int] = []

        def callback(progress: Progress) -> bool:
            seen.append(progress.iteration)
            return progress.iteration < 2

        with pytest.raises(Cancelled):
            fit_splats(plan, cameras, masks, preset("paper", **QUICK), callback)
        assert seen == [1, 2]
        assert not torch.are_deterministic_algorithms_enabled()


class TestRefusals:
    def fit(self, scene: tuple, cameras: list, masks: list, preset: str = "paper") -> None:
        fit_views(scene[0], cameras, masks, preset, changes={} if preset == "fast" else QUICK)

    @pytest.mark.parametrize("preset", ["paper", "fast"])
    def test_pictures_and_cameras_of_different_number(self, scene: tuple, preset: str) -> None:
        with pytest.raises(InputError, match="views: there are 4 pictures for 5 cameras"):
            self.fit(scene, scene[2], scene[3][:-1], preset)
        with pytest.raises(InputError, match="views"):
            self.fit(scene, [], [], preset)

    @pytest.mark.parametrize("preset", ["paper", "fast"])
    def test_pictures_of_another_size(self, scene: tuple, preset: str) -> None:
        masks = [*scene[3][:2], scene[3][2].T, *scene[3][3:]]
        with pytest.raises(InputError, match=f"{scene[2][2].name}: size"):
            self.fit(scene, scene[2], masks, preset)

    @pytest.mark.parametrize("preset", ["paper", "fast"])
    def test_cameras_with_distortion(self, scene: tuple, preset: str) -> None:
        bad = dataclasses.replace(scene[2][0], distortion=np.array([0.1, 0.0, 0.0, 0.0, 0.0]))
        with pytest.raises(InputError, match="distortion: is not zero"):
            self.fit(scene, [bad, *scene[2][1:]], scene[3], preset)

    def test_a_fit_that_diverges(self, scene: tuple, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(NetworkField, "forward", lambda self, points: points * float("nan"))
        with pytest.raises(InputError, match="learning_rate: the fit has diverged after 0 steps"):
            self.fit(scene, scene[2], scene[3])


class TestSettings:
    def test_the_default_is_the_paper(self) -> None:
        settings = preset("paper")
        assert settings == FitSettings()
        assert (settings.iterations, settings.samples, settings.kernels_per_strut) == (150, 50, 20)
        assert (settings.learning_rate, settings.learning_rate_end) == (1.6e-4, 1.6e-5)
        assert (settings.encoding, settings.learning_rate_scale) == ("without_pi", 5.0)
        assert (settings.initial_weights, settings.image_loss) == ("torch", "mean")
        assert (settings.bending_weight, settings.bending_power) == (1e-7, 2.0)
        assert (settings.image_scale, settings.field, settings.spread) == (1.0, "network", 1.0)

    def test_the_letter_differs_by_four_choices(self) -> None:
        letter = {"encoding": "with_pi", "learning_rate_scale": 1.0, "initial_weights": "he", "image_loss": "sum"}
        assert preset("paper-letter") == FitSettings(preset="paper-letter", **letter)

    @pytest.mark.parametrize("name", PRESETS)
    def test_presets_carry_their_name(self, name: str) -> None:
        assert preset(name).preset == name

    @pytest.mark.parametrize(
        ("name", "value"),
        [
            ("seed", -1),
            ("iterations", 0),
            ("iterations", 2.5),
            ("iterations", True),
            ("samples", 2),
            ("kernels_per_strut", 0),
            ("image_scale", 0.0),
            ("image_scale", 1.5),
            ("image_scale", float("nan")),
            ("spread", -1.0),
            ("pixel_variance", -0.1),
            ("learning_rate", 0.0),
            ("learning_rate_end", 1.0),
            ("opacity_start", 1.0),
            ("bending_weight", -1e-7),
            ("bending_power", -0.1),
            ("bending_samples", 0),
            ("field", "wavelet"),
            ("decay", "sudden"),
            ("encoding", "letter"),
            ("initial_weights", "zero"),
            ("image_loss", "median"),
            ("learning_rate_scale", 0.0),
            ("learn_opacity", 1),
            ("lattice_cells", ()),
            ("lattice_cells", 6),
            ("lattice_cells", (1, 0)),
            ("node_neighbours", 0),
            ("colour", "red"),
        ],
    )
    def test_wrong_values_are_named(self, name: str, value: object) -> None:
        with pytest.raises(InputError, match=f"settings: {name}: .*; .*"):
            preset("paper", **{name: value})

    def test_unknown_presets_are_named(self) -> None:
        with pytest.raises(InputError, match=r"preset: 'best' is unknown; give one of paper, "):
            preset("best")


class TestSampling:
    def test_joints_are_sampled_once(self, curved_frame: Wireframe) -> None:
        sampling = CurveSampling.of(curved_frame, 5)
        assert sampling.points.shape == (curved_frame.vertex_count + 4 * curved_frame.strut_count, 3)
        inner = bezier.evaluate(curved_frame.control_points, np.arange(1, 5) / 5).reshape(-1, 3)
        np.testing.assert_allclose(sampling.points[curved_frame.vertex_count :], inner, atol=1e-12)

    def test_matrix_equals_the_map(self, curved_frame: Wireframe) -> None:
        sampling = CurveSampling.of(curved_frame, 7)
        values = np.random.default_rng(0).normal(size=sampling.points.shape)
        mapped = sampling.control(torch.from_numpy(values)).numpy()
        np.testing.assert_allclose((sampling.control_matrix @ values).reshape(-1, 4, 3), mapped, atol=1e-12)

    def test_affine_motions_are_kept_exactly(self, curved_frame: Wireframe) -> None:
        sampling = CurveSampling.of(curved_frame, 6)
        matrix, shift = np.random.default_rng(0).normal(size=(3, 3)), np.array([1.0, 2.0, 3.0])
        moved = sampling.control(torch.from_numpy(sampling.points @ matrix.T + shift)).numpy()
        np.testing.assert_allclose(moved, curved_frame.control_points @ matrix.T + shift, atol=1e-9)

    def test_refuses_too_few_samples(self, curved_frame: Wireframe) -> None:
        with pytest.raises(ValueError, match="3"):
            CurveSampling.of(curved_frame, 2)
