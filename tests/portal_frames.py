"""Frames in a plane as textbooks have them, integrated through time by SciPy: an oracle that shares no code with us.

Euler-Bernoulli frame elements with even loads (W. McGuire, R. Gallagher, R. Ziemian, "Matrix structural analysis",
2nd ed., 2000, ch. 4 and 5), three freedoms a node: x, z, and the rotation from x towards z. Viscous members by the
correspondence of Stokes and Rayleigh: their rates are the displacements of elastic ones with the inverse of the
fluidity for Young's modulus.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp


@dataclass(frozen=True)
class Viscous:
    """A round member of viscous material: GPa and kg would do as well, but all is in MPa, mm, N and s."""

    young: float
    radius: float
    weight: float
    pull: float
    axial: float
    flow: float
    hardening: float
    rest: float

    def fluidity(self, age: np.ndarray) -> np.ndarray:
        """Rate at which it flows, relative to its bending at once when hard, per second; none before it is laid."""
        rate = self.flow / self.hardening * (np.exp(-np.maximum(age, 0.0) / self.hardening) + self.rest)
        return np.where(age > 0.0, rate, 0.0)


def member(start: np.ndarray, end: np.ndarray, one: Viscous) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness (6, 6) and equivalent nodal loads (6,) of a member in world axes, at a fluidity of 1."""
    (dx, dz), length = end - start, float(np.hypot(*(end - start)))
    c, s = dx / length, dz / length
    area, inertia = np.pi * one.radius**2, np.pi * one.radius**4 / 4.0
    a = one.axial * one.young * area / length
    b = one.young * inertia / length**3
    local = np.array(
        [
            [a, 0, 0, -a, 0, 0],
            [0, 12 * b, 6 * b * length, 0, -12 * b, 6 * b * length],
            [0, 6 * b * length, 4 * b * length**2, 0, -6 * b * length, 2 * b * length**2],
            [-a, 0, 0, a, 0, 0],
            [0, -12 * b, -6 * b * length, 0, 12 * b, -6 * b * length],
            [0, 6 * b * length, 2 * b * length**2, 0, -6 * b * length, 4 * b * length**2],
        ]
    )
    turn = np.kron(np.eye(2), np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]]))
    load = one.weight * area * np.array([one.pull, -1.0])
    along, across = c * load[0] + s * load[1], -s * load[0] + c * load[1]
    ends = (
        np.array([along / 2, across / 2, across * length / 12, along / 2, across / 2, -across * length / 12]) * length
    )
    return turn.T @ local @ turn, turn.T @ ends


def crept(
    nodes: np.ndarray, members: list[tuple[int, int]], held: list[int], one: Viscous, laid: list[float], end: float
) -> np.ndarray:
    """Displacements (N, 2) of the nodes (N, 2) at the time ``end``, members being laid at the times ``laid``."""
    parts = [member(nodes[a], nodes[b], one) for a, b in members]
    rows = [np.r_[3 * a : 3 * a + 3, 3 * b : 3 * b + 3] for a, b in members]
    free = np.setdiff1d(np.arange(3 * len(nodes)), [3 * node + k for node in held for k in range(3)])

    def rate(time: float, _: np.ndarray) -> np.ndarray:
        stiffness, force = np.zeros((3 * len(nodes),) * 2), np.zeros(3 * len(nodes))
        for (k, load), row, since in zip(parts, rows, laid, strict=True):
            fluid = float(one.fluidity(np.array(time - since)))
            if fluid > 0.0:
                stiffness[np.ix_(row, row)] += k / fluid
                force[row] += load
        there = free[np.diag(stiffness)[free] > 0.0]
        moved = np.zeros(3 * len(nodes))
        moved[there] = np.linalg.solve(stiffness[np.ix_(there, there)], force[there])
        return moved

    state, moments = np.zeros(3 * len(nodes)), sorted({*laid, end})
    for before, after in zip(moments[:-1], moments[1:], strict=True):
        span = (before + 1e-9, after)
        state = solve_ivp(rate, span, state, method="LSODA", rtol=1e-8, atol=1e-10).y[:, -1]
    return state.reshape(-1, 3)[:, :2]
