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

Helpers and constants are in this file too, and nowhere else: numba keeps machine code until the file of the function
that is called changes, and would not notice an edit elsewhere (``tests/test_compiled_code.py`` sees to it).
"""

from __future__ import annotations

from math import ceil, erf, exp, floor, pi, sqrt

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

NOWHERE = 1e6
"""Pixels off a centreline where nothing of a rod is seen."""

F = np.float32

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


@nb.njit(cache=True, fastmath=True)
def _project(points, camera, out):
    """Pixel x, y and depth of (P+1, 3) points into ``out``; False if one is behind the camera."""
    seen = True
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        cx = camera[0] * x + camera[1] * y + camera[2] * z + camera[9]
        cy = camera[3] * x + camera[4] * y + camera[5] * z + camera[10]
        cz = camera[6] * x + camera[7] * y + camera[8] * z + camera[11]
        if cz < 1e-6:
            seen = False
            cz = 1e-6
        lens = 1.0 + camera[16] * (cx * cx + cy * cy) / (cz * cz)
        out[i, 0] = camera[12] * cx / cz * lens + camera[14]
        out[i, 1] = camera[13] * cy / cz * lens + camera[15]
        out[i, 2] = cz
    return seen


@nb.njit(inline="always")
def _half_width(p, q, camera):
    """Apparent half width in pixels, per mm of radius, of the round rod about p..q (rows x, y, depth).

    A pixel's ray v meets an infinite cylinder when |v.N| <= r |v x t| / |x x t|, with N the unit normal of the
    plane through the camera and the axis; at the piece itself |v x t| / |x x t| is one over the depth.
    """
    x0 = (p[0] - camera[14]) / camera[12] * p[2]
    y0 = (p[1] - camera[15]) / camera[13] * p[2]
    x1 = (q[0] - camera[14]) / camera[12] * q[2]
    y1 = (q[1] - camera[15]) / camera[13] * q[2]
    tx, ty, tz = x1 - x0, y1 - y0, q[2] - p[2]
    nx = y0 * tz - p[2] * ty
    ny = p[2] * tx - x0 * tz
    nz = x0 * ty - y0 * tx
    slope = sqrt((nx / camera[12]) ** 2 + (ny / camera[13]) ** 2)
    return 2.0 / (p[2] + q[2]) * sqrt(nx * nx + ny * ny + nz * nz) / max(slope, 1e-12)


@nb.njit(cache=True, fastmath=True)
def _half_width_slope(p, q, camera, scale, slope_p, slope_q):
    """Adds scale times the derivative of `_half_width` by the 3D points of p and q, in world axes."""
    x0, y0, z0 = (p[0] - camera[14]) / camera[12] * p[2], (p[1] - camera[15]) / camera[13] * p[2], p[2]
    x1, y1, z1 = (q[0] - camera[14]) / camera[12] * q[2], (q[1] - camera[15]) / camera[13] * q[2], q[2]
    nx, ny, nz = y0 * z1 - z0 * y1, z0 * x1 - x0 * z1, x0 * y1 - y0 * x1
    fx2, fy2 = camera[12] ** 2, camera[13] ** 2
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
        slope_p[e] += scale * (px * camera[e] + py * camera[3 + e] + pz * camera[6 + e])
        slope_q[e] += scale * (qx * camera[e] + qy * camera[3 + e] + qz * camera[6 + e])


@nb.njit(cache=True, fastmath=True)
def _cuts(line, cuts):
    """Directions (P+1, 2) that divide the picture plane between neighbouring pieces: the bisectors of their turns.

    Two pieces decide by the same line which of them a pixel belongs to, so that none is counted twice or never. On
    the outer side of a turn a piece goes on to the line, but no further than its half width: where the polyline turns
    back on itself, as that of a curved strut seen end on, it would run on across the picture.
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
        cuts[p, 0], cuts[p, 1] = before_x + after_x, before_y + after_y
        before_x, before_y = after_x, after_y


