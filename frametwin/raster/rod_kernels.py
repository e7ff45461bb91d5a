"""Compiled loops of the rod splatter: pieces of round rod, blurred by a Gaussian, over all views.

A strut is a polyline of straight pieces. A pixel at the distance d from a piece's projected centreline is
covered by

    c(d) = Phi((r - d) / s) - Phi((-r - d) / s),

with r the apparent half width in pixels, s^2 = 1/12 + blur^2 the spread of the pixel and of the blur that the
target was given, and Phi the normal distribution function: the limit of ever denser anchored Gaussians, without
their overshooting ends and tails. A joint is one disc, so that the struts that meet there do not each round off
the same corner. With grey value 1 everywhere front-to-back blending telescopes (paper, Sec. V.D), so a picture is
I = 1 - T with the transmittance T = prod(1 - alpha c), in any order.

Geometry is in float64, pictures are float32. All views lie in one flat buffer: view v has its rows at
``offset[v] + row * width``. Cameras are rows of :func:`frametwin.cameras.packed` and one number more, the lens's k1: a
point at the normalised distance rho from the axis is seen at rho (1 + k1 rho^2). Everything is deterministic:
threads share views when they write pictures and struts when they gather.

Helpers take whole arrays and indices: numba counts references by atomic instructions, to a part of an array whenever
one is made, and to all arrays that a helper is given. That took a third of the time, so helpers are part of their
caller (``inline``) or do without such counts (`HELPER`), as they make no array.

Helpers and constants are in this file too, and nowhere else: numba keeps machine code until the file of the function
that is called changes, and would not notice an edit elsewhere (``tests/test_compiled_code.py`` sees to it).
"""

from __future__ import annotations

from math import ceil, erf, exp, floor, pi, sqrt
from typing import Any

import numba as nb
import numpy as np

REACH = 3.0
"""Kernels end this many spreads s beyond the rod's edge, where the coverage is 0.0013."""

FAR = 5.0
"""Spreads from which a rod's other edge takes nothing off the coverage that a float32 could tell."""

OPAQUE = 0.9995
"""Most that one kernel covers, so that its share can be divided out again."""

DARK = 1e-6
"""Least transmittance: below, numbers become denormal and the loops many times slower."""

HIDDEN = 2e-3
"""A kernel with less than this transmittance of the others above a pixel gathers nothing from it."""

CHUNK = 256
"""Pixels that are worked on together."""

LANES = 16
"""Of them, numbers that fill vector registers. It divides `CHUNK`."""

ALONG, TRANSMITTANCE, RESIDUAL, ROOM = np.uint64(288), np.uint64(576), np.uint64(864), 1152
"""Where in the room for collected pixels what they have begins, and its size: `CHUNK` and two registers each."""

BLOCK = np.uint64(8)
"""Pixels of a row that are worked on or copied together, more than most rows of a piece have."""

NOWHERE = 1e6
"""Pixels off a centreline where nothing of a rod is seen."""

HELPER: Any = {"cache": True, "fastmath": True, "error_model": "numpy", "_nrt": False}

F = np.float32
U = np.uint64  # an index without a sign is not looked at for counting from the end

_HEIGHT = 1.0 / sqrt(2.0 * pi)
_RANGE = 6.0
_BINS = 1536
_Z = np.linspace(-_RANGE, _RANGE, _BINS + 1)
_CDF = np.array([0.5 * (1.0 + erf(z / sqrt(2.0))) for z in _Z])
_CORE = 0.5 * (1.0 + erf(REACH / sqrt(2.0)))  # of the coverage, where it is flat
_PDF = np.array([exp(-z * z / 2.0) / sqrt(2.0 * pi) for z in _Z])


@nb.njit(inline="always")
def _normal(z):
    """Distribution function and density of the normal distribution, by linear interpolation in a table."""
    x = min(max((z + _RANGE) * (_BINS / (2.0 * _RANGE)), 0.0), _BINS - 1e-6)
    i = int(x)
    t = x - i
    return _CDF[i] + t * (_CDF[i + 1] - _CDF[i]), _PDF[i] + t * (_PDF[i + 1] - _PDF[i])


@nb.njit(inline="always")
def _coverage(d, r, s):
    if d < r - REACH * s:
        return _CORE
    if d > FAR * s - r:
        return _normal((r - d) / s)[0]
    return _normal((r - d) / s)[0] - _normal((-r - d) / s)[0]


@nb.njit(inline="always")
def _tail32(a):
    """One minus the distribution function for a >= 0, so that a loop runs in vector registers (Abramowitz and Stegun
    7.1.28, error 1.5e-7; float32 throughout)."""
    x = min(a, F(_RANGE)) * F(sqrt(0.5))
    q = F(0.0001520143) + x * (F(0.0002765672) + x * F(0.0000430638))
    q = F(1.0) + x * (F(0.0705230784) + x * (F(0.0422820123) + x * (F(0.0092705272) + x * q)))
    q *= q
    q *= q
    q *= q
    q *= q
    return F(0.5) / q


@nb.njit(**HELPER)
def _project(points, k, cameras, v, line):
    """Pixel x, y and depth of the points (E, P+1, 3) of strut k into ``line``; False if one is behind the camera."""
    seen = True
    for i in range(points.shape[1]):
        x, y, z = points[k, i, 0], points[k, i, 1], points[k, i, 2]
        cx = cameras[v, 0] * x + cameras[v, 1] * y + cameras[v, 2] * z + cameras[v, 9]
        cy = cameras[v, 3] * x + cameras[v, 4] * y + cameras[v, 5] * z + cameras[v, 10]
        cz = cameras[v, 6] * x + cameras[v, 7] * y + cameras[v, 8] * z + cameras[v, 11]
        if cz < 1e-6:
            seen = False
            cz = 1e-6
        lens = 1.0 + cameras[v, 16] * (cx * cx + cy * cy) / (cz * cz)
        line[i, 0] = cameras[v, 12] * cx / cz * lens + cameras[v, 14]
        line[i, 1] = cameras[v, 13] * cy / cz * lens + cameras[v, 15]
        line[i, 2] = cz
    return seen


