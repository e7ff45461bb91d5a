"""Control nodes whose motions are not learnt one by one, but come from one network of the nodes' places.

This is how sparse-controlled splatting has it: neighbouring nodes then move alike, as far as the network finds it easy.
When the fit is over the motions are plain numbers again, and the field a `NodesField`.

References
----------
Y. Huang et al., "SC-GS: sparse-controlled Gaussian splatting", CVPR 2024 (a network of 8 layers of 256 numbers).
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from frametwin.fields.base import DeformationField
from frametwin.fields.network import NetworkField, NetworkShape
from frametwin.fields.nodes import NodesField, turn_matrices

UNIT_BOX = np.array([[-1.0] * 3, [1.0] * 3])


class SteeredNodes(NodesField):
    """Blended rigid motions of nodes, which a network gives.

    Parameters
    ----------
    nodes, scale, neighbours
        See `NodesField`; widths start at a tenth of the whole, 0.2 of the scale, as published.
    seed : of the network's first weights.
    encoding, initial_weights : see `NetworkField`.
    """

    def __init__(
        self, nodes: ArrayLike, scale: float, neighbours: int, seed: int = 0, *, encoding: str, initial_weights: str
    ) -> None:
        super().__init__(nodes, scale, neighbours)
        with torch.no_grad():
            self.log_widths.fill_(float(np.log(0.2 * scale)))
        self.translations.requires_grad_(False)
        self.rotations.requires_grad_(False)
        shape = NetworkShape(outputs=6)
        self.network = NetworkField(UNIT_BOX, shape, seed, encoding=encoding, initial_weights=initial_weights)

    def _steered(self) -> tuple[Tensor, Tensor]:
        """Translations and rotation vectors (M, 3)."""
        middle = 0.5 * (self.nodes.amin(0) + self.nodes.amax(0))
        out = self.network(((self.nodes - middle) / self.scale).to(self.network.dtype)).to(self.nodes.dtype)
        return out[:, :3], out[:, 3:]

    def motions(self) -> tuple[Tensor, Tensor]:
        """Translations (M, 3) in units of the scale, and R - I (M, 3, 3)."""
        translations, rotations = self._steered()
        return translations, turn_matrices(rotations)

    def frozen(self) -> DeformationField:
        """The same nodes with the motions that the network gives them."""
        field = NodesField(self.nodes.numpy(), float(self.scale), self.neighbours)
        with torch.no_grad():
            translations, rotations = self._steered()
            for parameter, value in (
                (field.translations, translations),
                (field.rotations, rotations),
                (field.log_widths, self.log_widths),
            ):
                parameter.copy_(value)
        return field.frozen()