@nb.njit(cache=True)
def _cut_line(point, cut):
    """Of the dividing line through the point: its column in row 0, how much that grows a row, and which side is
    ahead: 1 to the right, -1 to the left, and for a line along the rows 2 below, -2 above."""
    if abs(cut[0]) < 1e-9:
        return point[1] - 0.5, 0.0, 2 if cut[1] > 0.0 else -2
    slope = -cut[1] / cut[0]
    return point[0] - 0.5 - slope * (point[1] - 0.5), slope, 1 if cut[0] > 0.0 else -1


@nb.njit(inline="always")
def _first_column(x):
    return int(ceil(min(max(x, -1e9), 1e9)))


@nb.njit(cache=True)
def _edges(p, q, cut_p, cut_q, tx, ty, length, half, reach, edges):
    """Everything that bounds the pixels of the piece p..q, for `_columns`, into edges (12,)."""
    if abs(ty) > 1e-9:  # |-ty x + tx y| <= reach, x and y from p
        edges[0] = tx / ty
        edges[1] = p[0] - 0.5 - edges[0] * (p[1] - 0.5)
        edges[2] = reach / abs(ty)
    else:
        edges[0], edges[1], edges[2] = 0.0, p[0], 1e9
    edges[3], edges[4], edges[5] = _cut_line(p, cut_p)
    edges[6], edges[7], edges[8] = _cut_line(q, cut_q)
    if abs(tx) > 1e-9:  # |tx x + ty y| <= length / 2 + half, x and y from the middle
        edges[9] = -ty / tx
        edges[10] = 0.5 * (p[0] + q[0]) - 0.5 - edges[9] * (0.5 * (p[1] + q[1]) - 0.5)
        edges[11] = (0.5 * length + half) / abs(tx)
    else:
        edges[9], edges[10], edges[11] = 0.0, p[0], 1e9


@nb.njit(inline="always")
def _columns(row, edges, width):
    """First and last column of the row that belong to the piece and are within reach of its centreline."""
    across, along = edges[1] + edges[0] * row, edges[10] + edges[9] * row
    left = max(0, _first_column(max(across - edges[2], along - edges[11])))
    right = min(width - 1, int(floor(min(max(min(across + edges[2], along + edges[11]), -1e9), 1e9))))
    if abs(edges[5]) == 1.0:
        column = _first_column(edges[3] + edges[4] * row)
        if edges[5] > 0.0:
            left = max(left, column)
        else:
            right = min(right, column - 1)
    elif (row >= edges[3]) != (edges[5] > 0.0):
        return 0, -1
    if abs(edges[8]) == 1.0:
        column = _first_column(edges[6] + edges[7] * row)
        if edges[8] > 0.0:
            right = min(right, column - 1)
        else:
            left = max(left, column)
    elif (row >= edges[6]) == (edges[8] > 0.0):
        return 0, -1
    return left, right


@nb.njit(inline="always")
def _flat_columns(row, left, right, edges, core, tx, ty, ay):
    """First column of left..right within ``core`` of the centreline and the first one after; both behind where none."""
    if core <= 0.0 or right < left:
        return right + 1, right + 1
    if abs(ty) > 1e-9:
        middle, half = edges[1] + edges[0] * row, core / abs(ty)
        first = min(max(_first_column(middle - half), left), right + 1)
        return first, min(max(_first_column(middle + half), first), right + 1)
    return (left, right + 1) if abs(tx * (row + 0.5 - ay)) < core else (right + 1, right + 1)


@nb.njit(inline="always")
def _beyond(cut, tx, ty, half, reach):
    """How far a piece goes on beyond its end, on the outer side of the turn."""
    return min(half, reach * abs(tx * cut[1] - ty * cut[0]) / max(tx * cut[0] + ty * cut[1], 1e-9))


