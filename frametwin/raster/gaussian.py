"""The order-independent Gaussian splatter, compiled: forward and backward over all views.

With grey value 1 everywhere, front-to-back blending telescopes, so a picture needs no depth sort:

    I = sum_i a_i prod_{j<i} (1 - a_j) = 1 - prod_i (1 - a_i),    a_i = alpha_i G_i.

The product T = prod_i (1 - a_i) is the *transmittance*. The forward pass multiplies each kernel into the few
pixels of its own footprint; a thread owns whole bands of rows, so no two threads write to one pixel. The
backward pass reads T and the gradient of the picture; a thread owns whole kernels, so no two threads write to
one gradient. Both sum in a fixed order: the result does not depend on the number of threads.

Kernels are given by their 2D mean (x, y) in pixels (centres at +0.5), their *conic* (A, B, C), which is the
inverse of the 2D covariance [[A, B], [B, C]], and their opacity. A conic of zeros marks a kernel that the
view does not see.
"""

from __future__ import annotations

import math

import numpy as np
from numba import get_num_threads, njit, prange, uintp
from numpy.typing import NDArray

FOOTPRINT_FLOOR = 1.0 / 2040.0
"""Value of a Gaussian at the rim of its footprint (an eighth of one grey level in 255; 3.9 standard
deviations).

G is replaced by max(0, (G - floor) / (1 - floor)), which is 1 at the mean and falls to 0 at the rim without a
step, so that gradients are those of the picture."""

MAX_ALPHA = 0.999
"""Upper bound of alpha G: nothing is wholly opaque, so the backward pass may divide by 1 - alpha G."""

MIN_TRANSMITTANCE = 1e-6
"""Lower bound of the transmittance: long products would end in denormal numbers, which are very slow."""

_REACH = -2.0 * math.log(FOOTPRINT_FLOOR)  # squared Mahalanobis radius of a footprint
_FURTHEST = 1e9  # pixels; larger extents are degenerate conics
_TASKS_PER_THREAD = 8

_FLOOR = np.float32(FOOTPRINT_FLOOR)
_GAIN = np.float32(1.0 / (1.0 - FOOTPRINT_FLOOR))
_MAX_ALPHA = np.float32(MAX_ALPHA)
_MIN_T = np.float32(MIN_TRANSMITTANCE)
_ZERO, _ONE = np.float32(0.0), np.float32(1.0)
_BLOCK = 8  # pixels done at once, one vector register of float32
_LOWEST = np.float32(-12.0)
_SIXTEENTH = np.float32(1.0 / 16.0)
_E2, _E3, _E4, _E5 = (np.float32(1.0 / math.factorial(i)) for i in (2, 3, 4, 5))

Floats = NDArray[np.floating]


def _view_table(sizes: NDArray[np.int64]) -> tuple[NDArray[np.int64], int]:
    """(V, 3) height, width and place in the flat picture buffer of each view, and the length of the buffer."""
    sizes = np.asarray(sizes, dtype=np.int64).reshape(-1, 2)
    ends = np.cumsum(sizes[:, 0] * sizes[:, 1])
    return np.column_stack([sizes, ends - sizes[:, 0] * sizes[:, 1]]), int(ends[-1]) if len(ends) else 0


def transmittance(means: Floats, conics: Floats, opacity: Floats, sizes: NDArray[np.int64]) -> NDArray[np.float32]:
    """Transmittance of every pixel of every view; the picture is 1 minus this.

    Parameters
    ----------
    means : (V, N, 2) pixels.
    conics : (V, N, 3) A, B, C in 1 / pixel^2; zeros for kernels not seen.
    opacity : (V, N) 0..1.
    sizes : (V, 2) height and width of each view.

    Returns
    -------
    (sum of height x width,) float32 in `MIN_TRANSMITTANCE`..1, view after view, row after row.
    """
    views, length = _view_table(sizes)
    buffer = np.ones(length, dtype=np.float32)
    _forward(_double(means), _double(conics), _double(opacity), views, _parts(len(views)), buffer)
    return buffer


