#!/usr/bin/env python3
"""Facet contact by sampling: points on the triangles, denser where the contact can be.

Every sample q is on the part, so the true height is at least F(q). A sample stands for a piece of
its triangle, a triangle too, all within h of it. Over that piece, with d and z' measured at q,
  F <= y' + h + sqrt(max m(d +- h)^2 - max(|z'| - h, 0)^2)
because no coordinate changes by more than h; and, where q is in reach, since F is concave,
  F <= F(q) + max over the corners c of grad F(q) . (c - q).
Pieces whose bound is below the greatest sample cannot hold the contact and are dropped; the others
are split in four, until best sample and greatest bound are within --gap, or the pieces are
smaller than --spacing (or too many: a line of contact). The path must lie between the two (within --tolerance), and its contact
must lie on the mesh and give its height.
"""

import numpy as np

import common

MOST = 20_000
ROUNDING = 1e-11


def split(cells):
    """Each triangle in four, by the midpoints of its edges."""
    a, b, c = cells[:, 0], cells[:, 1], cells[:, 2]
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([np.stack(p, axis=1) for p in parts])


def slope(wheel, d, m):
    """dm/dd; infinite at the rim of a torus."""
    if wheel.kind != "torus":
        return np.full_like(d, wheel.slope)
    with np.errstate(divide="ignore", invalid="ignore"):
        return -d / (m - wheel.major)


def height(points, x, wheel):
    """F of points in the turned frame, -inf out of reach."""
    d = points[..., 0] - x
    m = wheel.profile(np.clip(d, -wheel.half_width, wheel.half_width))
    q = m * m - points[..., 2] ** 2
    reached = (np.abs(d) <= wheel.half_width) & (q >= 0.0)
    return np.where(reached, points[..., 1] + np.sqrt(np.maximum(q, 0.0)), -np.inf)


def bounds(cells, x, wheel):
    """For each piece: its greatest sample, the bound of its F, and its radius."""
    centre = cells.mean(axis=1)
    h = np.linalg.norm(cells - centre[:, None], axis=2).max(axis=1)
    sampled = np.maximum(height(cells, x, wheel).max(axis=1), height(centre, x, wheel))
    w = wheel.half_width
    d = centre[:, 0] - x
    low, high = np.maximum(d - h, -w), np.minimum(d + h, w)
    m = wheel.highest(low, np.maximum(low, high))
    q = m * m - np.maximum(np.abs(centre[:, 2]) - h, 0.0) ** 2
    reachable = (low <= high) & (q >= 0.0)
    bound = np.where(reachable, centre[:, 1] + h + np.sqrt(np.maximum(q, 0.0)), -np.inf)

    # The tangent plane of the concave F; over a triangle it is highest at a corner.
    f = height(centre, x, wheel)
    inside = np.isfinite(f)
    with np.errstate(divide="ignore", invalid="ignore"):
        m = wheel.profile(np.clip(d, -w, w))
        root = np.sqrt(m * m - centre[:, 2] ** 2)
        g = np.stack([m * slope(wheel, d, m) / root, np.ones_like(d), -centre[:, 2] / root], axis=1)
        rise = ((cells - centre[:, None]) * g[:, None]).sum(axis=2).max(axis=1)
        tangent = f + rise
    usable = inside & np.isfinite(tangent)
    return sampled, np.where(usable, np.minimum(bound, tangent), bound), h


def search(cells, x, wheel, gap, spacing):
    """Greatest sample, greatest bound, and samples taken."""
    best, settled, taken = -np.inf, -np.inf, 0
    while True:
        sampled, bound, h = bounds(cells, x, wheel)
        taken += 4 * len(cells)
        best = max(best, sampled.max(initial=-np.inf))
        open_ = bound > best + gap
        # Pieces too small or too many to split keep their bound.
        small = open_ & ((h <= spacing) | (open_.sum() > MOST))
        settled = max(settled, bound[small].max(initial=-np.inf))
        cells = cells[open_ & ~small]
        if len(cells) == 0:
            return best, max(best + gap, settled) if np.isfinite(best) else settled, taken
        cells = split(cells)