@nb.njit(inline="always")
def _rows(p, q, cut_p, cut_q, tx, ty, half, reach, height):
    """First and last row of the piece p..q."""
    p_more, q_more = abs(ty) * _beyond(cut_p, tx, ty, half, reach), abs(ty) * _beyond(cut_q, tx, ty, half, reach)
    low = min(p[1] - p_more, q[1] - q_more) - reach * abs(tx)
    high = max(p[1] + p_more, q[1] + q_more) + reach * abs(tx)
    return max(0, int(floor(max(low, -1e9) - 0.5))), min(height - 1, int(ceil(min(high, 1e9) - 0.5)))


@nb.njit(cache=True, fastmath=True)
def _joint(point, camera):
    """Pixel x, y, depth of one point."""
    x, y, z = point[0], point[1], point[2]
    cx = camera[0] * x + camera[1] * y + camera[2] * z + camera[9]
    cy = camera[3] * x + camera[4] * y + camera[5] * z + camera[10]
    cz = camera[6] * x + camera[7] * y + camera[8] * z + camera[11]
    if cz < 1e-6:
        return 0.0, 0.0, -1.0
    lens = 1.0 + camera[16] * (cx * cx + cy * cy) / (cz * cz)
    return camera[12] * cx / cz * lens + camera[14], camera[13] * cy / cz * lens + camera[15], cz


@nb.njit(cache=True, fastmath=True)
def _darken_piece(p, q, cut_p, cut_q, camera, radius, alpha, height, width, start, spread, edges, transmittance):
    ax, ay = p[0], p[1]
    dx, dy = q[0] - ax, q[1] - ay
    length = sqrt(dx * dx + dy * dy)
    if length < 1e-9:
        return
    tx, ty = dx / length, dy / length
    r = _half_width(p, q, camera) * radius
    reach = r + REACH * spread
    _edges(p, q, cut_p, cut_q, tx, ty, length, r, reach, edges)
    top, bottom = _rows(p, q, cut_p, cut_q, tx, ty, r, reach, height)
    for j in range(top, bottom + 1):
        y = j + 0.5 - ay
        left, right = _columns(j, edges, width)
        at = start + j * width
        for i in range(left, right + 1):
            d = abs(-ty * (i + 0.5 - ax) + tx * y)
            c = min(alpha * _coverage(d, r, spread), OPAQUE)
            transmittance[at + i] = max(transmittance[at + i] * (1.0 - c), DARK)


@nb.njit(parallel=True, cache=True, fastmath=True)
def render(points, radius, opacity, joints, joint_radius, cameras, shapes, offsets, spreads, transmittance):
    """Transmittance of all views.

    points (E, P+1, 3), radius and opacity (E, P), joints (V, 3), joint_radius (V,) with 0 for none, cameras
    (N, 17), shapes (N, 2) height and width, offsets (N,), spreads (N,) in pixels, transmittance (pixels,) float32, out.
    """
    for v in nb.prange(cameras.shape[0]):
        camera, spread = cameras[v], spreads[v]
        height, width, start = shapes[v, 0], shapes[v, 1], offsets[v]
        for i in range(start, start + height * width):
            transmittance[i] = 1.0
        line, cuts, edges = np.empty((points.shape[1], 3)), np.empty((points.shape[1], 2)), np.empty(12)
        for k in range(points.shape[0]):
            if not _project(points[k], camera, line):
                continue
            _cuts(line, cuts)
            for p in range(points.shape[1] - 1):
                if opacity[k, p] > 0.0:
                    _darken_piece(
                        line[p],
                        line[p + 1],
                        cuts[p],
                        cuts[p + 1],
                        camera,
                        radius[k, p],
                        opacity[k, p],
                        height,
                        width,
                        start,
                        spread,
                        edges,
                        transmittance,
                    )
        for k in range(joints.shape[0]):
            if joint_radius[k] <= 0.0:
                continue
            x, y, z = _joint(joints[k], camera)
            if z < 0.0:
                continue
            r = 0.5 * (camera[12] + camera[13]) * joint_radius[k] / z
            reach = r + REACH * spread
            for j in range(max(0, int(floor(y - reach - 0.5))), min(height - 1, int(ceil(y + reach - 0.5))) + 1):
                at = start + j * width
                for i in range(max(0, int(floor(x - reach - 0.5))), min(width - 1, int(ceil(x + reach - 0.5))) + 1):
                    d = sqrt((i + 0.5 - x) ** 2 + (j + 0.5 - y) ** 2)
                    if d <= reach:
                        c = min(_coverage(d, r, spread), OPAQUE)
                        transmittance[at + i] = max(transmittance[at + i] * (1.0 - c), DARK)


