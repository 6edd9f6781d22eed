#!/usr/bin/env python3
"""Heights over a sphere, a cylinder or a torus against their closed forms.

Touching a ball of radius s with a wheel is touching its centre with the wheel grown by s, whose
profile is
  M(e) = max over |t| <= half width of m(t) + sqrt(s^2 - (e - t)^2),
greatest at t = e + s sin(atan dm/dt): for a torus wheel R + sqrt((r + s)^2 - e^2).
  sphere    centre (cx, cy, cz), radius s: y = c'y + sqrt(M(cx - x)^2 - c'z^2)
  cylinder  along X from x0 to x1 about (cy, cz), radius s:
            y = c'y + sqrt((s + max m(d))^2 - c'z^2) over the d that the cylinder reaches
  torus     about the spindle axis, tube of radius s with its centre at P from the axis and at cx:
            y = P + M(cx - x)
Facets are chords of these convex shapes (the torus: of its outer half), so with chordal tolerance t
the height lies between those for s - t and s; --deviation is how far the surface itself is from the
shape, either way. Near the cutter's rim the two bounds part; there one may reach and the other not.
"""

import numpy as np

import common


def grown(wheel, e, s):
    """M(e) of the wheel grown by s; NaN out of reach."""
    if s < 0.0:
        return np.full_like(e, np.nan)
    w = wheel.half_width
    if wheel.kind == "torus":
        t = e * w / (w + s)
    else:
        t = e + s * np.sin(np.arctan(wheel.slope))
    t = np.clip(t, -w, w)
    rest = s * s - (e - t) ** 2
    with np.errstate(invalid="ignore"):
        return wheel.profile(t) + np.where(rest >= 0.0, np.sqrt(np.maximum(rest, 0.0)), np.nan)


def heights(shape, args, wheel, path, s):
    """y at each position for radius s; NaN out of reach."""
    cos, sin = path.turn()
    cy, cz = args.centre[1:]
    y, z = cos * cy - sin * cz, sin * cy + cos * cz
    if shape == "torus":
        return args.major_of_part + grown(wheel, args.centre[0] - path.x, s)
    if shape == "sphere":
        m = grown(wheel, args.centre[0] - path.x, s)
    else:
        w = wheel.half_width
        low, high = args.ends[0] - path.x, args.ends[1] - path.x
        reached = (low <= w) & (high >= -w)
        m = np.where(reached, s + wheel.highest(np.clip(low, -w, w), np.clip(high, -w, w)), np.nan)
    with np.errstate(invalid="ignore"):
        return y + np.sqrt(m * m - z * z)


def main():
    parser = common.arguments(__doc__)
    parser.add_argument("csv", help="path.csv under test")
    parser.add_argument("--shape", choices=["sphere", "cylinder", "torus"], required=True)
    parser.add_argument("--size", type=float, required=True, help="s: radius of sphere, cylinder or tube, mm")
    parser.add_argument("--centre", type=float, nargs=3, default=[0.0] * 3, help="in the part frame, mm")
    parser.add_argument("--ends", type=float, nargs=2, help="cylinder: x of its ends, mm")
    parser.add_argument("--major-of-part", type=float, default=0.0, help="torus: P, mm")
    parser.add_argument("--tolerance", type=float, default=0.01, help="chordal tolerance, mm")
    parser.add_argument("--deviation", type=float, default=0.0, help="of the surface from the shape, mm")
    common.add_wheel_arguments(parser)
    args = parser.parse_args()
    if args.shape == "cylinder" and args.ends is None:
        parser.error("a cylinder needs --ends")
    wheel = common.wheel(args)
    path = common.read_path(args.csv)

    slack = args.deviation + 1e-9
    exact = heights(args.shape, args, wheel, path, args.size)
    low = heights(args.shape, args, wheel, path, args.size - args.tolerance - slack)
    high = heights(args.shape, args, wheel, path, args.size + slack)
    # Where only the larger shape is in reach there may be a contact or none.
    lowest = np.where(np.isnan(low), -np.inf, low - 1e-9)
    highest = np.where(np.isnan(high), -np.inf, high + 1e-9)
    y = np.where(path.touched, path.y, -np.inf)
    wrong = np.flatnonzero(~((lowest <= y) & (y <= highest)))
    if wrong.size:
        i = wrong[0]
        common.disagree(
            f"{wrong.size} positions; position {i} (x {path.x[i]}, angle {path.angle[i]}): y is {path.y[i]}, "
            f"the {args.shape} gives {exact[i]} (between {lowest[i]} and {highest[i]})"
        )
    both = path.touched & np.isfinite(exact) & np.isfinite(low)
    if not both.any():
        common.disagree("no position is in contact")
    below, above = (exact - path.y)[both].max(), (path.y - exact)[both].max()
    print(
        f"agrees: {len(path)} positions, {both.sum()} in contact; "
        f"at most {max(below, 0.0):.2e} mm below and {max(above, 0.0):.2e} mm above the {args.shape}"
    )


if __name__ == "__main__":
    main()