def distance(p, triangles):
    """From a point to the nearest triangle."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    best = np.inf
    for s, e in ((a, b), (b, c), (c, a)):
        along = e - s
        length = np.maximum((along**2).sum(axis=1), 1e-300)
        t = np.clip(((p - s) * along).sum(axis=1) / length, 0.0, 1.0)
        best = min(best, np.linalg.norm(s + t[:, None] * along - p, axis=1).min(initial=np.inf))
    n = np.cross(b - a, c - a)
    size = np.linalg.norm(n, axis=1)
    flat = size > 0.0
    n = n[flat] / size[flat, None]
    within = np.ones(len(n), bool)
    for s, e in ((a, b), (b, c), (c, a)):
        within &= (np.cross((e - s)[flat], p - s[flat]) * n).sum(axis=1) >= 0.0
    off = np.abs(((p - a[flat]) * n).sum(axis=1))
    return min(best, off[within].min(initial=np.inf))


def main():
    parser = common.arguments(__doc__)
    parser.add_argument("mesh", help="STL file")
    parser.add_argument("csv", help="path.csv under test")
    parser.add_argument("--positions", type=int, default=1000, help="how many to test, spread over the path")
    parser.add_argument("--gap", type=float, default=1e-9, help="bound less best sample to stop at, mm")
    parser.add_argument("--spacing", type=float, default=1e-6, help="smallest piece, mm")
    parser.add_argument("--tolerance", type=float, default=1e-9, help="mm")
    common.add_axis_arguments(parser)
    common.add_wheel_arguments(parser)
    args = parser.parse_args()
    wheel = common.wheel(args)
    path = common.read_path(args.csv)
    cos, sin = path.turn()
    part = common.placed(common.read_stl(args.mesh), args)
    low, high = part[:, :, 0].min(axis=1), part[:, :, 0].max(axis=1)

    widths, worst = [0.0], 0.0
    taken, touched, rim = 0, 0, 0
    chosen = common.spread(path, args.positions)
    for i in chosen:
        x, c, s = path.x[i], cos[i], sin[i]
        near = part[(high >= x - wheel.half_width) & (low <= x + wheel.half_width)]
        turned = np.stack(
            [near[..., 0], c * near[..., 1] - s * near[..., 2], s * near[..., 1] + c * near[..., 2]],
            axis=-1,
        )
        best, bound, samples = search(turned, x, wheel, args.gap, args.spacing)
        taken += samples
        where = f"position {i} (x {x}, angle {path.angle[i]})"
        y = path.y[i] if path.touched[i] else -np.inf
        if best - args.tolerance > y:
            # Only on the rim, where rounding decides what is in reach, may a sample be passed over.
            best = search(turned, x, shrunk(wheel), args.gap, args.spacing)[0]
            rim += 1
        if not best - args.tolerance <= y <= bound + args.tolerance:
            common.disagree(f"{where}: y is {path.y[i]}, but samples give {best} to {bound}")
        if not path.touched[i]:
            continue
        touched += 1
        if np.isfinite(best):
            widths.append(bound - best)
            worst = max(worst, y - best)
        px, py, pz = path.contact[i]
        off = distance(path.contact[i], near)
        at = np.array([[px, c * py - s * pz, s * py + c * pz]])
        low_f, high_f = height(nudged(at, x, 1.0), x, wheel)[0], height(nudged(at, x, -1.0), x, wheel)[0]
        if off > args.tolerance or not low_f - args.tolerance <= y <= high_f + args.tolerance:
            common.disagree(
                f"{where}: contact {path.contact[i]} is {off} off the mesh, and gives {low_f} to {high_f}, not {y}"
            )
    print(
        f"agrees: {len(chosen)} positions, {touched} in contact, {rim} grazing the rim, {taken} samples; "
        f"at most {worst:.2e} mm above the best sample, whose own bound is {np.median(widths):.1e} mm "
        f"(median) to {max(widths):.1e} mm"
    )


def nudged(points, x, way):
    """Points moved by a rounding error away from the middle of the wheel, or towards it."""
    centre = np.array([x, 0.0, 0.0])
    step = way * ROUNDING * np.sign(points - centre)
    step[:, 1] = 0.0
    return points + step


def shrunk(wheel):
    """The wheel a nanometre smaller."""
    small = common.Wheel(**vars(wheel))
    for name in ("minor", "radius", "width"):
        setattr(small, name, max(getattr(wheel, name) - 1e-6, 0.0))
    return small


if __name__ == "__main__":
    main()