@nb.njit(parallel=True, cache=True, fastmath=True)
def compare(transmittance, target, shapes, offsets, residual, losses):
    """What the pictures of the rods, 1 - T, have more than the target (pixels,): into residual (pixels,), and half
    its square, summed over each view, into losses (N,)."""
    for v in nb.prange(shapes.shape[0]):
        total = 0.0
        for j in range(shapes[v, 0]):
            at = offsets[v] + j * shapes[v, 1]
            row = F(0.0)
            for i in range(shapes[v, 1]):
                more = F(1.0) - transmittance[at + i] - target[at + i]
                residual[at + i] = more
                row += more * more
            total += float(row)
        losses[v] = 0.5 * total


@nb.njit(inline="always")
def _pull(point, nx, ny, camera, m):
    """Change of the pixel coordinate along (nx, ny) for a motion of the 3D point (row x, y, depth), into m (3,)."""
    x = (point[0] - camera[14]) / camera[12]
    y = (point[1] - camera[15]) / camera[13]
    a = nx * camera[12] / point[2]
    b = ny * camera[13] / point[2]
    c = -(a * x + b * y)
    for e in range(3):
        m[e] = a * camera[e] + b * camera[3 + e] + c * camera[6 + e]


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


@nb.njit(cache=True, fastmath=True)
def _padded(count, seen):
    """A number of pixels that fills vector registers, with as many behind the first ``count`` as are missing: black and
    far off, where nothing is covered. What is left over of a loop in registers takes as long as all the rest."""
    whole = (count + LANES - 1) // LANES * LANES
    for i in range(count, whole):
        seen[0, i], seen[1, i], seen[2, i], seen[3, i] = F(NOWHERE), F(0.0), F(1.0), F(0.0)
    return whole


@nb.njit(cache=True, fastmath=True, error_model="numpy")
def _add_moments(count, seen, radius, alpha, unit, spread, sums):
    """Add to the sums of `_gather_edge` what ``count`` pixels say, of each of which seen (4, CHUNK) has how far across
    the piece it is, in pixels, which share along it, and its transmittance and residual."""
    across, along, through, residual = seen[0], seen[1], seen[2], seen[3]
    r, one, inverse = F(radius), F(1.0), F(1.0 / spread)
    opacity, share, wide = F(alpha), F(alpha / spread), F(alpha * unit / spread)
    aa, ab, bb, rr = F(0.0), F(0.0), F(0.0), F(0.0)
    a, b, c = F(0.0), F(0.0), F(0.0)
    for i in range(_padded(count, seen)):
        u = across[i]
        inside, near = _normal32((r - u) * inverse)
        beyond, far = _normal32((-r - u) * inverse)
        covered = min(opacity * (inside - beyond), F(OPAQUE))
        others = min(through[i] / (one - covered), one)
        others = others if others >= F(HIDDEN) else F(0.0)
        by_place = others * share * (far - near)
        by_radius = others * wide * (near + far)
        at_q = by_place * along[i]
        at_p = by_place - at_q
        aa += at_p * at_p
        ab += at_p * at_q
        bb += at_q * at_q
        a += residual[i] * at_p
        b += residual[i] * at_q
        rr += by_radius * by_radius
        c += residual[i] * by_radius
    sums[0] += aa
    sums[1] += ab
    sums[2] += bb
    sums[3] -= a
    sums[4] -= b
    sums[5] += rr
    sums[6] += c