@nb.njit(inline="always")
def _half_width(line, p, cameras, v):
    """Apparent half width in pixels, per mm of radius, of the round rod about piece p (rows x, y, depth).

    A pixel's ray v meets an infinite cylinder when |v.N| <= r |v x t| / |x x t|, with N the unit normal of the
    plane through the camera and the axis; at the piece itself |v x t| / |x x t| is one over the depth.
    """
    z0, z1 = line[p, 2], line[p + 1, 2]
    x0, y0 = (line[p, 0] - cameras[v, 14]) / cameras[v, 12] * z0, (line[p, 1] - cameras[v, 15]) / cameras[v, 13] * z0
    x1 = (line[p + 1, 0] - cameras[v, 14]) / cameras[v, 12] * z1
    y1 = (line[p + 1, 1] - cameras[v, 15]) / cameras[v, 13] * z1
    tx, ty, tz = x1 - x0, y1 - y0, z1 - z0
    nx = y0 * tz - z0 * ty
    ny = z0 * tx - x0 * tz
    nz = x0 * ty - y0 * tx
    slope = sqrt((nx / cameras[v, 12]) ** 2 + (ny / cameras[v, 13]) ** 2)
    return 2.0 / (z0 + z1) * sqrt(nx * nx + ny * ny + nz * nz) / max(slope, 1e-12)


@nb.njit(**HELPER)
def _half_width_slope(line, p, cameras, v, scale, slope):
    """Adds scale times the derivative of `_half_width` by the 3D points p and p + 1, in world axes, to slope."""
    fx, fy, z0, z1 = cameras[v, 12], cameras[v, 13], line[p, 2], line[p + 1, 2]
    x0, y0 = (line[p, 0] - cameras[v, 14]) / fx * z0, (line[p, 1] - cameras[v, 15]) / fy * z0
    x1, y1 = (line[p + 1, 0] - cameras[v, 14]) / fx * z1, (line[p + 1, 1] - cameras[v, 15]) / fy * z1
    nx, ny, nz = y0 * z1 - z0 * y1, z0 * x1 - x0 * z1, x0 * y1 - y0 * x1
    fx2, fy2 = fx**2, fy**2
    flat = sqrt(nx * nx / fx2 + ny * ny / fy2)
    full = sqrt(nx * nx + ny * ny + nz * nz)
    if flat < 1e-12:
        return
    depth = z0 + z1
    a, b = 2.0 / (depth * full * flat), 2.0 * full / (depth * flat**3)
    gx, gy, gz = a * nx - b * nx / fx2, a * ny - b * ny / fy2, a * nz
    by_depth = -2.0 * full / (depth * depth * flat)
    px, py, pz = y1 * gz - z1 * gy, z1 * gx - x1 * gz, x1 * gy - y1 * gx + by_depth
    qx, qy, qz = gy * z0 - gz * y0, gz * x0 - gx * z0, gx * y0 - gy * x0 + by_depth
    for e in range(3):
        slope[p, e] += scale * (px * cameras[v, e] + py * cameras[v, 3 + e] + pz * cameras[v, 6 + e])
        slope[p + 1, e] += scale * (qx * cameras[v, e] + qy * cameras[v, 3 + e] + qz * cameras[v, 6 + e])


@nb.njit(**HELPER)
def _cuts(line, cuts):
    """Lines (P+1, 5) that divide the picture plane between neighbouring pieces: the bisectors of their turns.

    Two pieces decide by the same line which of them a pixel belongs to, so that none is counted twice or never. On
    the outer side of a turn a piece goes on to the line, but no further than its half width: where the polyline turns
    back on itself, as that of a curved strut seen end on, it would run on across the picture.

    Of each line: the direction across it, its column in row 0, how much that grows a row, and which side is ahead: 1
    to the right, -1 to the left, and for a line along the rows, which has a row in place of the column, 2 below and -2
    above.
    """
    last = line.shape[0] - 1
    before_x, before_y = 0.0, 0.0
    for p in range(last + 1):
        after_x, after_y = 0.0, 0.0
        if p < last:
            after_x, after_y = line[p + 1, 0] - line[p, 0], line[p + 1, 1] - line[p, 1]
            length = sqrt(after_x * after_x + after_y * after_y)
            if length > 1e-9:
                after_x, after_y = after_x / length, after_y / length
        x, y = before_x + after_x, before_y + after_y
        cuts[p, 0], cuts[p, 1] = x, y
        if abs(x) < 1e-9:
            cuts[p, 2], cuts[p, 3], cuts[p, 4] = line[p, 1] - 0.5, 0.0, 2.0 if y > 0.0 else -2.0
        else:
            slope = -y / x
            cuts[p, 2], cuts[p, 3] = line[p, 0] - 0.5 - slope * (line[p, 1] - 0.5), slope
            cuts[p, 4] = 1.0 if x > 0.0 else -1.0
        before_x, before_y = after_x, after_y


@nb.njit(inline="always")
def _beyond(cuts, p, tx, ty, half, reach):
    """How far a piece goes on beyond its end, on the outer side of the turn."""
    x, y = cuts[p, 0], cuts[p, 1]
    return min(half, reach * abs(tx * y - ty * x) / max(tx * x + ty * y, 1e-9))


