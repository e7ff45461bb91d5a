"""The methods that the paper compares with: the terms that they minimise, and their fits on a small frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from frametwin.cameras import Camera
from frametwin.cameras.rigs import ring_rig
from frametwin.errors import InputError
from frametwin.fields.free import FreeField
from frametwin.fields.nodes import NodesField, turn_matrices
from frametwin.fields.rigidity import Rigidity, best_rotations
from frametwin.fields.sampling import CurveSampling
from frametwin.fields.steered_nodes import SteeredNodes
from frametwin.fields.store import load_field, save_field
from frametwin.fitting import curve_terms
from frametwin.fitting.api import fit_views
from frametwin.fitting.part_fit import PartFit
from frametwin.fitting.settings import FitSettings, preset
from frametwin.fitting.similarity import WINDOW, absolute_ssim, balanced_ssim, similarity_loss, ssim
from frametwin.fitting.splat_fit import SplatFitter
from frametwin.fitting.view_turns import ViewTurns
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster.kernels import KernelLayout, anchored_kernels, isotropic_covariance
from frametwin.raster.silhouette import silhouettes
from frametwin.twin.twin import read_twin, write_twin

pytestmark = pytest.mark.usefixtures("one_thread")

QUICK = {"iterations": 6, "kernels_per_strut": 6, "samples": 4}
Scene = tuple[Wireframe, Wireframe, list[Camera], list[np.ndarray]]


@pytest.fixture
def scene(curved_frame: Wireframe) -> Scene:
    """Plan, truth, which leans over, cameras and masks."""
    lean = np.array([[1.0, 0.0, 0.05], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    truth = curved_frame.replace(
        vertices=curved_frame.vertices @ lean.T, control_points=curved_frame.control_points @ lean.T
    )
    cameras = list(ring_rig(curved_frame, 5, size=(72, 96)))
    masks = [picture.astype(np.float32) / 255.0 for picture in silhouettes(truth, cameras, supersampling=4)]
    return curved_frame, truth, cameras, masks


def fit(scene: Scene, settings: FitSettings) -> PartFit:
    plan, _, cameras, masks = scene
    return SplatFitter(settings).fit(plan, cameras, masks)


def scattered(count: int, seed: int = 0) -> torch.Tensor:
    return torch.from_numpy(np.random.default_rng(seed).normal(size=(count, 3)))


class TestRigidity:
    def test_rigid_motions_cost_nothing(self) -> None:
        nodes = scattered(40)
        energy = Rigidity(nodes)
        for turn in Rotation.random(5, random_state=0).as_matrix():
            moved = nodes @ torch.from_numpy(turn).T + torch.tensor([5.0, -3.0, 1.0])
            assert float(energy(moved)) < 1e-24

    def test_gradient_is_that_of_differences(self) -> None:
        nodes = scattered(15)
        moved = (nodes + 0.3 * scattered(15, seed=1)).requires_grad_()
        assert torch.autograd.gradcheck(Rigidity(nodes, 5), (moved,), eps=1e-6, atol=1e-7)

    def test_even_growth_costs_the_squares_of_the_arms(self) -> None:
        nodes = scattered(12)
        energy = Rigidity(nodes, 4)
        arms = nodes[:, None] - nodes[None]
        square = (arms**2).sum(-1)
        near = square.topk(5, largest=False).values[:, 1:]  # without the node itself
        weights = torch.softmax(-near / near.mean(), dim=1)
        torch.testing.assert_close(energy(1.2 * nodes), 0.04 * (weights * near).sum())

    def test_weights_sum_to_one(self) -> None:
        torch.testing.assert_close(Rigidity(scattered(30)).weights.sum(1), torch.ones(30).double())

    def test_mirrors_are_no_rotations(self) -> None:
        arms = scattered(60).view(4, 15, 3)
        mirrored = arms * torch.tensor([1.0, 1.0, -1.0])
        turns = best_rotations(arms, mirrored, torch.full((4, 15), 1.0 / 15.0, dtype=torch.float64))
        torch.testing.assert_close(torch.linalg.det(turns), torch.ones(4).double())
        for i in range(4):
            wanted = Rotation.align_vectors(mirrored[i].numpy(), arms[i].numpy())[0].as_matrix()
            np.testing.assert_allclose(turns[i], wanted, atol=1e-9)

    def test_needs_two_nodes(self) -> None:
        with pytest.raises(ValueError, match="two nodes"):
            Rigidity(scattered(1))


class TestSteeredNodes:
    def steered(self, start: bool = False) -> SteeredNodes:
        field = SteeredNodes(scattered(20) * 10.0, 20.0, 3, encoding="without_pi", initial_weights="he")
        if not start:
            with torch.no_grad():
                field.network.output.weight.normal_(std=0.1, generator=torch.Generator().manual_seed(0))
        return field

    def test_starts_at_exactly_zero(self) -> None:
        assert not self.steered(start=True).evaluate(scattered(50).numpy() * 10.0).any()

    def test_is_plain_nodes_when_it_is_over(self, tmp_path: Path) -> None:
        field, points = self.steered(), scattered(50).numpy() * 10.0
        frozen = field.frozen()
        assert type(frozen) is NodesField and np.abs(frozen.evaluate(points)).max() > 0.1
        np.testing.assert_allclose(frozen.evaluate(points), field.evaluate(points), atol=1e-12)
        save_field(tmp_path / "field.safetensors", frozen)
        np.testing.assert_array_equal(
            load_field(tmp_path / "field.safetensors").evaluate(points), frozen.evaluate(points)
        )

    def test_carries_directions_along(self) -> None:
        field, points = NodesField(scattered(20) * 10.0, 20.0, 3), scattered(30) * 10.0
        turn = torch.tensor([0.3, -0.2, 0.5]).double()
        with torch.no_grad():
            field.rotations[:] = turn
            field.translations[:] = (field.nodes @ turn_matrices(turn[None])[0].T) / 20.0
        index = torch.arange(3).expand(30, 3)
        moved, turns = field.carried(points, index, field.motions())
        torch.testing.assert_close(turns, turn_matrices(turn[None]).expand(30, 3, 3))
        torch.testing.assert_close(moved, points @ turn_matrices(turn[None])[0].T)


class TestSimilarity:
    def pictures(self, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
        rng = np.random.default_rng(seed)
        return tuple(torch.from_numpy(rng.uniform(size=(14, 17))) for _ in range(2))  # type: ignore[return-value]

    def test_ssim_is_that_of_the_definition(self) -> None:
        x, y = self.pictures()
        half = WINDOW // 2
        bell = np.exp(-0.5 * (np.arange(-half, half + 1) / 1.5) ** 2)
        window = np.outer(bell, bell) / bell.sum() ** 2
        total = 0.0
        wide_x, wide_y = (np.pad(z.numpy(), half) for z in (x, y))
        for i in range(14):
            for j in range(17):
                a, b = (z[i : i + WINDOW, j : j + WINDOW] for z in (wide_x, wide_y))
                mean_a, mean_b = (window * a).sum(), (window * b).sum()
                var_a, var_b = (window * a * a).sum() - mean_a**2, (window * b * b).sum() - mean_b**2
                both = (window * a * b).sum() - mean_a * mean_b
                top = (2 * mean_a * mean_b + 1e-4) * (2 * both + 9e-4)
                total += top / ((mean_a**2 + mean_b**2 + 1e-4) * (var_a + var_b + 9e-4))
        assert float(ssim(x, y)) == pytest.approx(total / (14 * 17), abs=1e-9)
        assert float(ssim(x, x)) == pytest.approx(1.0)

    @pytest.mark.parametrize("loss", [ssim, absolute_ssim, balanced_ssim])
    def test_gradients(self, loss) -> None:
        x, y = self.pictures(1)
        assert torch.autograd.gradcheck(lambda image: loss(image, y), (x.requires_grad_(),))

    def test_classes_balance(self) -> None:
        target = torch.zeros(10, 10, dtype=torch.float64)
        target[0, :4] = 1.0
        likeness = 0.1 * (1.0 - float(ssim(target + 0.2, target)))
        squares = 0.04 * (4 * 5.0 * 97 / 100 + 96 * 5 / 100) / 100
        assert float(balanced_ssim(target + 0.2, target)) == pytest.approx(0.9 * squares + likeness)
        assert float(absolute_ssim(target + 0.2, target)) == pytest.approx(0.8 * 0.2 + 2.0 * likeness)

    def test_views_are_added(self) -> None:
        x, y = self.pictures()
        twice = similarity_loss([x, x], [y, y], "absolute-ssim")
        assert float(twice) == pytest.approx(2.0 * float(absolute_ssim(x, y)))


class TestCurveTerms:
    def test_smoothness_is_the_angle_between_neighbours(self) -> None:
        angle = torch.arange(6) * 0.3
        circle = torch.stack([torch.cos(angle), torch.sin(angle), torch.zeros(6)], dim=-1)[None]
        assert float(curve_terms.smoothness(circle)) == pytest.approx(1.0 - np.cos(0.3), rel=1e-5)
        assert float(curve_terms.smoothness(circle[:, :1].expand(1, 6, 3))) == pytest.approx(0.0, abs=1e-7)

    def test_near_ends_of_different_curves_are_drawn_together(self) -> None:
        ends = torch.tensor(
            [[[0.0, 0, 0], [1, 0, 0]], [[1.02, 0, 0], [2, 0, 0]], [[2, 0.04, 0], [2.01, 0.04, 0]]]
        ).double()  # the last curve is shorter than the reach, which does not count
        far = float(np.hypot(0.01, 0.04))
        assert float(curve_terms.connection(ends)) == pytest.approx((0.02 + 0.04 + far) / 3)
        assert torch.autograd.gradcheck(curve_terms.connection, (ends.requires_grad_(),))
        assert float(curve_terms.connection(ends.detach()[:1])) == 0.0

    def test_width_and_opacity(self) -> None:
        assert float(curve_terms.excess_width(torch.tensor([0.001, 0.007, 0.009]))) == pytest.approx(0.003)
        assert float(curve_terms.excess_width(torch.tensor([0.001]))) == 0.0
        assert float(curve_terms.sparsity(torch.tensor([0.0, 1.0]))) == pytest.approx(0.5 * np.log(3.0))


class TestViewTurns:
    @pytest.mark.parametrize("per_step", [1, 2, 4])
    def test_each_view_comes_once_in_a_round(self, per_step: int) -> None:
        turns = ViewTurns(8, per_step, seed=3)
        rounds = [sorted(sum((turns.take() for _ in range(8 // per_step)), [])) for _ in range(5)]
        assert rounds == [list(range(8))] * 5 and turns.taken == 5 * 8 // per_step

    def test_all_of_them(self) -> None:
        for per_step in (0, 8, 20):
            assert ViewTurns(8, per_step, seed=0).take() == list(range(8))

    def test_the_seed_makes_the_order(self) -> None:
        orders = [[ViewTurns(30, 1, seed).take() for _ in range(1)] for seed in (0, 0, 1)]
        assert orders[0] == orders[1] != orders[2]


class TestCurveDriven:
    SETTINGS = preset("curve-driven", **{**QUICK, "iterations": 400, "learning_rate": 4e-3, "learning_rate_end": 4e-4})

    def test_settings_are_the_published(self) -> None:
        settings = preset("curve-driven")
        assert (settings.kernels_per_strut, settings.spread, settings.iterations) == (12, 0.5, 10_000)
        assert settings.values_by_strut and not settings.share_ends and settings.views_per_step == 1
        rates = settings.learning_rate, settings.learning_rate_end
        assert rates == pytest.approx((5e-4, 5e-4 * (5e-6 / 5e-4) ** (10_000 / 30_000)), rel=0.02)

    def test_follows_the_pictures_and_tears_the_joints(self, scene: Scene) -> None:
        plan, truth, *_ = scene
        found = fit(scene, self.SETTINGS)
        before = np.linalg.norm(plan.vertices - truth.vertices, axis=1).mean()
        assert np.linalg.norm(found.vertices - truth.vertices, axis=1).mean() < 0.6 * before
        ends, where = found.control_points[:, [0, 3]].reshape(-1, 3), plan.edges.ravel()
        for joint in range(plan.vertex_count):
            np.testing.assert_allclose(found.vertices[joint], ends[where == joint].mean(axis=0), atol=1e-9)
        assert np.linalg.norm(ends - found.vertices[where], axis=1).max() > 1e-2

    @pytest.mark.parametrize("name", ["curve-driven", "deformation-driven"])
    def test_twins_with_loose_ends_are_kept_by_their_files(self, name: str, scene: Scene, tmp_path: Path) -> None:
        plan, _, cameras, masks = scene
        changes = {**QUICK, "iterations": 30, "node_count": 20}
        twin = fit_views(plan, cameras, masks, name, changes=changes).twin
        write_twin(tmp_path, twin)
        again = read_twin(tmp_path)
        shown = again.as_wireframe(plan)
        np.testing.assert_allclose(shown.control_points, twin.control_points)
        ends = twin.control_points[:, [0, 3]]
        np.testing.assert_allclose(again.gap, np.linalg.norm(ends - twin.vertices[plan.edges], axis=2), atol=1e-6)
        assert not again.attached.any()

    def test_a_strut_has_one_width_and_one_opacity(self, scene: Scene) -> None:
        found = fit(scene, self.SETTINGS.replace(iterations=12))
        for values in (found.thickness, found.opacity):
            assert (values == values[:, :1]).all() and len(np.unique(values[:, 0])) > 12

    def test_ends_of_its_own(self, scene: Scene, tmp_path: Path) -> None:
        sampling = CurveSampling.of(scene[0], 4)
        field = FreeField.on_curves(sampling, 20.0, share_ends=False)
        values = scattered(4 * len(sampling.edges))
        with torch.no_grad():
            field.offsets[:] = values
        np.testing.assert_allclose(field.control_displacements(sampling).detach(), 20.0 * values.view(-1, 4, 3))
        save_field(tmp_path / "field.safetensors", field)
        again = load_field(tmp_path / "field.safetensors")
        assert isinstance(again, FreeField)
        np.testing.assert_array_equal(
            again.control_displacements(sampling), field.control_displacements(sampling).detach()
        )

    @pytest.mark.parametrize(
        "name", ["smoothness_weight", "opacity_weight", "width_weight", "connection_weight", "values_by_strut"]
    )
    def test_each_setting_counts(self, name: str, scene: Scene) -> None:
        settings = self.SETTINGS.replace(iterations=12, **({} if name == "values_by_strut" else {name: 1.0}))
        without = settings.replace(**{name: False if name == "values_by_strut" else 0.0})
        one, other = fit(scene, settings), fit(scene, without)
        changed = [
            not np.array_equal(getattr(one, key), getattr(other, key)) for key in ("control_points", "thickness")
        ]
        assert any(changed)


class TestDeformationDriven:
    SETTINGS = preset("deformation-driven", **{**QUICK, "node_count": 20})

    def test_settings_are_the_published(self) -> None:
        settings = preset("deformation-driven")
        assert (settings.node_count, settings.node_neighbours, settings.rigidity_weight) == (512, 3, 1e-4)
        assert (settings.kernels, settings.node_motion, settings.views_per_step) == ("free", "network", 1)
        assert settings.learning_rate * settings.learning_rate_scale == pytest.approx(8e-4)

    def test_starts_from_the_same_picture(self, scene: Scene) -> None:
        alike = {"views_per_step": 0, "iterations": 1, "rigidity_weight": 0.0}
        free = fit(scene, self.SETTINGS.replace(**alike))
        anchored = fit(scene, self.SETTINGS.replace(kernels="anchored", **alike))
        assert free.loss[0] == pytest.approx(anchored.loss[0], rel=1e-5)

    def test_kernels_start_on_the_plan(self, scene: Scene) -> None:
        still = {"learning_rate": 1e-11, "learning_rate_end": 1e-12, "thickness_rate": 1e-12, "iterations": 1}
        cloud = fit(scene, self.SETTINGS.replace(**still)).cloud
        layout = KernelLayout.even(scene[0].strut_count, 6)
        kernels = anchored_kernels(torch.from_numpy(np.array(scene[0].control_points)), layout)
        assert cloud is not None
        np.testing.assert_allclose(cloud.means, kernels.means, atol=1e-4)
        width = np.sqrt(np.linalg.eigvalsh(cloud.covariances)[:, 0])
        np.testing.assert_allclose(cloud.covariances, isotropic_covariance(kernels, torch.from_numpy(width)), atol=1e-3)

    def test_follows_the_pictures_and_leaves_the_curves(self, scene: Scene) -> None:
        plan, truth, *_ = scene
        settings = self.SETTINGS.replace(iterations=250)
        found = fit(scene, settings)
        u = np.linspace(0.0, 1.0, 9)
        gap = [
            np.linalg.norm(bezier.evaluate(curves, u) - bezier.evaluate(truth.control_points, u), axis=2).mean()
            for curves in (plan.control_points, found.control_points)
        ]
        assert gap[1] < 0.6 * gap[0]
        assert found.cloud is not None and found.cloud.means.shape == (6 * plan.strut_count, 3)
        at = bezier.evaluate(found.control_points, (np.arange(6) + 0.5) / 6)
        away = np.linalg.norm(at.reshape(-1, 3) - found.cloud.means, axis=1)
        assert away.max() > 1e-2  # no cubic holds all kernels of a strut
        assert type(found.field) is NodesField

    def test_same_seed_same_bits(self, scene: Scene) -> None:
        one, other = (fit(scene, self.SETTINGS) for _ in range(2))
        assert one.loss == other.loss and np.array_equal(one.control_points, other.control_points)
        assert one.cloud is not None and other.cloud is not None
        assert np.array_equal(one.cloud.means, other.cloud.means)

    @pytest.mark.parametrize(
        ("name", "value"), [("rigidity_weight", 1.0), ("node_motion", "free"), ("learn_thickness", False)]
    )
    def test_each_setting_counts(self, name: str, value: object, scene: Scene) -> None:
        one, other = (fit(scene, self.SETTINGS.replace(**changes)) for changes in ({}, {name: value}))
        assert not np.array_equal(one.control_points, other.control_points)

    @pytest.mark.parametrize("changes", [{"field": "network"}, {"adaptive_kernels": True}, {"kernels_per_strut": 3}])
    def test_free_kernels_need_nodes(self, changes: dict) -> None:
        with pytest.raises(InputError, match="kernels: are free"):
            preset("deformation-driven", **changes)