@nb.njit(cache=True, fastmath=True, error_model="numpy")
def _gather_edge(
    p,
    q,
    cut_p,
    cut_q,
    camera,
    radius,
    alpha,
    height,
    width,
    start,
    spread,
    edges,
    transmittance,
    residual,
    seen,
    sums,
):
    """Moments over the pixels of one piece, into sums: (1-t)^2 w, t(1-t) w, t^2 w, (1-t) g, t g, and for the
    radius w and g, with w the squared and g the residual-weighted derivative of the picture.

    Rows are too short for vector registers, so that the pixels of several are gone through together; ``seen`` is room
    for them, see `_add_moments`.
    """
    for i in range(7):
        sums[i] = 0.0
    ax, ay = p[0], p[1]
    dx, dy = q[0] - ax, q[1] - ay
    length = sqrt(dx * dx + dy * dy)
    if length < 1e-9:
        return False
    tx, ty = dx / length, dy / length
    unit = _half_width(p, q, camera)
    r = unit * radius
    reach = r + REACH * spread
    core = r - REACH * spread  # inside, the coverage is flat and tells nothing of the place
    _edges(p, q, cut_p, cut_q, tx, ty, length, r, reach, edges)
    top, bottom = _rows(p, q, cut_p, cut_q, tx, ty, r, reach, height)
    count = 0
    for j in range(top, bottom + 1):
        left, right = _columns(j, edges, width)
        flat_left, flat_right = _flat_columns(j, left, right, edges, core, tx, ty, ay)
        y = j + 0.5 - ay
        u, t = tx * y - ty * (0.5 - ax), (ty * y + tx * (0.5 - ax)) / length
        at = start + j * width
        while left <= right:
            if left == flat_left:
                left = flat_right
            last = min(right + 1, left + CHUNK - count)
            if left < flat_left:
                last = min(last, flat_left)
            first = count - left
            for i in range(left, last):
                seen[0, first + i] = u - ty * i
                seen[1, first + i] = t + tx / length * i
                seen[2, first + i] = transmittance[at + i]
                seen[3, first + i] = residual[at + i]
            count += last - left
            left = last
            if count == CHUNK:
                _add_moments(count, seen, r, alpha, unit, spread, sums)
                count = 0
    _add_moments(count, seen, r, alpha, unit, spread, sums)
    return True


@nb.njit(parallel=True, cache=True, fastmath=True)
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
    pieces = points.shape[1] - 1
    for n in nb.prange(points.shape[0]):
        k = order[n]
        line, cuts, edges = np.empty((pieces + 1, 3)), np.empty((pieces + 1, 2)), np.empty(12)
        sums = np.empty(7)
        seen = np.empty((4, CHUNK), dtype=np.float32)
        pull_a, pull_b = np.empty(3), np.empty(3)
        slope = np.zeros((pieces + 1, 3))
        own = np.zeros((pieces + 1, 3, 3))
        cross = np.zeros((pieces, 3, 3))
        for p in range(pieces):
            widths[k, p, 0] = 0.0
            widths[k, p, 1] = 0.0
        for v in range(cameras.shape[0]):
            camera, spread = cameras[v], spreads[v]
            if not single:
                slope[:] = 0.0
                own[:] = 0.0
                cross[:] = 0.0
                hessian[k, v] = 0.0
                gradient[k, v] = 0.0
            if not _project(points[k], camera, line):
                continue
            _cuts(line, cuts)
            for p in range(pieces):
                if opacity[k, p] <= 0.0:
                    continue
                if not _gather_edge(
                    line[p],
                    line[p + 1],
                    cuts[p],
                    cuts[p + 1],
                    camera,
                    radius[k, p],
                    opacity[k, p],
                    shapes[v, 0],
                    shapes[v, 1],
                    offsets[v],
                    spread,
                    edges,
                    transmittance,
                    residual,
                    seen,
                    sums,
                ):
                    continue
                widths[k, p, 0] += sums[5]
                widths[k, p, 1] += sums[6]
                dx, dy = line[p + 1, 0] - line[p, 0], line[p + 1, 1] - line[p, 1]
                length = sqrt(dx * dx + dy * dy)
                _pull(line[p], -dy / length, dx / length, camera, pull_a)
                _pull(line[p + 1], -dy / length, dx / length, camera, pull_b)
                unit = _half_width(line[p], line[p + 1], camera)
                if single:  # views that may move tell nothing by how thick a strut looks: that would be its distance
                    by_width = sums[6] * radius[k, p] / unit
                    _half_width_slope(line[p], line[p + 1], camera, by_width, slope[p], slope[p + 1])
                for a in range(3):
                    slope[p, a] += sums[3] * pull_a[a]
                    slope[p + 1, a] += sums[4] * pull_b[a]
                    for b in range(3):
                        own[p, a, b] += sums[0] * pull_a[a] * pull_a[b]
                        own[p + 1, a, b] += sums[2] * pull_b[a] * pull_b[b]
                        cross[p, a, b] += sums[1] * pull_a[a] * pull_b[b]
            if not single:
                _to_control_points(basis, own, cross, slope, hessian[k, v], gradient[k, v])
        if single:
            _to_control_points(basis, own, cross, slope, hessian[k, 0], gradient[k, 0])