@nb.njit(inline="always")
def _first(x):
    return int(ceil(min(max(x, -1e9), 1e9)))


@nb.njit(**HELPER)
def _spans(line, cuts, p, tx, ty, length, half, reach, core, height, width, spans):
    """The pixels of piece p that are within reach of its centreline: their first row, and in how many rows they are.

    Of each of these rows spans gets the first and the last column, the first one that is within ``core`` of the
    centreline and the first one after: eight rows at a time, eight numbers of each kind. In the registers of a
    processor eight rows take no longer than one.
    """
    q = p + 1
    more_p, more_q = abs(ty) * _beyond(cuts, p, tx, ty, half, reach), abs(ty) * _beyond(cuts, q, tx, ty, half, reach)
    low = min(line[p, 1] - more_p, line[q, 1] - more_q) - reach * abs(tx)
    high = max(line[p, 1] + more_p, line[q, 1] + more_q) + reach * abs(tx)
    top, bottom = max(0, int(floor(max(low, -1e9) - 0.5))), min(height - 1, int(ceil(min(high, 1e9) - 0.5)))
    across, lean, wide = line[p, 0], 0.0, 1e9
    slanted = abs(ty) > 1e-9
    if slanted:  # |-ty x + tx y| <= reach, x and y from p
        lean = tx / ty
        across, wide = line[p, 0] - 0.5 - lean * (line[p, 1] - 0.5), reach / abs(ty)
    along, tilt, far = line[p, 0], 0.0, 1e9
    if abs(tx) > 1e-9:  # |tx x + ty y| <= length / 2 + half, x and y from the middle
        tilt, far = -ty / tx, (0.5 * length + half) / abs(tx)
        along = 0.5 * (line[p, 0] + line[q, 0]) - 0.5 - tilt * (0.5 * (line[p, 1] + line[q, 1]) - 0.5)
    low_p, low_p_lean, high_p, high_p_lean = 0.0, 0.0, 1e9, 0.0
    if cuts[p, 4] == 1.0:
        low_p, low_p_lean = cuts[p, 2], cuts[p, 3]
    elif cuts[p, 4] == -1.0:
        high_p, high_p_lean = cuts[p, 2], cuts[p, 3]
    elif cuts[p, 4] > 0.0:
        top = max(top, _first(cuts[p, 2]))
    else:
        bottom = min(bottom, _first(cuts[p, 2]) - 1)
    low_q, low_q_lean, high_q, high_q_lean = 0.0, 0.0, 1e9, 0.0
    if cuts[q, 4] == 1.0:
        high_q, high_q_lean = cuts[q, 2], cuts[q, 3]
    elif cuts[q, 4] == -1.0:
        low_q, low_q_lean = cuts[q, 2], cuts[q, 3]
    elif cuts[q, 4] > 0.0:
        bottom = min(bottom, _first(cuts[q, 2]) - 1)
    else:
        top = max(top, _first(cuts[q, 2]))
    count, last, begin_y = max(bottom - top + 1, 0), width - 1.0, line[p, 1] - 0.5
    inner = -1e9  # nothing is that near
    if core > 0.0 and slanted:
        inner = core / abs(ty)
    level = -1e9 if core <= 0.0 or slanted else core
    for begin in range(0, count, 8):
        at, first = U(4 * begin), float(top + begin)
        for n in range(BLOCK):
            row = first + float(n)
            middle, centre = across + lean * row, along + tilt * row
            left = max(max(middle - wide, centre - far), max(low_p + low_p_lean * row, low_q + low_q_lean * row))
            right = min(middle + wide, centre + far)
            end = min(high_p + high_p_lean * row, high_q + high_q_lean * row)
            left = np.ceil(min(max(left, 0.0), 1e9))
            right = min(np.floor(min(max(right, -1.0), last)), np.ceil(min(max(end, 0.0), 1e9)) - 1.0)
            within = inner if abs(tx * (row - begin_y)) >= level else 1e9
            after = max(right + 1.0, left)
            flat = min(max(np.ceil(middle - within), left), after)
            spans[at + n] = np.int32(left)
            spans[at + BLOCK + n] = np.int32(right)
            spans[at + BLOCK + BLOCK + n] = np.int32(flat)
            spans[at + BLOCK + BLOCK + BLOCK + n] = np.int32(min(max(np.ceil(middle + within), flat), after))
    return top, count


@nb.njit(inline="always")
def _joint(joints, k, cameras, v):
    """Pixel x, y, depth of joint k."""
    x, y, z = joints[k, 0], joints[k, 1], joints[k, 2]
    cx = cameras[v, 0] * x + cameras[v, 1] * y + cameras[v, 2] * z + cameras[v, 9]
    cy = cameras[v, 3] * x + cameras[v, 4] * y + cameras[v, 5] * z + cameras[v, 10]
    cz = cameras[v, 6] * x + cameras[v, 7] * y + cameras[v, 8] * z + cameras[v, 11]
    if cz < 1e-6:
        return 0.0, 0.0, -1.0
    lens = 1.0 + cameras[v, 16] * (cx * cx + cy * cy) / (cz * cz)
    return cameras[v, 12] * cx / cz * lens + cameras[v, 14], cameras[v, 13] * cy / cz * lens + cameras[v, 15], cz


