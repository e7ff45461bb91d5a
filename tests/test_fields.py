"""Deformation fields: what they are between, at and beyond the things they are made of."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from frametwin.fields import DeformationField, enlarged_box
from frametwin.fields import node_weights as blending
from frametwin.fields.free import FreeField
from frametwin.fields.lattice import LatticeField, even_cells
from frametwin.fields.lattice_fit import fit_lattice
from frametwin.fields.lattice_torch import TrainableLattice
from frametwin.fields.network import NetworkField, NetworkShape
from frametwin.fields.network_options import ENCODINGS, INITIAL_WEIGHTS
from frametwin.fields.nodes import NodesField, turn_matrices
from frametwin.fields.sampling import CurveSampling
from frametwin.fields.torch_field import TorchField
from frametwin.geometry.wireframe import Wireframe

Floats = NDArray[np.float64]

BOX = np.array([[-10.0, 0.0, 5.0], [30.0, 50.0, 95.0]])
LEVELS = [(1, 1, 1), (2, 3, 4), (4, 4, 9)]


def inside(count: int = 40, seed: int = 0) -> Floats:
    return np.random.default_rng(seed).uniform(BOX[0], BOX[1], (count, 3))


def around(count: int = 40, seed: int = 0) -> Floats:
    """Points in a box of twice the size: inside, beside faces, edges and corners."""
    middle, side = BOX.mean(axis=0), np.ptp(BOX, axis=0)
    return middle + np.random.default_rng(seed).uniform(-1.0, 1.0, (count, 3)) * side


def random_lattice(seed: int = 0) -> LatticeField:
    field = LatticeField.zeros(BOX, LEVELS)
    return field.with_coefficients(np.random.default_rng(seed).normal(size=field.coefficients.shape))


def small_network(seed: int = 0, octaves: int = 3, width: int = 24, encoding: str = "without_pi") -> NetworkField:
    """A network whose last layer is not zero, in double precision."""
    shape = NetworkShape(octaves, layers=4, width=width, skip=2)
    field = NetworkField(BOX, shape, seed=seed, encoding=encoding).double()
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in field.output.parameters():
            parameter.normal_(generator=generator)
        for layer in field.hidden:
            layer.bias.normal_(generator=generator)
    return field


def random_nodes() -> NodesField:
    field = NodesField(inside(30, seed=5), scale=20.0, neighbours=30)  # all of them: smooth everywhere
    generator = torch.Generator().manual_seed(3)
    with torch.no_grad():
        for parameter in (field.translations, field.rotations):
            parameter.normal_(std=0.3, generator=generator)
        field.log_widths += 0.5
    return field


def random_free() -> FreeField:
    field = FreeField(inside(6, seed=6), scale=20.0)  # no more anchors than neighbours: smooth everywhere
    with torch.no_grad():
        field.offsets.normal_(generator=torch.Generator().manual_seed(4))
    return field


def second_differences(field: DeformationField, points: Floats, step: float) -> Floats:
    total = -6.0 * field.evaluate(points)
    for axis in np.eye(3):
        total = total + field.evaluate(points + step * axis) + field.evaluate(points - step * axis)
    return total / step**2


class TestLattice:
    @pytest.mark.parametrize("orders", [(1, 0, 0), (0, 1, 0), (0, 0, 1)])
    def test_gradients_are_those_of_finite_differences(self, orders: tuple[int, int, int]) -> None:
        field, points, step = random_lattice(), around(), 1e-5
        shift = step * np.array(orders)
        expected = (field.evaluate(points + shift) - field.evaluate(points - shift)) / (2.0 * step)
        axis = orders.index(1)
        found = field.gradient_matrix(points, axis) @ field.coefficients
        np.testing.assert_allclose(found, expected, atol=1e-7)
        np.testing.assert_array_equal(found, field.derivative_matrix(points, orders) @ field.coefficients)

    @pytest.mark.parametrize("points", [inside(seed=1), around(seed=2)], ids=["inside", "around"])
    def test_laplacian_is_that_of_finite_differences(self, points: Floats) -> None:
        field = random_lattice()
        expected = second_differences(field, points, 1e-3)
        np.testing.assert_allclose(field.laplacian(points), expected, atol=2e-4 * np.abs(expected).max())

    def test_mixed_derivatives(self) -> None:
        field, points, step = random_lattice(), inside(), 1e-4
        x, y = step * np.eye(3)[0], step * np.eye(3)[1]
        corners = [(x + y, 1.0), (x - y, -1.0), (y - x, -1.0), (-x - y, 1.0)]
        expected = sum(sign * field.evaluate(points + shift) for shift, sign in corners) / (4.0 * step**2)
        found = field.derivative_matrix(points, (1, 1, 0)) @ field.coefficients
        np.testing.assert_allclose(found, expected, atol=1e-5)

    def test_constants_are_constant_everywhere(self) -> None:
        field = LatticeField.zeros(BOX, LEVELS)
        field = field.with_coefficients(np.ones_like(field.coefficients))
        np.testing.assert_allclose(field.evaluate(around()), len(LEVELS), rtol=1e-12)
        np.testing.assert_allclose(field.laplacian(around()), 0.0, atol=1e-12)

    def test_one_cell_holds_every_cubic(self) -> None:
        points = inside(200)
        x, y, z = points.T / 30.0
        cubic = np.column_stack([1.0 + x * y * z - z**3, x**3 * y**2, 2.0 * y - x**2 * z**3])
        field = fit_lattice(points, cubic, None, BOX, [(1, 1, 1)], bending=0.0)
        np.testing.assert_allclose(field.evaluate(inside(50, seed=9)), cubic_at(inside(50, seed=9)), atol=1e-3)

    def test_affine_motions_carry_on_outside(self) -> None:
        matrix = np.array([[0.0, -0.1, 0.2], [0.1, 0.0, 0.05], [-0.2, -0.05, 0.3]])
        shift = np.array([1.0, 2.0, 3.0])
        field = fit_lattice(inside(300), inside(300) @ matrix.T + shift, None, BOX, LEVELS, bending=1.0)
        np.testing.assert_allclose(field.evaluate(around()), around() @ matrix.T + shift, atol=1e-4)
        np.testing.assert_allclose(field.laplacian(around()), 0.0, atol=1e-6)

    def test_faces_belong_to_both_sides(self) -> None:
        field = random_lattice()
        for face in (0, 1):
            points = inside()
            points[:, 2] = BOX[face, 2]
            beside = points + np.array([0.0, 0.0, 1e-9 * (2 * face - 1)])
            np.testing.assert_allclose(field.evaluate(points), field.evaluate(beside), atol=1e-8)

    def test_levels_add_up(self) -> None:
        field = random_lattice()
        parts = [LatticeField(BOX, [level]).evaluate(around()) for level in field.levels]
        np.testing.assert_allclose(field.evaluate(around()), np.sum(parts, axis=0), atol=1e-12)
        assert field.resolutions == tuple(LEVELS)

    def test_even_cells(self) -> None:
        assert even_cells(BOX, 9) == (4, 5, 9)
        assert even_cells(BOX, 1) == (1, 1, 1)

    @pytest.mark.parametrize(
        "levels", [[], [np.zeros((3, 4, 4, 3))], [np.zeros((4, 4, 4))], [np.full((4, 4, 4, 3), np.nan)]]
    )
    def test_refuses_what_is_no_lattice(self, levels: list) -> None:
        with pytest.raises(ValueError, match=r"level|finite"):
            LatticeField(BOX, levels)

    def test_refuses_boxes_without_volume(self) -> None:
        with pytest.raises(ValueError, match="volume"):
            LatticeField.zeros([[0.0, 0.0, 0.0], [1.0, 0.0, 1.0]], [(1, 1, 1)])

    def test_refuses_other_numbers_of_coefficients(self) -> None:
        with pytest.raises(ValueError, match="coefficients"):
            random_lattice().with_coefficients(np.zeros((7, 3)))


def cubic_at(points: Floats) -> Floats:
    x, y, z = points.T / 30.0
    return np.column_stack([1.0 + x * y * z - z**3, x**3 * y**2, 2.0 * y - x**2 * z**3])


class TestLatticeFit:
    def smooth(self, points: Floats) -> Floats:
        return np.sin(points / 25.0) * [1.0, 2.0, -1.0]

    def test_follows_smooth_displacements(self) -> None:
        points = inside(2000)
        field = fit_lattice(points, self.smooth(points), None, BOX, LEVELS, bending=1e-9)
        assert np.abs(field.evaluate(inside(200, seed=8)) - self.smooth(inside(200, seed=8))).max() < 0.01

    def test_finer_levels_converge_with_the_fourth_power(self) -> None:
        points = inside(6000)
        errors = []
        for longest in (4, 8, 16):
            cells = even_cells(BOX, longest)
            field = fit_lattice(points, self.smooth(points), None, BOX, [cells], bending=0.0)
            errors.append(np.abs(field.evaluate(points) - self.smooth(points)).mean())
        assert errors[0] / errors[1] > 10.0 and errors[1] / errors[2] > 10.0

    def test_bending_straightens_and_stretch_flattens(self) -> None:
        points = inside(300)
        noise = np.random.default_rng(1).normal(size=points.shape)
        energies = []
        for weight in (1e-9, 1e-6, 1e-3):
            field = fit_lattice(points, noise, None, BOX, LEVELS, bending=weight)
            energies.append(np.square(field.laplacian(points)).sum())
        assert energies[0] > 10.0 * energies[1] > 100.0 * energies[2]
        flat = fit_lattice(points, noise, None, BOX, LEVELS, stretch=1e3).evaluate(around())
        np.testing.assert_allclose(flat, np.broadcast_to(noise.mean(axis=0), flat.shape), atol=5e-2)

    def test_weights_choose_between_contradictions(self) -> None:
        points = np.repeat(inside(100), 2, axis=0)
        values = np.tile([[1.0], [3.0]], (100, 3))
        field = fit_lattice(points, values, np.tile([3.0, 1.0], 100), BOX, [(1, 1, 1)])
        np.testing.assert_allclose(field.evaluate(inside(20)), 1.5, atol=1e-6)

    def test_size_of_the_frame_does_not_matter(self) -> None:
        points = inside(300)
        noise = np.random.default_rng(1).normal(size=points.shape)
        small = fit_lattice(points, noise, None, BOX, LEVELS, bending=1e-5, stretch=1e-4)
        large = fit_lattice(7.0 * points, 7.0 * noise, None, 7.0 * BOX, LEVELS, bending=1e-5, stretch=1e-4)
        np.testing.assert_allclose(large.evaluate(7.0 * points), 7.0 * small.evaluate(points), rtol=1e-6, atol=1e-6)

    @pytest.mark.parametrize(
        "weights", [np.zeros(10), -np.ones(10), np.ones(9), np.full(10, np.nan)], ids=["0", "-", "9", "nan"]
    )
    def test_refuses_weights(self, weights: Floats) -> None:
        with pytest.raises(ValueError, match="weights"):
            fit_lattice(inside(10), inside(10), weights, BOX, [(1, 1, 1)])

    def test_refuses_too_many_coefficients(self) -> None:
        with pytest.raises(ValueError, match="coarser"):
            fit_lattice(inside(10), inside(10), None, BOX, [(40, 40, 40)])


class TestNetwork:
    @pytest.mark.parametrize("initial_weights", INITIAL_WEIGHTS)
    def test_starts_at_exactly_zero(self, initial_weights: str) -> None:
        field = NetworkField(BOX, initial_weights=initial_weights)
        assert not field.evaluate(around()).any()
        assert not field.laplacian(around()).any()

    def test_size_is_the_papers(self) -> None:
        field = NetworkField(BOX)
        assert [layer.in_features for layer in field.hidden] == [63, 256, 256, 256, 319, 256, 256, 256]
        assert all(layer.out_features == 256 for layer in field.hidden)

    @pytest.mark.parametrize(("encoding", "base"), [("without_pi", 1.0), ("with_pi", math.pi)])
    def test_encoding_has_the_octaves_of_its_name(self, encoding: str, base: float) -> None:
        field = NetworkField(BOX, encoding=encoding).double()
        x = torch.tensor([[0.1, -0.3, 0.7]]).double()
        parts = [x]
        for octave in range(10):
            parts += [torch.sin(2.0**octave * base * x), torch.cos(2.0**octave * base * x)]
        torch.testing.assert_close(field._encode(x), torch.cat(parts, dim=-1))

    @pytest.mark.parametrize(("initial_weights", "variance"), [("torch", 1.0 / 3.0), ("he", 2.0)])
    def test_first_weights_have_the_variance_of_their_name(self, initial_weights: str, variance: float) -> None:
        for layer in NetworkField(BOX, initial_weights=initial_weights).hidden:
            assert layer.in_features * float(layer.weight.detach().var()) == pytest.approx(variance, rel=0.05)
            assert bool(layer.bias.any()) == (initial_weights == "torch")

    def test_the_default_weights_are_drawn_as_torch_draws_them(self) -> None:
        ours = torch.cat([layer.weight.detach().flatten() for layer in NetworkField(BOX).hidden])
        with torch.random.fork_rng():
            torchs = torch.cat([torch.nn.Linear(256, 256).weight.detach().flatten() for _ in range(4)])
        edge = 1.0 / 16.0  # of what torch draws for 256 inputs, the fewest but the first layer's
        assert float(torchs.abs().max()) == pytest.approx(edge, rel=1e-3)
        assert float(ours[63 * 256 : (63 + 256) * 256].abs().max()) == pytest.approx(edge, rel=1e-3)

    def test_refuses_what_is_no_choice(self) -> None:
        for wrong in ({"encoding": "letter"}, {"initial_weights": "zero"}):
            with pytest.raises(ValueError, match="no encoding, or"):
                NetworkField(BOX, **wrong)

    def test_longest_side_becomes_minus_one_to_one(self) -> None:
        field = NetworkField(BOX).double()
        ends = field._normalise(torch.tensor([[10.0, 25.0, 5.0], [10.0, 25.0, 95.0], [30.0, 25.0, 50.0]]).double())
        expected = torch.tensor([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [20.0 / 45.0, 0.0, 0.0]]).double()
        torch.testing.assert_close(ends, expected)

    @pytest.mark.parametrize("encoding", ENCODINGS)
    def test_laplacian_is_the_trace_of_the_hessian(self, encoding: str) -> None:
        field = small_network(octaves=10, encoding=encoding)
        points = torch.from_numpy(inside(6))
        expected = torch.stack(
            [
                torch.stack(
                    [
                        torch.autograd.functional.hessian(lambda p, k=k: field(p[None])[0, k], point).trace()
                        for k in range(3)
                    ]
                )
                for point in points
            ]
        )
        torch.testing.assert_close(field.laplacian_of(points), expected, rtol=1e-8, atol=1e-8)

    # Slow waves take longer steps, or the differences drown in rounding.
    @pytest.mark.parametrize(("encoding", "step"), [("without_pi", 5e-4), ("with_pi", 1e-4)])
    def test_laplacian_is_that_of_finite_differences(self, encoding: str, step: float) -> None:
        field, points = small_network(encoding=encoding), inside(60)
        expected = second_differences(field, points, step)
        difference = np.abs(field.laplacian(points) - expected).max(axis=1)
        # A step across the kink of a ReLU sees its jump in slope: rare, and then far off.
        assert np.median(difference) < 1e-4 * np.abs(expected).max()
        assert (difference < 1e-2 * np.abs(expected).max()).mean() > 0.9

    def test_gradients_of_the_laplacian(self) -> None:
        field, points = small_network(width=6), torch.from_numpy(inside(5))
        names = [name for name, _ in field.named_parameters() if "weight" in name]

        def loss(*weights: torch.Tensor) -> torch.Tensor:
            values = {**dict(field.named_parameters()), **dict(zip(names, weights, strict=True))}
            return torch.func.functional_call(_Laplacian(field), {f"field.{n}": v for n, v in values.items()}, points)

        weights = [dict(field.named_parameters())[name].detach().clone().requires_grad_() for name in names]
        assert torch.autograd.gradcheck(loss, weights, atol=1e-4, rtol=1e-3, fast_mode=True)

    def test_the_seed_decides(self) -> None:
        first, same, other = (NetworkField(BOX, seed=seed).tensors() for seed in (1, 1, 2))
        assert all(np.array_equal(first[name], same[name]) for name in first)
        assert not np.array_equal(first["hidden.0.weight"], other["hidden.0.weight"])

    def test_global_random_state_is_left_alone(self) -> None:
        before = torch.get_rng_state()
        NetworkField(BOX, seed=5)
        assert torch.equal(before, torch.get_rng_state())

    @pytest.mark.parametrize("size", [(0, 8, 4, 2), (3, 4, 8, 4), (3, 4, 8, 0)])
    def test_refuses_what_is_no_network(self, size: tuple[int, ...]) -> None:
        with pytest.raises(ValueError, match="network"):
            NetworkShape(*size)


class _Laplacian(torch.nn.Module):
    def __init__(self, field: TorchField) -> None:
        super().__init__()
        self.field = field

    def forward(self, points: torch.Tensor) -> torch.Tensor:
        return self.field.laplacian_of(points)


class TestNodes:
    def test_starts_at_exactly_zero(self) -> None:
        assert not NodesField(inside(30), scale=20.0).evaluate(around()).any()

    def test_laplacian_is_that_of_finite_differences(self) -> None:
        field, points = random_nodes(), inside()
        expected = second_differences(field, points, 1e-3)
        np.testing.assert_allclose(field.laplacian(points), expected, atol=1e-4 * np.abs(expected).max())

    def test_a_common_rigid_motion_is_kept(self) -> None:
        field = NodesField(inside(30), scale=20.0)
        turn = torch.tensor([0.3, -0.2, 0.5], dtype=torch.float64)
        matrix = turn_matrices(turn[None])[0]
        shift = torch.tensor([4.0, -2.0, 1.0], dtype=torch.float64)
        with torch.no_grad():
            field.rotations[:] = turn
            field.translations[:] = (field.nodes @ matrix.T + shift) / 20.0
        expected = around() @ matrix.numpy().T + shift.numpy()
        np.testing.assert_allclose(field.evaluate(around()), expected, atol=1e-10)

    def test_turns_are_rotations(self) -> None:
        vectors = torch.from_numpy(np.random.default_rng(0).normal(size=(20, 3))) * torch.logspace(-6, 0, 20)[:, None]
        turned = turn_matrices(vectors) + torch.eye(3)
        angle = vectors.norm(dim=1)
        torch.testing.assert_close(turned, torch.linalg.matrix_exp(_cross(vectors)), rtol=0.0, atol=1e-12)
        torch.testing.assert_close(torch.einsum("nij,nj->ni", turned, vectors), vectors, rtol=0.0, atol=1e-12)
        trace = turned.diagonal(dim1=1, dim2=2).sum(1)
        torch.testing.assert_close(trace, 1.0 + 2.0 * torch.cos(angle), rtol=0.0, atol=1e-12)

    def test_turns_have_gradients_at_rest(self) -> None:
        vectors = torch.zeros(2, 3, dtype=torch.float64, requires_grad=True)
        assert torch.autograd.gradcheck(turn_matrices, (vectors,))

    def test_far_away_the_nearest_node_leads(self) -> None:
        field = random_nodes()
        away = np.array([[1e4, 0.0, 0.0]])
        assert np.isfinite(field.evaluate(away)).all() and np.isfinite(field.laplacian(away)).all()


def _cross(vectors: torch.Tensor) -> torch.Tensor:
    x, y, z = vectors.unbind(-1)
    zero = torch.zeros_like(x)
    return torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], dim=-1).view(-1, 3, 3)


class TestFree:
    def test_laplacian_is_that_of_finite_differences(self) -> None:
        field, points = random_free(), inside()
        expected = second_differences(field, points, 1e-3)
        np.testing.assert_allclose(field.laplacian(points), expected, atol=1e-4 * np.abs(expected).max())

    def test_equal_offsets_shift_everything(self) -> None:
        field = FreeField(inside(50), scale=20.0)
        assert not field.evaluate(around()).any()
        with torch.no_grad():
            field.offsets[:] = torch.tensor([0.1, 0.2, -0.3])
        np.testing.assert_allclose(field.evaluate(around()), np.tile([2.0, 4.0, -6.0], (40, 1)), atol=1e-12)

    def test_control_points_are_the_parameters(self, curved_frame: Wireframe) -> None:
        sampling = CurveSampling.of(curved_frame, 5)
        field = FreeField.on_curves(sampling, scale=2.0)
        joints = curved_frame.vertex_count
        with torch.no_grad():
            field.offsets[3] = 1.0  # a joint
            field.offsets[joints + 2 * 4 + 1] = torch.tensor([0.0, 5.0, 0.0])  # strut 4, third control point
        moved = field.control_displacements(sampling).detach().numpy()
        expected = np.zeros_like(moved)
        for end, column in enumerate((0, 3)):
            expected[curved_frame.edges[:, end] == 3, column] = 2.0
        expected[4, 2] = [0.0, 10.0, 0.0]
        np.testing.assert_array_equal(moved, expected)


class TestTrainableLattice:
    def test_equals_the_lattice(self) -> None:
        lattice = random_lattice()
        field = TrainableLattice(lattice, scale=7.0)
        np.testing.assert_allclose(field.evaluate(around()), lattice.evaluate(around()), atol=1e-10)
        np.testing.assert_allclose(field.laplacian(around()), lattice.laplacian(around()), atol=1e-10)
        np.testing.assert_allclose(field.frozen().coefficients, lattice.coefficients, atol=1e-12)

    def test_gradients(self) -> None:
        field = TrainableLattice(LatticeField.zeros(BOX, [(1, 1, 1)]), scale=3.0)
        points, weight = torch.from_numpy(inside(8)), torch.from_numpy(inside(8, seed=3))
        loss = (weight * field(points)).sum() + (weight * field.laplacian_of(points)).sum()
        (grad,) = torch.autograd.grad(loss, field.coefficients)
        lattice = field.frozen()
        matrix = lattice.basis_matrix(inside(8)) + lattice.laplacian_matrix(inside(8))
        np.testing.assert_allclose(grad, 3.0 * matrix.T @ inside(8, seed=3), rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("kind", ["network", "lattice", "nodes"])
def test_control_points_are_the_refit_of_moved_samples(kind: str, curved_frame: Wireframe) -> None:
    field: TorchField = {
        "network": lambda: small_network(),
        "lattice": lambda: TrainableLattice(random_lattice(), scale=3.0),
        "nodes": lambda: random_nodes(),
    }[kind]()
    sampling = CurveSampling.of(curved_frame, 9)
    for _ in range(2):  # before and after preparation
        moved = field.control_displacements(sampling).detach().numpy()
        displaced = field.evaluate(sampling.points)
        v = np.arange(10) / 9
        inner = displaced[curved_frame.vertex_count :].reshape(-1, 8, 3)
        for k, (start, end) in enumerate(curved_frame.edges):
            np.testing.assert_allclose(moved[k, [0, 3]], displaced[[start, end]], atol=1e-10)
            # Least squares with fixed ends: the residual is orthogonal to the free basis functions.
            basis = np.stack([3 * v * (1 - v) ** 2, 3 * v**2 * (1 - v)], axis=1)
            ends = np.outer((1 - v) ** 3, moved[k, 0]) + np.outer(v**3, moved[k, 3])
            samples = np.concatenate([displaced[[start]], inner[k], displaced[[end]]])
            residual = samples - ends - basis @ moved[k, 1:3]
            np.testing.assert_allclose(basis.T @ residual, 0.0, atol=1e-8)
        field.prepare(sampling)


def test_blend_weights_sum_to_one_and_derive() -> None:
    rng = np.random.default_rng(0)
    nodes, widths = (
        torch.from_numpy(rng.normal(size=(1, 5, 3))),
        torch.from_numpy(rng.uniform(0.4, 1.5, (1, 5))),
    )
    x = torch.from_numpy(rng.normal(size=3))
    w, slope, bend = blending.weight_derivatives(x - nodes, widths)
    torch.testing.assert_close(w.sum(), torch.tensor(1.0).double())
    for i in range(5):

        def weight(p: torch.Tensor, i: int = i) -> torch.Tensor:
            return blending.weights(p - nodes, widths)[0, i]

        torch.testing.assert_close(slope[0, i], torch.autograd.functional.jacobian(weight, x))
        torch.testing.assert_close(bend[0, i], torch.autograd.functional.hessian(weight, x).trace())


def test_spread_out_nodes_cover_the_points() -> None:
    points = inside(500)
    chosen = points[blending.spread_out(points, 40)]
    gaps = np.linalg.norm(points[:, None] - chosen, axis=2).min(axis=1)
    between = blending.node_spacing(chosen)
    assert gaps.max() <= between.min() + 1e-12  # the property that defines farthest-point sampling
    assert len(blending.spread_out(points[:3], 10)) == 3


def test_enlarged_box_grows_by_the_longest_side() -> None:
    np.testing.assert_allclose(enlarged_box([[0, 0, 0], [10, 20, 0]], 0.1), [[-2, -2, -2], [12, 22, 2]])


@pytest.mark.parametrize("points", [np.zeros(3), np.zeros((2, 2)), np.zeros((1, 2, 3))])
@pytest.mark.parametrize("field", [random_lattice(), small_network()], ids=["lattice", "network"])
def test_refuses_points_of_another_shape(field: DeformationField, points: Floats) -> None:
    with pytest.raises(ValueError, match="points"):
        field.evaluate(points)
