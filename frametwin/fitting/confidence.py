"""How well the pictures determine each strut, from the curvature of the fit itself."""

from __future__ import annotations

import numpy as np

from frametwin.fitting.camera_freedoms import NOISE
from frametwin.fitting.elastic import INNER, ElasticFrame
from frametwin.fitting.stubs import STUB
from frametwin.raster.rods import Terms

HALF = 0.1
"""Standard deviation, as a share of the strut's radius, at which the confidence is one half."""


BOW = 0.05
"""Standard deviation, as a share of its length, of how far a strut bows between joints that are known. It says
something of stubs that are hidden behind the joints they connect, and next to nothing of slender struts. A stub bows
less than in proportion: what bends a strut bends it with the square of its length."""


def standard_deviation(elastic: ElasticFrame, terms: Terms) -> np.ndarray:
    """(E,) mm: the least certain direction of each strut, at its joints or its middle.

    A joint's information is that of all struts that meet there and of its disc: struts of several directions
    tell together what each alone hides along itself, and no camera sees along its own line of sight. The middle's is
    the strut's own, across the strut (along it, no silhouette ever shows a motion), and that no strut bows far.
    Neighbouring joints are taken as known, so this is the least error that the pictures leave, not all of it.
    """
    joints = terms.joint_hessian.copy()
    for side in (0, 1):
        corner = slice(0, 3) if side == 0 else slice(9, 12)
        np.add.at(joints, elastic.edges[:, side], terms.hessian[:, corner, corner])
    joint = np.linalg.eigvalsh(joints)[:, 0]  # (V,) least information
    shift = np.tile(np.eye(3), (2, 1))  # both inner points move together
    middle = np.einsum("ai,eab,bj->eij", shift, terms.hessian[:, INNER, INNER], shift)
    chord = elastic.frame.control_points[:, 3] - elastic.frame.control_points[:, 0]
    tangent = chord / np.linalg.norm(chord, axis=1)[:, None]
    along = tangent[:, :, None] * tangent[:, None, :]
    across = np.eye(3) - along
    trace = np.trace(middle, axis1=1, axis2=2)[:, None, None]
    seen = across @ middle @ across + along * trace  # the direction along the strut does not count
    length = np.linalg.norm(chord, axis=1)
    straight = (NOISE / (BOW * length * np.minimum(1.0, length / (STUB * elastic.frame.radius)))) ** 2
    least = np.minimum(joint[elastic.edges].min(axis=1), np.linalg.eigvalsh(seen)[:, 0] + straight)
    return NOISE / np.sqrt(np.maximum(least, 1e-12))


def confidence(elastic: ElasticFrame, terms: Terms) -> np.ndarray:
    """(E,) 0..1: near 1 where the pictures fix a strut to a small part of its radius, near 0 where they cannot."""
    deviation = standard_deviation(elastic, terms) / (HALF * elastic.frame.radius)
    return 1.0 / (1.0 + deviation**2)