@nb.njit(inline="always")
def _darken_block(transmittance, at, have, before, beyond, step, alpha, thin):
    """Darken the first ``have`` of `BLOCK` pixels, at the distances ``before`` + i step from the rod's one edge and
    ``beyond`` - i step from its other one, in spreads and inwards. Whether a rod is thin enough that both count is
    the same for a whole piece."""
    one = F(1.0)
    if thin:
        for i in range(BLOCK):
            a, b = before + step * F(i), beyond - step * F(i)
            inside = min(min(a, b), F(REACH))
            tail = _tail32(abs(inside))
            c = (one - tail if inside > F(0.0) else tail) - (_tail32(max(a, b)) if inside < F(REACH) else F(0.0))
            c = min(alpha * c, F(OPAQUE)) if F(i) < have else F(0.0)
            transmittance[at + i] = max(transmittance[at + i] * (one - c), F(DARK))
    else:
        for i in range(BLOCK):
            inside = min(min(before + step * F(i), beyond - step * F(i)), F(REACH))
            tail = _tail32(abs(inside))
            c = one - tail if inside > F(0.0) else tail
            c = min(alpha * c, F(OPAQUE)) if F(i) < have else F(0.0)
            transmittance[at + i] = max(transmittance[at + i] * (one - c), F(DARK))


@nb.njit(inline="always")
def _darken_piece(line, cuts, p, cameras, v, radius, alpha, height, width, start, spread, spans, transmittance):
    dx, dy = line[p + 1, 0] - line[p, 0], line[p + 1, 1] - line[p, 1]
    length = sqrt(dx * dx + dy * dy)
    if length < 1e-9:
        return
    tx, ty = dx / length, dy / length
    r = _half_width(line, p, cameras, v) * radius
    reach = r + REACH * spread
    top, count = _spans(line, cuts, p, tx, ty, length, r, reach, -1.0, height, width, spans)
    inverse, end, thin = 1.0 / spread, start + height * width, r < FAR * spread
    step = F(ty * inverse)
    for n in range(count):
        span, j = 4 * n - 3 * (n & 7), top + n
        left, after, at = spans[span], spans[span + 8] + 1, start + j * width
        while left < after:
            u = tx * (j + 0.5 - line[p, 1]) - ty * (left + 0.5 - line[p, 0])
            if at + left + 8 <= end:
                before, beyond, have = F((r - u) * inverse), F((r + u) * inverse), F(after - left)
                _darken_block(transmittance, U(at + left), have, before, beyond, step, F(alpha), thin)
                left += 8
            else:  # the last pixels of a picture, behind which there is another one's
                c = min(alpha * _coverage(abs(u), r, spread), OPAQUE)
                transmittance[at + left] = max(transmittance[at + left] * (1.0 - c), DARK)
                left += 1


@nb.njit(inline="always")
def _chord(row, x, y, radius, width):
    """First and last column of a row whose pixels are within ``radius`` of the point x, y; none where it is missed."""
    away = row + 0.5 - y
    half = sqrt(max(radius * radius - away * away, 0.0))
    return max(0, _first(x - half - 0.5)), min(width - 1, int(floor(min(max(x + half - 0.5, -1e9), 1e9))))


@nb.njit(**HELPER)
def _darken_disc(x, y, r, height, width, start, spread, transmittance):
    """Darken a disc about x, y, as `_darken_piece` does a piece."""
    reach, end, inverse, one = r + REACH * spread, start + height * width, F(1.0 / spread), F(1.0)
    radius, furthest = F(r), F(reach)
    for j in range(max(0, _first(y - reach - 0.5)), min(height - 1, int(floor(min(y + reach - 0.5, 1e9)))) + 1):
        left, last = _chord(j, x, y, reach, width)
        up = F(j + 0.5 - y)
        while left <= last:
            at = start + j * width + left
            if at + 8 <= end:
                across, have, place = F(left + 0.5 - x), F(last + 1 - left), U(at)
                for i in range(BLOCK):
                    side = across + F(i)
                    d = np.sqrt(side * side + up * up)
                    inside = min((radius - d) * inverse, F(REACH))
                    tail = _tail32(abs(inside))
                    beyond = _tail32((radius + d) * inverse) if inside < F(REACH) else F(0.0)
                    c = min((one - tail if inside > F(0.0) else tail) - beyond, F(OPAQUE))
                    c = c if F(i) < have and d <= furthest else F(0.0)
                    transmittance[place + i] = max(transmittance[place + i] * (one - c), F(DARK))
                left += 8
            else:
                d = sqrt((left + 0.5 - x) ** 2 + (j + 0.5 - y) ** 2)
                c = min(_coverage(d, r, spread), OPAQUE) if d <= reach else 0.0
                transmittance[at] = max(transmittance[at] * (1.0 - c), DARK)
                left += 1


@nb.njit(parallel=True, cache=True, fastmath=True, error_model="numpy")
def render(points, radius, opacity, joints, joint_radius, cameras, shapes, offsets, spreads, transmittance):
    """Transmittance of all views.

    points (E, P+1, 3), radius and opacity (E, P), joints (V, 3), joint_radius (V,) with 0 for none, cameras
    (N, 17), shapes (N, 2) height and width, offsets (N,), spreads (N,) in pixels, transmittance (pixels,) float32, out.
    """
    for v in nb.prange(cameras.shape[0]):
        spread = spreads[v]
        height, width, start = shapes[v, 0], shapes[v, 1], offsets[v]
        for i in range(U(start), U(start + height * width)):
            transmittance[i] = F(1.0)
        line, cuts = np.empty((points.shape[1], 3)), np.empty((points.shape[1], 5))
        spans = np.empty(4 * height + 32, dtype=np.int32)
        for k in range(points.shape[0]):
            if not _project(points, k, cameras, v, line):
                continue
            _cuts(line, cuts)
            for p in range(points.shape[1] - 1):
                if opacity[k, p] > 0.0:
                    _darken_piece(
                        line,
                        cuts,
                        p,
                        cameras,
                        v,
                        radius[k, p],
                        opacity[k, p],
                        height,
                        width,
                        start,
                        spread,
                        spans,
                        transmittance,
                    )
        for k in range(joints.shape[0]):
            if joint_radius[k] <= 0.0:
                continue
            x, y, z = _joint(joints, k, cameras, v)
            if z < 0.0:
                continue
            r = 0.5 * (cameras[v, 12] + cameras[v, 13]) * joint_radius[k] / z
            _darken_disc(x, y, r, height, width, start, spread, transmittance)