def gradients(
    means: Floats,
    conics: Floats,
    opacity: Floats,
    sizes: NDArray[np.int64],
    buffer: NDArray[np.float32],
    grad_image: NDArray[np.float32],
) -> tuple[Floats, Floats, Floats]:
    """Chain the gradient of a loss with respect to the picture 1 - T back to the kernels.

    Parameters
    ----------
    means, conics, opacity, sizes : as for `transmittance`.
    buffer : the transmittance it returned.
    grad_image : (same length,) float32 gradient of the loss with respect to each pixel of the picture.

    Returns
    -------
    Gradients (V, N, 2), (V, N, 3), (V, N) float64 with respect to means, conics (A, B, C as three free
    numbers) and opacity.
    """
    views, _ = _view_table(sizes)
    grads = np.zeros((*opacity.shape, 6))
    kernels = _double(means), _double(conics), _double(opacity)
    _backward(*kernels, views, _parts(len(views)), buffer, np.ascontiguousarray(grad_image), grads)
    return grads[..., :2], grads[..., 2:5], grads[..., 5]


def _double(values: Floats) -> NDArray[np.float64]:
    """One type and one layout, so that the kernels are compiled once."""
    return np.ascontiguousarray(values, dtype=np.float64)


def _parts(views: int) -> int:
    """Into how many tasks to divide a view so that all threads are busy until the end."""
    return max(1, -(-_TASKS_PER_THREAD * get_num_threads() // max(views, 1)))


@njit(inline="always", fastmath=True)
def _exp(x):
    """exp(x) for -8 < x <= 0 to 1e-6, as (Taylor polynomial of x / 16)^16, which vectorises."""
    y = x * _SIXTEENTH
    p = _ONE + y * (_ONE + y * (_E2 + y * (_E3 + y * (_E4 + y * _E5))))
    p = p * p
    p = p * p
    p = p * p
    return p * p


@njit(inline="always", fastmath=True)
def _exponent(c0, c2, x):
    """Exponent along a row; pixels outside of the footprint are kept where `_exp` is still small."""
    return max(c0 + c2 * x * x, _LOWEST)


# Rows are addressed by unsigned offsets into the flat buffer, and division does not check for zero: with
# signed indices (which may count from the end) or with the check, the loops would not vectorise; with slices
# they would count references.
@njit(fastmath=True, cache=True, error_model="numpy")
def _multiply_row(buffer, start, count, x, c0, c2, alpha):
    """Multiply one kernel into a piece of a row; x is the distance of the first pixel from the row's peak."""
    for k in range(count):
        g = (_exp(_exponent(c0, c2, x)) - _FLOOR) * _GAIN
        a = min(max(alpha * g, _ZERO), _MAX_ALPHA)
        buffer[start + k] = max(buffer[start + k] * (_ONE - a), _MIN_T)
        x += _ONE  # a running float: AVX2 has no conversion from 64-bit counters


@njit(fastmath=True, cache=True, error_model="numpy")
def _row_moments(buffer, grad, start, count, x, c0, c2, alpha):
    """Sums over one piece of a row: dL/dopacity, and w, w x, w x^2 with w = dL / d(exponent) / opacity."""
    s_alpha, s0, s1, s2 = _ZERO, _ZERO, _ZERO, _ZERO
    for k in range(count):
        e = _exp(_exponent(c0, c2, x))
        g = max((e - _FLOOR) * _GAIN, _ZERO)
        a = min(alpha * g, _MAX_ALPHA)
        t = buffer[start + k]
        d = grad[start + k] * t / (_ONE - a)
        if (g <= _ZERO) | (a >= _MAX_ALPHA) | (t <= _MIN_T):
            d = _ZERO  # where a bound holds, the picture does not answer to the kernel
        w = d * e
        s_alpha += d * g
        s0 += w
        s1 += w * x
        s2 += w * x * x
        x += _ONE
    return s_alpha, s0, s1, s2


@njit(inline="always")
def _rows(my, a, det, height):
    """First row and row after the last of a footprint; an empty range if the kernel is not to be drawn."""
    if not (a > 0.0 and det > 0.0):
        return 0, 0
    reach = math.sqrt(_REACH * a / det)
    if not (reach < _FURTHEST and abs(my) < _FURTHEST):
        return 0, 0
    first = math.ceil(min(max(my - reach - 0.5, 0.0), height))
    last = math.floor(max(min(my + reach - 0.5, height - 1.0), -1.0)) + 1
    return int(first), int(last)


@njit(inline="always")
def _columns(peak, half, width):
    """First column and column after the last of a footprint's row around its peak."""
    first = int(math.ceil(min(max(peak - half - 0.5, 0.0), width)))
    last = int(math.floor(max(min(peak + half - 0.5, width - 1.0), -1.0))) + 1
    blocks = (last - first + _BLOCK - 1) // _BLOCK * _BLOCK
    if first < last and blocks <= width:  # whole blocks: the surplus pixels see a value of 0
        first = min(first, width - blocks)
        last = first + blocks
    return first, last


@njit(parallel=True, cache=True, error_model="numpy")
def _forward(means, conics, opacity, views, bands, buffer):
    for task in prange(len(views) * bands):
        view, band = task // bands, task % bands
        height, width, origin = views[view, 0], views[view, 1], views[view, 2]
        top, bottom = height * band // bands, height * (band + 1) // bands
        for i in range(opacity.shape[1]):
            mx, my = means[view, i, 0], means[view, i, 1]
            a, b, c = conics[view, i, 0], conics[view, i, 1], conics[view, i, 2]
            det = a * c - b * b
            first, last = _rows(my, a, det, height)
            for y in range(max(first, top), min(last, bottom)):
                dy = y + 0.5 - my
                peak = mx - b * dy / a
                half = math.sqrt(max(_REACH * a - det * dy * dy, 0.0)) / a
                j0, j1 = _columns(peak, half, width)
                if j1 > j0:
                    start = origin + y * width
                    c0, c2 = np.float32(-0.5 * det / a * dy * dy), np.float32(-0.5 * a)
                    x = np.float32(j0 + 0.5 - peak)
                    _multiply_row(buffer, uintp(start + j0), uintp(j1 - j0), x, c0, c2, np.float32(opacity[view, i]))


@njit(parallel=True, cache=True, error_model="numpy")
def _backward(means, conics, opacity, views, chunks, buffer, grad_image, grads):
    count = opacity.shape[1]
    for task in prange(len(views) * chunks):
        view, chunk = task // chunks, task % chunks
        height, width, origin = views[view, 0], views[view, 1], views[view, 2]
        for i in range(count * chunk // chunks, count * (chunk + 1) // chunks):
            mx, my = means[view, i, 0], means[view, i, 1]
            a, b, c = conics[view, i, 0], conics[view, i, 1], conics[view, i, 2]
            det = a * c - b * b
            alpha = opacity[view, i]
            first, last = _rows(my, a, det, height)
            g_alpha, wx, wy, wxx, wxy, wyy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for y in range(first, last):
                dy = y + 0.5 - my
                shift = b * dy / a
                half = math.sqrt(max(_REACH * a - det * dy * dy, 0.0)) / a
                j0, j1 = _columns(mx - shift, half, width)
                if j1 > j0:
                    start = origin + y * width
                    s_alpha, s0, s1, s2 = _row_moments(
                        buffer,
                        grad_image,
                        uintp(start + j0),
                        uintp(j1 - j0),
                        np.float32(j0 + 0.5 - mx + shift),
                        np.float32(-0.5 * det / a * dy * dy),
                        np.float32(-0.5 * a),
                        np.float32(alpha),
                    )
                    dx = s1 - shift * s0  # from the row's peak back to the kernel's mean
                    g_alpha += s_alpha
                    wx += dx
                    wy += s0 * dy
                    wxx += s2 - shift * (s1 + dx)
                    wxy += dx * dy
                    wyy += s0 * dy * dy
            # Exponent: -(A dx^2 + 2 B dx dy + C dy^2) / 2 with (dx, dy) from the mean to the pixel.
            scale = alpha / (1.0 - FOOTPRINT_FLOOR)
            grads[view, i, 0] = scale * (a * wx + b * wy)
            grads[view, i, 1] = scale * (b * wx + c * wy)
            grads[view, i, 2] = -0.5 * scale * wxx
            grads[view, i, 3] = -scale * wxy
            grads[view, i, 4] = -0.5 * scale * wyy
            grads[view, i, 5] = g_alpha