@nb.njit(cache=True, fastmath=True)
def _to_control_points(basis, own, cross, slope, hessian, gradient):
    for a in range(12):
        gradient[a] = 0.0
        for b in range(12):
            hessian[a, b] = 0.0
    last = basis.shape[0] - 1
    for p in range(last + 1):
        for a in range(4):
            for x in range(3):
                gradient[3 * a + x] += basis[p, a] * slope[p, x]
            for b in range(4):
                f = basis[p, a] * basis[p, b]
                for x in range(3):
                    for y in range(3):
                        hessian[3 * a + x, 3 * b + y] += f * own[p, x, y]
                if p < last:
                    f1 = basis[p, a] * basis[p + 1, b]
                    f2 = basis[p + 1, a] * basis[p, b]
                    for x in range(3):
                        for y in range(3):
                            hessian[3 * a + x, 3 * b + y] += f1 * cross[p, x, y] + f2 * cross[p, y, x]


@nb.njit(parallel=True, cache=True, fastmath=True)
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
        row = np.empty(3)
        mx, my = np.empty(3), np.empty(3)
        for v in range(cameras.shape[0]):
            camera, spread = cameras[v], spreads[v]
            height, width, start = shapes[v, 0], shapes[v, 1], offsets[v]
            x, y, z = _joint(joints[k], camera)
            if z < 0.0:
                continue
            row[0], row[1], row[2] = x, y, z
            _pull(row, 1.0, 0.0, camera, mx)
            _pull(row, 0.0, 1.0, camera, my)
            r = 0.5 * (camera[12] + camera[13]) * joint_radius[k] / z
            unit = r / joint_radius[k]
            reach, core = r + REACH * spread, r - REACH * spread
            hxx, hxy, hyy, gx, gy = 0.0, 0.0, 0.0, 0.0, 0.0
            for j in range(max(0, int(floor(y - reach - 0.5))), min(height - 1, int(ceil(y + reach - 0.5))) + 1):
                at = start + j * width
                for i in range(max(0, int(floor(x - reach - 0.5))), min(width - 1, int(ceil(x + reach - 0.5))) + 1):
                    ex, ey = i + 0.5 - x, j + 0.5 - y
                    d = sqrt(ex * ex + ey * ey)
                    if d > reach or d < core or d < 1e-9:
                        continue
                    through = transmittance[at + i]
                    inside, near = _normal((r - d) / spread)
                    beyond, far = _normal((-r - d) / spread)
                    c = min(inside - beyond, OPAQUE)
                    others = min(through / (1.0 - c), 1.0)
                    if others < HIDDEN:
                        continue
                    by_place = others * (far - near) / spread
                    ux, uy = -ex / d * by_place, -ey / d * by_place
                    hxx += ux * ux
                    hxy += ux * uy
                    hyy += uy * uy
                    gx += residual[at + i] * ux
                    gy += residual[at + i] * uy
                    by_radius = others * (near + far) / spread * unit
                    widths[k, 0] += by_radius * by_radius
                    widths[k, 1] += residual[at + i] * by_radius
            at = 0 if single else v
            for a in range(3):
                gradient[k, at, a] += gx * mx[a] + gy * my[a]
                for b in range(3):
                    hessian[k, at, a, b] += (
                        hxx * mx[a] * mx[b] + hxy * (mx[a] * my[b] + my[a] * mx[b]) + hyy * my[a] * my[b]
                    )