@nb.njit(parallel=True, cache=True, fastmath=True, error_model="numpy")
def compare(transmittance, target, shapes, offsets, residual, losses):
    """What the pictures of the rods, 1 - T, have more than the target (pixels,): into residual (pixels,), and half
    its square, summed over each view, into losses (N,)."""
    for v in nb.prange(shapes.shape[0]):
        total = 0.0
        for j in range(shapes[v, 0]):
            at = offsets[v] + j * shapes[v, 1]
            row = F(0.0)
            for i in range(U(at), U(at + shapes[v, 1])):
                more = F(1.0) - transmittance[i] - target[i]
                residual[i] = more
                row += more * more
            total += float(row)
        losses[v] = 0.5 * total


@nb.njit(inline="always")
def _pull(x, y, z, nx, ny, cameras, v, m):
    """Change of the pixel coordinate along (nx, ny) for a motion of the 3D point seen at x, y, its depth z, into m."""
    a = nx * cameras[v, 12] / z
    b = ny * cameras[v, 13] / z
    c = -(a * (x - cameras[v, 14]) / cameras[v, 12] + b * (y - cameras[v, 15]) / cameras[v, 13])
    for e in range(3):
        m[e] = a * cameras[v, e] + b * cameras[v, 3 + e] + c * cameras[v, 6 + e]


@nb.njit(inline="always")
def _normal32(z):
    """As `_normal` without a table, so that a loop over many z runs in vector registers.

    The tail by Abramowitz and Stegun 26.2.17 (error 7.5e-8), the density by one over the eighth power of a polynomial
    (error 1.1e-6); float32 throughout.
    """
    a = min(abs(z), F(_RANGE))
    w = a * a * F(1.0 / 16.0)
    q = F(1.0) + w * (F(1.0) + w * (F(1.0 / 2.0) + w * (F(1.0 / 6.0) + w * (F(1.0 / 24.0) + w * F(1.0 / 120.0)))))
    q *= q
    q *= q
    q *= q
    p = F(1.0) + F(0.2316419) * a
    both = F(1.0) / (q * p)
    density = F(_HEIGHT) * (both * p)
    t = both * q
    tail = F(1.330274429) * t - F(1.821255978)
    tail = F(1.781477937) + t * tail
    tail = density * t * (F(0.319381530) + t * (F(-0.356563782) + t * tail))
    return (F(1.0) - tail if z > F(0.0) else tail), density


@nb.njit(inline="always")
def _padded(count, seen):
    """A number of pixels that fills vector registers, with as many behind the first ``count`` as are missing: black and
    far off, where nothing is covered. What is left over of a loop in registers takes as long as all the rest."""
    whole = (count + LANES - 1) // LANES * LANES
    for i in range(count, count + LANES):
        seen[U(i)], seen[ALONG + U(i)] = F(NOWHERE), F(0.0)
        seen[TRANSMITTANCE + U(i)], seen[RESIDUAL + U(i)] = F(1.0), F(0.0)
    return U(whole)


@nb.njit(inline="always")
def _copy_block(source, at, target, to):
    """Copy `BLOCK` numbers; all are read before any is written, so that one register can take them."""
    a, b, c, d = source[at], source[at + U(1)], source[at + U(2)], source[at + U(3)]
    e, f, g, h = source[at + U(4)], source[at + U(5)], source[at + U(6)], source[at + U(7)]
    target[to], target[to + U(1)], target[to + U(2)], target[to + U(3)] = a, b, c, d
    target[to + U(4)], target[to + U(5)], target[to + U(6)], target[to + U(7)] = e, f, g, h


@nb.njit(inline="always")
def _collect(seen, count, across, along, step, stride, transmittance, residual, at, have, end):
    """Put the next ``have`` pixels of a row behind the ``count`` ones that are collected already, a block at a time:
    what is too much is overwritten by the next ones. Of each there are how far across the piece it is, in pixels, which
    share along it, and its transmittance and residual. Behind ``end`` nothing is read."""
    if at + 8 <= end:
        begin, pixel, u, t = U(count), U(at), F(across), F(along)
        for i in range(BLOCK):
            seen[begin + i] = u + step * F(i)
            seen[ALONG + begin + i] = t + stride * F(i)
        _copy_block(transmittance, pixel, seen, TRANSMITTANCE + begin)
        _copy_block(residual, pixel, seen, RESIDUAL + begin)
    else:
        for i in range(have):
            seen[count + i] = F(across) + step * F(i)
            seen[ALONG + U(count + i)] = F(along) + stride * F(i)
            seen[TRANSMITTANCE + U(count + i)] = transmittance[at + i]
            seen[RESIDUAL + U(count + i)] = residual[at + i]


