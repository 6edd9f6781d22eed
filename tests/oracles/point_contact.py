#!/usr/bin/env python3
"""Point contact by brute force: every position against every point of the grids.

The surfaces are read and evaluated by OpenCASCADE, the heights computed by numpy:
F = y' + sqrt(m(d)^2 - z'^2), the greatest over all points in reach. Heights and contacts must agree
to --tolerance. Where the winner is on the very rim of the wheel, F is as steep as a square root, so
that rounding of the coordinates shows; such a position must lie between the heights found with the
coordinates moved by 1e-11 mm inwards and outwards. How many these are is printed.
"""

import numpy as np

import common

ROUNDING = 1e-11


def surfaces(file):
    """Every face's surface, in file order."""
    from OCP.BRep import BRep_Tool
    from OCP.IFSelect import IFSelect_ReturnStatus
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    face_of = getattr(TopoDS, "Face_s", None) or TopoDS.Face
    reader = STEPControl_Reader()
    if reader.ReadFile(file) != IFSelect_ReturnStatus.IFSelect_RetDone:
        common.disagree(f"{file}: OpenCASCADE cannot read it")
    reader.TransferRoots()
    faces = TopExp_Explorer(reader.OneShape(), TopAbs_FACE)
    found = []
    while faces.More():
        found.append(BRep_Tool.Surface_s(face_of(faces.Current())))
        faces.Next()
    return found


def grid(surface, rows, columns):
    """rows x columns points, evenly spaced in the parameters, the rows along the spindle."""
    u0, u1, v0, v1 = surface.Bounds()

    def points(along_u, along_v):
        at = (surface.Value(u, v) for u in np.linspace(u0, u1, along_u) for v in np.linspace(v0, v1, along_v))
        return np.array([(p.X(), p.Y(), p.Z()) for p in at]).reshape(along_u, along_v, 3)

    coarse = points(64, 64)[:, :, 0]
    travel_u = np.abs(np.diff(coarse, axis=0)).sum()
    travel_v = np.abs(np.diff(coarse, axis=1)).sum()
    p = points(rows, columns) if travel_u >= travel_v else points(columns, rows)
    return p.reshape(-1, 3)


def heights(points, x, cos, sin, wheel, slack=0.0):
    """F of each point (columns) at each position (rows), -inf out of reach; upper bounds of it for
    a positive slack, lower bounds for a negative one."""
    d = np.maximum(np.abs(points[:, 0] - x[:, None]) - slack, 0.0)
    y = cos[:, None] * points[:, 1] - sin[:, None] * points[:, 2]
    z = np.maximum(np.abs(sin[:, None] * points[:, 1] + cos[:, None] * points[:, 2]) - slack, 0.0)
    m = wheel.profile(np.minimum(d, wheel.half_width))
    q = m * m - z * z
    reached = (d <= wheel.half_width) & (q >= 0.0)
    return np.where(reached, y + np.sqrt(np.maximum(q, 0.0)), -np.inf)


def main():
    parser = common.arguments(__doc__)
    parser.add_argument("step", help="STEP file")
    parser.add_argument("csv", help="path.csv under test")
    parser.add_argument("--rows", type=int, required=True, help="grid points along the spindle")
    parser.add_argument("--columns", type=int, required=True, help="grid points across it")
    parser.add_argument("--major", type=float, default=0.0, help="R of the torus, mm")
    parser.add_argument("--minor", type=float, required=True, help="r of the torus, mm")
    parser.add_argument("--tolerance", type=float, default=1e-9, help="mm")
    common.add_axis_arguments(parser)
    args = parser.parse_args()
    wheel = common.Wheel("torus", major=args.major, minor=args.minor)
    path = common.read_path(args.csv)
    cos, sin = path.turn()

    found = surfaces(args.step)
    if not found:
        common.disagree(f"{args.step}: no surface")
    points = np.concatenate([grid(s, args.rows, args.columns) for s in found])
    points = common.placed(points, args)
    points = points[np.argsort(points[:, 0], kind="stable")]
    print(f"{len(found)} surfaces, {len(points)} points, {len(path)} positions")

    best, winner = np.full(len(path), -np.inf), np.zeros(len(path), int)
    second = np.full(len(path), -np.inf)
    reach = wheel.half_width + 1e-6

    def window(x):
        return slice(*np.searchsorted(points[:, 0], [x.min() - reach, x.max() + reach]))

    for start in range(0, len(path), 64):
        run = slice(start, min(start + 64, len(path)))
        near = window(path.x[run])
        if near.start == near.stop:
            continue
        f = heights(points[near], path.x[run], cos[run], sin[run], wheel)
        rows = np.arange(len(f))
        winner[run] = near.start + f.argmax(axis=1)
        best[run] = f[rows, winner[run] - near.start]
        f[rows, winner[run] - near.start] = -np.inf
        second[run] = f.max(axis=1)

    has = np.isfinite(best)
    error = np.abs(np.where(has, best, 0.0) - np.where(path.touched, path.y, 0.0))
    agrees = (has == path.touched) & (error <= args.tolerance)
    for i in np.flatnonzero(~agrees):
        one = slice(i, i + 1)
        near = points[window(path.x[one])]
        pose = path.x[one], cos[one], sin[one], wheel
        low = heights(near, *pose, -ROUNDING).max(initial=-np.inf) - args.tolerance
        high = heights(near, *pose, ROUNDING).max(initial=-np.inf) + args.tolerance
        y = path.y[i] if path.touched[i] else -np.inf
        if not low <= y <= high:
            common.disagree(
                f"position {i} (x {path.x[i]}, angle {path.angle[i]}): "
                f"y is {path.y[i]}, the points give {best[i]} (between {low} and {high})"
            )

    # Where two points touch at once either may be named.
    clear = agrees & has & (second < best - 2 * args.tolerance)
    off = np.abs(points[winner] - path.contact).max(axis=1)
    wrong = np.flatnonzero(clear & ~(off <= args.tolerance))
    if wrong.size:
        i = wrong[0]
        common.disagree(f"position {i}: contact is {path.contact[i]}, the points give {points[winner[i]]}")
    print(
        f"agrees: {has.sum()} positions in contact, {(~has).sum()} without; "
        f"height within {error[agrees].max(initial=0.0):.2e} mm, "
        f"{clear.sum()} contacts within {off[clear].max(initial=0.0):.2e} mm, "
        f"{(~agrees).sum()} positions on the rim"
    )


if __name__ == "__main__":
    main()
