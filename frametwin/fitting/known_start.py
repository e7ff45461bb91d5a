"""What is known before a fit: where the print is, and what an earlier fit found of its cameras, joints and struts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from frametwin.fields.base import DeformationField


@dataclass(frozen=True, eq=False)
class KnownStart:
    """From where a fit starts.

    Attributes
    ----------
    field : DeformationField
        That moves the plan to where the print is.
    cameras : (N, 10) array or None
        Freedoms of the cameras, which are then free from the first step on; see
        `frametwin.fitting.camera_freedoms`.
    joint_size : (V,) array or None
        Radius of the material at each joint relative to its thickest strut's, where joints have material of their own.
    cubic : (K,) array or None
        Struts that were found to be no more bent than a cubic can be; whether they are is not asked again.
    """

    field: DeformationField
    cameras: np.ndarray | None = None
    joint_size: np.ndarray | None = None
    cubic: np.ndarray | None = None

    def of_views(self, chosen: np.ndarray) -> KnownStart:
        """The same for some of the views."""
        return self if self.cameras is None else replace(self, cameras=self.cameras[chosen])