@nb.njit(**HELPER)
def _add_moments(count, seen, radius, alpha, unit, spread, sums):
    """Add to the sums of `_gather_piece` what the ``count`` pixels say that `_collect` has put into seen."""
    r, one, inverse = F(radius), F(1.0), F(1.0 / spread)
    opacity, share, wide = F(alpha), F(alpha / spread), F(alpha * unit / spread)
    aa, ab, bb, rr = F(0.0), F(0.0), F(0.0), F(0.0)
    a, b, c = F(0.0), F(0.0), F(0.0)
    for i in range(_padded(count, seen)):
        u, along, residual = seen[i], seen[ALONG + i], seen[RESIDUAL + i]
        inside, near = _normal32((r - u) * inverse)
        beyond, far = _normal32((-r - u) * inverse)
        covered = min(opacity * (inside - beyond), F(OPAQUE))
        others = min(seen[TRANSMITTANCE + i] / (one - covered), one)
        others = others if others >= F(HIDDEN) else F(0.0)
        by_place = others * share * (far - near)
        by_radius = others * wide * (near + far)
        at_q = by_place * along
        at_p = by_place - at_q
        aa += at_p * at_p
        ab += at_p * at_q
        bb += at_q * at_q
        a += residual * at_p
        b += residual * at_q
        rr += by_radius * by_radius
        c += residual * by_radius
    sums[0] += aa
    sums[1] += ab
    sums[2] += bb
    sums[3] -= a
    sums[4] -= b
    sums[5] += rr
    sums[6] += c


@nb.njit(inline="always")
def _gather_piece(
    line,
    cuts,
    p,
    tx,
    ty,
    length,
    unit,
    radius,
    alpha,
    height,
    width,
    start,
    spread,
    transmittance,
    residual,
    spans,
    seen,
    sums,
):
    """Moments over the pixels of piece p, into sums: (1-t)^2 w, t(1-t) w, t^2 w, (1-t) g, t g, and for the radius w and
    g, with w the squared and g the residual-weighted derivative of the picture.

    Rows are too short for vector registers, so that the pixels of several are gone through together; ``seen`` is room
    for them, see `_collect`.
    """
    for i in range(7):
        sums[i] = 0.0
    r = unit * radius
    reach = r + REACH * spread
    core = r - REACH * spread  # inside, the coverage is flat and tells nothing of the place
    top, rows = _spans(line, cuts, p, tx, ty, length, r, reach, core, height, width, spans)
    step, stride, end, count = F(-ty), F(tx / length), start + height * width, 0
    for n in range(rows):
        j, span = top + n, 4 * n - 3 * (n & 7)
        y = j + 0.5 - line[p, 1]
        u, t = tx * y - ty * (0.5 - line[p, 0]), (ty * y + tx * (0.5 - line[p, 0])) / length
        left, after = spans[span], spans[span + 8] + 1
        stop, again = spans[span + 16], spans[span + 24]
        while True:
            while left < stop:
                if count > CHUNK - 8:
                    _add_moments(count, seen, r, alpha, unit, spread, sums)
                    count = 0
                have = min(stop - left, 8)
                place = start + j * width + left
                along = t + tx / length * left
                _collect(seen, count, u - ty * left, along, step, stride, transmittance, residual, place, have, end)
                count += have
                left += have
            if stop >= after:
                break
            left, stop = again, after
    _add_moments(count, seen, r, alpha, unit, spread, sums)


@nb.njit(parallel=True, cache=True, fastmath=True, error_model="numpy")
def gather_struts(
    points,
    radius,
    opacity,
    cameras,
    shapes,
    offsets,
    spreads,
    transmittance,
    residual,
    order,
    basis,
    hessian,
    gradient,
    widths,
):
    """Gauss-Newton terms of half the squared residual for every strut's control points, all views summed.

    residual is 1 - T - target for that; with the derivative of any other loss by the picture in its place, the
    gradient is that loss's.

    basis (P+1, 4) gives the polyline's points from the control points. hessian (E, S, 12, 12), gradient (E, S, 12)
    and widths (E, P, 2), curvature and slope by each piece's radius, are overwritten. S is 1 for the sum over all
    views, or their number for each by itself. Pixels that several struts cover couple them only through the
    transmittance; the small cross terms are left out.

    Struts are gone through in ``order`` (E,): where those that follow each other are near each other, the pixels that
    they cover are still at hand.
    """
    single = hessian.shape[1] == 1
    pieces, tallest = points.shape[1] - 1, 0
    for v in range(cameras.shape[0]):
        tallest = max(tallest, shapes[v, 0])
    for n in nb.prange(points.shape[0]):
        k = order[n]
        line, cuts, spans = (
            np.empty((pieces + 1, 3)),
            np.empty((pieces + 1, 5)),
            np.empty(4 * tallest + 32, dtype=np.int32),
        )
        sums, seen = np.empty(7), np.empty(ROOM, dtype=np.float32)
        pull_a, pull_b = np.empty(3), np.empty(3)
        slope = np.zeros((pieces + 1, 3))
        own = np.zeros((pieces + 1, 3, 3))
        cross = np.zeros((pieces, 3, 3))
        for p in range(pieces):
            widths[k, p, 0] = 0.0
            widths[k, p, 1] = 0.0
        for v in range(cameras.shape[0]):
            spread = spreads[v]
            if not single:
                slope[:] = 0.0
                own[:] = 0.0
                cross[:] = 0.0
                hessian[k, v] = 0.0
                gradient[k, v] = 0.0
            if not _project(points, k, cameras, v, line):
                continue
            _cuts(line, cuts)
            for p in range(pieces):
                dx, dy = line[p + 1, 0] - line[p, 0], line[p + 1, 1] - line[p, 1]
                length = sqrt(dx * dx + dy * dy)
                if opacity[k, p] <= 0.0 or length < 1e-9:
                    continue
                tx, ty = dx / length, dy / length
                unit = _half_width(line, p, cameras, v)
                _gather_piece(
                    line,
                    cuts,
                    p,
                    tx,
                    ty,
                    length,
                    unit,
                    radius[k, p],
                    opacity[k, p],
                    shapes[v, 0],
                    shapes[v, 1],
                    offsets[v],
                    spread,
                    transmittance,
                    residual,
                    spans,
                    seen,
                    sums,
                )
                widths[k, p, 0] += sums[5]
                widths[k, p, 1] += sums[6]
                _pull(line[p, 0], line[p, 1], line[p, 2], -ty, tx, cameras, v, pull_a)
                _pull(line[p + 1, 0], line[p + 1, 1], line[p + 1, 2], -ty, tx, cameras, v, pull_b)
                if single:  # views that may move tell nothing by how thick a strut looks: that would be its distance
                    _half_width_slope(line, p, cameras, v, sums[6] * radius[k, p] / unit, slope)
                for a in range(3):
                    slope[p, a] += sums[3] * pull_a[a]
                    slope[p + 1, a] += sums[4] * pull_b[a]
                    for b in range(3):
                        own[p, a, b] += sums[0] * pull_a[a] * pull_a[b]
                        own[p + 1, a, b] += sums[2] * pull_b[a] * pull_b[b]
                        cross[p, a, b] += sums[1] * pull_a[a] * pull_b[b]
            if not single:
                _to_control_points(basis, own, cross, slope, hessian, gradient, k, v)
        if single:
            _to_control_points(basis, own, cross, slope, hessian, gradient, k, 0)


