"""Compiled loops of beams between joints: their stiffness and loads summed into the matrix and the forces of a frame.

The same elements as `frametwin.mechanics.beams` has them, without a matrix of each being kept: see there for notation.

Helpers and constants are in this file too, and nowhere else: numba keeps machine code until the file of the function
that is called changes, and would not notice an edit elsewhere (``tests/test_compiled_code.py`` sees to it).
"""

from __future__ import annotations

import numba as nb
import numpy as np


@nb.njit(cache=True, error_model="numpy")
def assemble(points, edges, sections, load, slots, entries, force):
    """Sum the elements of beams.

    points (V, 3) mm; edges (N, 2); sections (3, N): axial N, bending and twisting N mm^2; load (N, 3) N/mm; slots
    (144 N,) where the entries of the elements (12, 12) go, see `frametwin.mechanics.blocks.BlockPattern`. Out: entries
    (S,) of the matrix, and force (6 V,) with the moments.
    """
    entries[:] = 0.0
    force[:] = 0.0
    t, block = np.empty(3), np.empty((4, 3, 3))  # block: force, couple, near, far
    for n in range(len(edges)):
        a, b = edges[n, 0], edges[n, 1]
        length = 0.0
        for i in range(3):
            t[i] = points[b, i] - points[a, i]
            length += t[i] * t[i]
        length = np.sqrt(length)
        for i in range(3):
            t[i] /= length
        stretch, bend, twist = sections[0, n] / length, sections[1, n] / length, sections[2, n] / length
        sway, turn = 12.0 * bend / (length * length), 6.0 * bend / length
        for i in range(3):
            for j in range(3):
                along = t[i] * t[j]
                across = (1.0 if i == j else 0.0) - along
                block[0, i, j] = stretch * along + sway * across
                block[2, i, j] = 4.0 * bend * across + twist * along
                block[3, i, j] = 2.0 * bend * across - twist * along
            block[1, i, i] = 0.0
        block[1, 0, 1], block[1, 1, 0] = -turn * t[2], turn * t[2]
        block[1, 0, 2], block[1, 2, 0] = turn * t[1], -turn * t[1]
        block[1, 1, 2], block[1, 2, 1] = -turn * t[0], turn * t[0]
        for i in range(3):
            first = 144 * n + 12 * i
            for j in range(3):
                push, couple, near, far = block[0, i, j], block[1, i, j], block[2, i, j], block[3, i, j]
                at = first + j
                entries[slots[at]] += push
                entries[slots[at + 3]] -= couple
                entries[slots[at + 6]] -= push
                entries[slots[at + 9]] -= couple
                entries[slots[at + 36]] += couple
                entries[slots[at + 39]] += near
                entries[slots[at + 42]] -= couple
                entries[slots[at + 45]] += far
                entries[slots[at + 72]] -= push
                entries[slots[at + 75]] += couple
                entries[slots[at + 78]] += push
                entries[slots[at + 81]] += couple
                entries[slots[at + 108]] += couple
                entries[slots[at + 111]] += far
                entries[slots[at + 114]] -= couple
                entries[slots[at + 117]] += near
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            half = 0.5 * length * load[n, i]
            moment = length * length / 12.0 * (t[j] * load[n, k] - t[k] * load[n, j])
            force[6 * a + i] += half
            force[6 * b + i] += half
            force[6 * a + 3 + i] += moment
            force[6 * b + 3 + i] -= moment


@nb.njit(cache=True, error_model="numpy")
def bows(points, edges, bending, load, moved, bubble, result):
    """By how much the inner control points of beams move across them, beyond what their ends do.

    points (V, 3) mm; edges (N, 2); bending (N,) N mm^2; load (N, 3) N/mm; moved (V, 6) mm and rad; bubble (1,) what an
    even load over bending stiffness and times length^4 moves both of them by. Out: result (N, 2, 3) mm.
    """
    t, slant, hung = np.empty(3), np.empty(3), np.empty(3)
    for n in range(len(edges)):
        a, b = edges[n, 0], edges[n, 1]
        length = 0.0
        for i in range(3):
            t[i] = points[b, i] - points[a, i]
            length += t[i] * t[i]
        length = np.sqrt(length)
        pulled, shifted = 0.0, 0.0
        for i in range(3):
            t[i] /= length
            pulled += t[i] * load[n, i]
            shifted += t[i] * (moved[a, i] - moved[b, i])
        share = bubble[0] * length**4 / bending[n]
        for i in range(3):
            slant[i] = (moved[a, i] - moved[b, i] - shifted * t[i]) / 3.0
            hung[i] = share * (load[n, i] - pulled * t[i])
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            turned = moved[a, 3 + j] * t[k] - moved[a, 3 + k] * t[j]
            result[n, 0, i] = slant[i] + length / 3.0 * turned + hung[i]
            turned = moved[b, 3 + j] * t[k] - moved[b, 3 + k] * t[j]
            result[n, 1, i] = -slant[i] - length / 3.0 * turned + hung[i]


@nb.njit(cache=True, error_model="numpy")
def reached(edges, held, found):
    """Which beams (N, 2) reach a joint that is held (V,) by way of each other; found (N,) bool."""
    piece = np.arange(len(held))  # of each joint another one of its piece, the same for all in the end
    for n in range(len(edges)):
        first, last = edges[n, 0], edges[n, 1]
        while piece[first] != first:
            piece[first] = piece[piece[first]]
            first = piece[first]
        while piece[last] != last:
            piece[last] = piece[piece[last]]
            last = piece[last]
        piece[max(first, last)] = min(first, last)
    for joint in range(len(held)):  # a joint's piece is named after an earlier joint, or after itself
        piece[joint] = piece[piece[joint]]
    stands = np.zeros(len(held), dtype=np.bool_)
    for joint in range(len(held)):
        if held[joint]:
            stands[piece[joint]] = True
    for n in range(len(edges)):
        found[n] = stands[piece[edges[n, 0]]]