@nb.njit(cache=True, fastmath=True, error_model="numpy")
def _add_evidence(count, seen, radius, alpha, spread, sums):
    """Add to the sums of `gather_opacity` what ``count`` pixels say, as `_add_moments` takes them."""
    across, through, residual = seen[0], seen[2], seen[3]
    r, opacity, inverse, one, core = F(radius), F(alpha), F(1.0 / spread), F(1.0), F(REACH)
    weight, slope = F(0.0), F(0.0)
    for i in range(_padded(count, seen)):
        u = abs(across[i])
        inside, _ = _normal32(min((r - u) * inverse, core))
        beyond, _ = _normal32((-r - u) * inverse)
        c = inside - beyond
        others = min(through[i] / (one - min(opacity * c, F(OPAQUE))), one)
        plain = c * others if others >= F(HIDDEN) else F(0.0)
        weight += plain * plain
        slope += residual[i] * plain
    sums[0] += weight
    sums[1] += slope


@nb.njit(parallel=True, cache=True, fastmath=True)
def gather_opacity(
    points, radius, opacity, cameras, shapes, offsets, spreads, transmittance, residual, order, evidence
):
    """What the pictures say of each piece's presence.

    evidence (E, P, 2), out: the squared weight W = sum (T_others c)^2 and the slope sum residual T_others c, so
    that opacity - slope / W is the least-squares opacity and W, in pixels, how much of the piece is in plain view.
    Struts are gone through in ``order`` (E,), as by `gather_struts`.
    """
    pieces = points.shape[1] - 1
    for n in nb.prange(points.shape[0]):
        k = order[n]
        line, cuts, edges = np.empty((pieces + 1, 3)), np.empty((pieces + 1, 2)), np.empty(12)
        seen, sums = np.empty((4, CHUNK), dtype=np.float32), np.empty(2)
        for p in range(pieces):
            evidence[k, p, 0] = 0.0
            evidence[k, p, 1] = 0.0
        for v in range(cameras.shape[0]):
            camera, spread = cameras[v], spreads[v]
            height, width, start = shapes[v, 0], shapes[v, 1], offsets[v]
            if not _project(points[k], camera, line):
                continue
            _cuts(line, cuts)
            for p in range(pieces):
                a, b = line[p], line[p + 1]
                dx, dy = b[0] - a[0], b[1] - a[1]
                length = sqrt(dx * dx + dy * dy)
                if length < 1e-9:
                    continue
                tx, ty = dx / length, dy / length
                r = _half_width(a, b, camera) * radius[k, p]
                reach = r + REACH * spread
                _edges(a, b, cuts[p], cuts[p + 1], tx, ty, length, r, reach, edges)
                top, bottom = _rows(a, b, cuts[p], cuts[p + 1], tx, ty, r, reach, height)
                sums[0], sums[1], count = 0.0, 0.0, 0
                for j in range(top, bottom + 1):
                    left, right = _columns(j, edges, width)
                    at, u = start + j * width, tx * (j + 0.5 - a[1]) - ty * (0.5 - a[0])
                    while left <= right:
                        last = min(right + 1, left + CHUNK - count)
                        first = count - left
                        for i in range(left, last):
                            seen[0, first + i] = u - ty * i
                            seen[2, first + i] = transmittance[at + i]
                            seen[3, first + i] = residual[at + i]
                        count += last - left
                        left = last
                        if count == CHUNK:
                            _add_evidence(count, seen, r, opacity[k, p], spread, sums)
                            count = 0
                _add_evidence(count, seen, r, opacity[k, p], spread, sums)
                evidence[k, p, 0] += sums[0]
                evidence[k, p, 1] += sums[1]