@nb.njit(**HELPER)
def _to_control_points(basis, own, cross, slope, hessian, gradient, k, v):
    for a in range(12):
        gradient[k, v, a] = 0.0
        for b in range(12):
            hessian[k, v, a, b] = 0.0
    last = basis.shape[0] - 1
    for p in range(last + 1):
        for a in range(4):
            for x in range(3):
                gradient[k, v, 3 * a + x] += basis[p, a] * slope[p, x]
            for b in range(4):
                f = basis[p, a] * basis[p, b]
                for x in range(3):
                    for y in range(3):
                        hessian[k, v, 3 * a + x, 3 * b + y] += f * own[p, x, y]
                if p < last:
                    f1 = basis[p, a] * basis[p + 1, b]
                    f2 = basis[p + 1, a] * basis[p, b]
                    for x in range(3):
                        for y in range(3):
                            hessian[k, v, 3 * a + x, 3 * b + y] += f1 * cross[p, x, y] + f2 * cross[p, y, x]


@nb.njit(**HELPER)
def _add_disc(count, seen, radius, unit, spread, sums):
    """Add to the sums of `_gather_disc` what the ``count`` pixels say that `_collect` has put into seen, with how far
    they are from the disc's middle along rows and columns."""
    r, one, inverse, wide = F(radius), F(1.0), F(1.0 / spread), F(unit / spread)
    reach, core = F(radius + REACH * spread), F(max(radius - REACH * spread, 1e-9))
    xx, xy, yy, rr = F(0.0), F(0.0), F(0.0), F(0.0)
    a, b, c = F(0.0), F(0.0), F(0.0)
    for i in range(_padded(count, seen)):
        x, y, residual = seen[i], seen[ALONG + i], seen[RESIDUAL + i]
        d = np.sqrt(x * x + y * y)
        inside, near = _normal32((r - d) * inverse)
        beyond, far = _normal32((-r - d) * inverse)
        others = min(seen[TRANSMITTANCE + i] / (one - min(inside - beyond, F(OPAQUE))), one)
        others = others if others >= F(HIDDEN) and d <= reach and d >= core else F(0.0)
        by_place = others * (near - far) * inverse / max(d, F(1e-9))
        by_radius = others * (near + far) * wide
        by_x, by_y = x * by_place, y * by_place
        xx += by_x * by_x
        xy += by_x * by_y
        yy += by_y * by_y
        a += residual * by_x
        b += residual * by_y
        rr += by_radius * by_radius
        c += residual * by_radius
    sums[0] += xx
    sums[1] += xy
    sums[2] += yy
    sums[3] += a
    sums[4] += b
    sums[5] += rr
    sums[6] += c


@nb.njit(inline="always")
def _gather_disc(x, y, r, unit, height, width, start, spread, transmittance, residual, seen, sums):
    """Moments over the pixels of a disc about x, y, into sums: w by x x, x y and y y, g by x and by y, and for the
    radius w and g, which are those of `_gather_piece`."""
    for i in range(7):
        sums[i] = 0.0
    reach, core, end, count = r + REACH * spread, r - REACH * spread, start + height * width, 0
    for j in range(max(0, _first(y - reach - 0.5)), min(height - 1, int(floor(min(y + reach - 0.5, 1e9)))) + 1):
        left, last = _chord(j, x, y, reach, width)
        stop, again = last + 1, last + 1
        if abs(j + 0.5 - y) < core:  # inside, the coverage is flat
            first, flat = _chord(j, x, y, core, width)
            stop, again = max(first, left), flat + 1
        while True:
            while left < stop:
                if count > CHUNK - 8:
                    _add_disc(count, seen, r, unit, spread, sums)
                    count = 0
                have, place = min(stop - left, 8), start + j * width + left
                across, up = left + 0.5 - x, j + 0.5 - y
                _collect(seen, count, across, up, F(1.0), F(0.0), transmittance, residual, place, have, end)
                count += have
                left += have
            if stop > last:
                break
            left, stop = again, last + 1
    _add_disc(count, seen, r, unit, spread, sums)


