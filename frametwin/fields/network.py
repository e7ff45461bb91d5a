"""The paper's deformation field: a small network that sees positions through sines and cosines.

Positions are shifted and scaled evenly so that the longest side of the box becomes -1..1, and written as

    [x, sin(w x), cos(w x), ..., sin(2^(L-1) w x), cos(2^(L-1) w x)],    3 + 6 L numbers (63 for L = 10),

with w = 1 as in the published code that the network resembles, or w = pi as in the paper's text (see
`frametwin.fields.network_options`). With pi the shortest wave of a frame of 200 mm is 0.4 mm long, far below the
distance of its struts.

Eight layers of 256 with ReLU follow; the fifth sees the encoding once more beside the 256 numbers of the
fourth, so it has 256 + 63 = 319 inputs. (The paper writes 349, which is the width of a public code base whose
network has 30 more inputs for time; with positions alone there is nothing to fill them with.) The last layer
starts at zero, so the first displacement is exactly zero everywhere. Its output is multiplied by half the
longest side to give mm.

The Laplacian needs no second derivatives by autograd. Almost everywhere the network is a linear function of
its encoding, hence Laplacian(f(encoding(x))) = J_f Laplacian(encoding(x)): the Laplacian of the encoding,
known in closed form, is pushed through the layers' matrices and the ReLU masks of the value.

References
----------
FrameTwin paper, section V.C. B. Mildenhall et al., "NeRF", 2021 (encoding). Z. Yang et al., "Deformable 3D
Gaussians", CVPR 2024 (the code whose network has the paper's width).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor, nn
from torch.nn import functional
from torch.nn.utils import skip_init

from frametwin.fields.base import checked_box
from frametwin.fields.network_options import ENCODINGS, INITIAL_WEIGHTS
from frametwin.fields.torch_field import TorchField


@dataclass(frozen=True)
class NetworkShape:
    """Size of the network; the default is the paper's.

    Attributes
    ----------
    octaves : L, frequencies of the encoding.
    layers : hidden layers.
    width : numbers in each of them.
    skip : index, from 0, of the hidden layer that sees the encoding once more.
    outputs : 3 for a field of displacements.
    """

    octaves: int = 10
    layers: int = 8
    width: int = 256
    skip: int = 4
    outputs: int = 3

    def __post_init__(self) -> None:
        if min(self.octaves, self.layers, self.width, self.outputs) < 1 or not 1 <= self.skip < self.layers:
            raise ValueError(f"{self} is not a network: sizes must be 1 or more, 1 <= skip < layers")

    @property
    def encoded(self) -> int:
        """Numbers that the encoding of one position has."""
        return 3 + 6 * self.octaves


class NetworkField(TorchField):
    """Displacements from a network.

    Parameters
    ----------
    box : (2, 3) mm, the computational domain.
    shape : size of the network.
    seed : of the hidden layers' first weights.
    encoding : one of `ENCODINGS`.
    initial_weights : one of `INITIAL_WEIGHTS`.

    Raises
    ------
    ValueError
        If the encoding or the way to start is unknown.

    Notes
    -----
    Hidden weights start uniform: as torch's default, within 1 / sqrt(inputs), and the biases too; or with the
    variance 2 / inputs (He et al., 2015), which keeps the signal's size through the layers, and biases of zero.
    """

    kind = "network"
    middle: Tensor
    half_side: Tensor

    def __init__(
        self,
        box: ArrayLike,
        shape: NetworkShape | None = None,
        seed: int = 0,
        *,
        encoding: str = "without_pi",
        initial_weights: str = "torch",
    ) -> None:
        super().__init__()
        if encoding not in ENCODINGS or initial_weights not in INITIAL_WEIGHTS:
            raise ValueError(f"{encoding!r} is no encoding, or {initial_weights!r} no way to start")
        self.encoding = encoding
        corners = checked_box(box)
        self.shape = shape or NetworkShape()
        inputs = [self.shape.encoded] + [self.shape.width] * (self.shape.layers - 1)
        inputs[self.shape.skip] += self.shape.encoded
        # Without torch's own first weights, which would be drawn from its global random state.
        self.hidden = nn.ModuleList([skip_init(nn.Linear, n, self.shape.width) for n in inputs])
        self.output = skip_init(nn.Linear, self.shape.width, self.shape.outputs)
        self.register_buffer("middle", torch.from_numpy(corners.mean(axis=0)).float())
        self.register_buffer("half_side", torch.tensor(0.5 * float(np.ptp(corners, axis=0).max())))
        self._start(torch.Generator().manual_seed(seed), initial_weights)

    def _start(self, generator: torch.Generator, initial_weights: str) -> None:
        with torch.no_grad():
            for layer in self._layers():
                bound = math.sqrt((6.0 if initial_weights == "he" else 1.0) / layer.in_features)
                layer.weight.uniform_(-bound, bound, generator=generator)
                if initial_weights == "he":
                    layer.bias.zero_()
                else:
                    layer.bias.uniform_(-bound, bound, generator=generator)
            self.output.weight.zero_()
            self.output.bias.zero_()

    def _layers(self) -> list[nn.Linear]:
        return [layer for layer in self.hidden if isinstance(layer, nn.Linear)]

    def forward(self, points: Tensor) -> Tensor:
        """Displacements (N, 3) in mm of the points (N, 3) in mm."""
        encoded = self._encode(self._normalise(points))
        value = encoded
        for i, layer in enumerate(self._layers()):
            if i == self.shape.skip:
                value = torch.cat([encoded, value], dim=-1)
            value = functional.relu_(layer(value))
        return self.half_side * self.output(value)

    def laplacian_of(self, points: Tensor) -> Tensor:
        """Vector Laplacian (N, 3) in 1 / mm; exact wherever no ReLU is at its kink."""
        x = self._normalise(points)
        encoded, second = self._encode(x), self._encode_laplacian(x)
        value, carried = encoded, second
        for i, layer in enumerate(self._layers()):
            if i == self.shape.skip:
                value = torch.cat([encoded, value], dim=-1)
                carried = torch.cat([second, carried], dim=-1)
            before = layer(value)
            value = functional.relu(before)
            carried = functional.linear(carried, layer.weight) * (before > 0.0)
        # Output in units of half a side, second derivatives per half a side squared.
        return functional.linear(carried, self.output.weight) / self.half_side

    def metadata(self) -> dict[str, str]:
        """The size of the network, and its encoding."""
        sizes = {name: str(getattr(self.shape, name)) for name in ("octaves", "layers", "width", "skip")}
        return {**sizes, "encoding": self.encoding}

    @classmethod
    def restore(cls, tensors: Mapping[str, np.ndarray], metadata: Mapping[str, str]) -> NetworkField:
        """Build the field from `tensors` and `metadata`."""
        shape = NetworkShape(**{name: int(metadata[name]) for name in ("octaves", "layers", "width", "skip")})
        encoding = metadata.get("encoding", "with_pi")  # files from before there was a choice do not tell
        field = cls(np.array([[-1.0] * 3, [1.0] * 3]), shape, encoding=encoding)
        state = {name: torch.from_numpy(np.array(value)) for name, value in tensors.items()}
        if any(value.dtype == torch.float64 for value in state.values()):
            field = field.double()
        field.load_state_dict(state)
        field.frozen()
        return field

    def _normalise(self, points: Tensor) -> Tensor:
        return (points - self.middle) / self.half_side

    def _phases(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Frequencies (L,) and phases (N, L, 3)."""
        frequencies = ENCODINGS[self.encoding] * 2.0 ** torch.arange(self.shape.octaves, dtype=x.dtype)
        return frequencies, x[:, None, :] * frequencies[:, None]

    def _encode(self, x: Tensor) -> Tensor:
        _, phases = self._phases(x)
        waves = torch.stack([torch.sin(phases), torch.cos(phases)], dim=2)  # (N, L, 2, 3)
        return torch.cat([x, waves.flatten(1)], dim=-1)

    def _encode_laplacian(self, x: Tensor) -> Tensor:
        """Laplacian of every number of the encoding; each depends on one coordinate alone."""
        frequencies, phases = self._phases(x)
        waves = torch.stack([torch.sin(phases), torch.cos(phases)], dim=2)
        bent = -(frequencies**2)[:, None, None] * waves
        return torch.cat([torch.zeros_like(x), bent.flatten(1)], dim=-1)