@nb.njit(parallel=True, cache=True, fastmath=True, error_model="numpy")
def gather_joints(
    joints, joint_radius, cameras, shapes, offsets, spreads, transmittance, residual, hessian, gradient, widths
):
    """Gauss-Newton terms of the joints' discs: hessian (V, S, 3, 3), gradient (V, S, 3), S as in `gather_struts`, and
    widths (V, 2), curvature and slope by the discs' radius, are overwritten."""
    single = hessian.shape[1] == 1
    for k in nb.prange(joints.shape[0]):
        hessian[k] = 0.0
        gradient[k] = 0.0
        widths[k] = 0.0
        if joint_radius[k] <= 0.0:
            continue
        mx, my, sums = np.empty(3), np.empty(3), np.empty(7)
        seen = np.empty(ROOM, dtype=np.float32)
        for v in range(cameras.shape[0]):
            spread = spreads[v]
            height, width, start = shapes[v, 0], shapes[v, 1], offsets[v]
            x, y, z = _joint(joints, k, cameras, v)
            if z < 0.0:
                continue
            _pull(x, y, z, 1.0, 0.0, cameras, v, mx)
            _pull(x, y, z, 0.0, 1.0, cameras, v, my)
            r = 0.5 * (cameras[v, 12] + cameras[v, 13]) * joint_radius[k] / z
            _gather_disc(
                x,
                y,
                r,
                r / joint_radius[k],
                height,
                width,
                start,
                spread,
                transmittance,
                residual,
                seen,
                sums,
            )
            hxx, hxy, hyy, gx, gy = sums[0], sums[1], sums[2], sums[3], sums[4]
            widths[k, 0] += sums[5]
            widths[k, 1] += sums[6]
            at = 0 if single else v
            for a in range(3):
                gradient[k, at, a] += gx * mx[a] + gy * my[a]
                for b in range(3):
                    hessian[k, at, a, b] += (
                        hxx * mx[a] * mx[b] + hxy * (mx[a] * my[b] + my[a] * mx[b]) + hyy * my[a] * my[b]
                    )


@nb.njit(**HELPER)
def _add_evidence(count, seen, radius, alpha, spread, sums):
    """Add to the sums of `gather_opacity` what the ``count`` pixels say that `_collect` has put into seen."""
    r, opacity, inverse, one, core = F(radius), F(alpha), F(1.0 / spread), F(1.0), F(REACH)
    weight, slope = F(0.0), F(0.0)
    for i in range(_padded(count, seen)):
        u = abs(seen[i])
        inside, _ = _normal32(min((r - u) * inverse, core))
        beyond, _ = _normal32((-r - u) * inverse)
        c = inside - beyond
        others = min(seen[TRANSMITTANCE + i] / (one - min(opacity * c, F(OPAQUE))), one)
        plain = c * others if others >= F(HIDDEN) else F(0.0)
        weight += plain * plain
        slope += seen[RESIDUAL + i] * plain
    sums[0] += weight
    sums[1] += slope


@nb.njit(parallel=True, cache=True, fastmath=True, error_model="numpy")
def gather_opacity(
    points, radius, opacity, cameras, shapes, offsets, spreads, transmittance, residual, order, evidence
):
    """What the pictures say of each piece's presence.

    evidence (E, P, 2), out: the squared weight W = sum (T_others c)^2 and the slope sum residual T_others c, so
    that opacity - slope / W is the least-squares opacity and W, in pixels, how much of the piece is in plain view.
    Struts are gone through in ``order`` (E,), as by `gather_struts`.
    """
    pieces, tallest = points.shape[1] - 1, 0
    for v in range(cameras.shape[0]):
        tallest = max(tallest, shapes[v, 0])
    for n in nb.prange(points.shape[0]):
        k = order[n]
        line, cuts, spans = (
            np.empty((pieces + 1, 3)),
            np.empty((pieces + 1, 5)),
            np.empty(4 * tallest + 32, dtype=np.int32),
        )
        seen, sums = np.empty(ROOM, dtype=np.float32), np.empty(2)
        for p in range(pieces):
            evidence[k, p, 0] = 0.0
            evidence[k, p, 1] = 0.0
        for v in range(cameras.shape[0]):
            spread = spreads[v]
            height, width, start = shapes[v, 0], shapes[v, 1], offsets[v]
            if not _project(points, k, cameras, v, line):
                continue
            _cuts(line, cuts)
            for p in range(pieces):
                dx, dy = line[p + 1, 0] - line[p, 0], line[p + 1, 1] - line[p, 1]
                length = sqrt(dx * dx + dy * dy)
                if length < 1e-9:
                    continue
                tx, ty = dx / length, dy / length
                r = _half_width(line, p, cameras, v) * radius[k, p]
                reach = r + REACH * spread
                top, rows = _spans(line, cuts, p, tx, ty, length, r, reach, -1.0, height, width, spans)
                sums[0], sums[1], count = 0.0, 0.0, 0
                for m in range(rows):
                    j, span = top + m, 4 * m - 3 * (m & 7)
                    u = tx * (j + 0.5 - line[p, 1]) - ty * (0.5 - line[p, 0])
                    left, after = spans[span], spans[span + 8] + 1
                    while left < after:
                        if count > CHUNK - 8:
                            _add_evidence(count, seen, r, opacity[k, p], spread, sums)
                            count = 0
                        have, place = min(after - left, 8), start + j * width + left
                        begin = u - ty * left
                        _collect(
                            seen,
                            count,
                            begin,
                            0.0,
                            F(-ty),
                            F(0.0),
                            transmittance,
                            residual,
                            place,
                            have,
                            start + height * width,
                        )
                        count += have
                        left += have
                _add_evidence(count, seen, r, opacity[k, p], spread, sums)
                evidence[k, p, 0] += sums[0]
                evidence[k, p, 1] += sums[1]
