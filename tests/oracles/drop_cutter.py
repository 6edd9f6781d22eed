#!/usr/bin/env python3
"""Facet contact of a ball against OpenCAMLib's drop cutter.

For each position the mesh is turned to its angle, a ball cutter is dropped along the attack axis,
and its centre compared with y. OpenCAMLib's tool axis is its z, so (x, y', z') goes in as
(x, z', y'): a mirror image, which a ball does not notice. It gives the tip; the centre is r above.
"""

import numpy as np

import common


def drop(triangles, x, radius, floor):
    """Height of the ball's centre at travel x, or None if it falls through to the floor."""
    import opencamlib as ocl

    surface = ocl.STLSurf()
    for triangle in triangles:
        surface.addTriangle(ocl.Triangle(*(ocl.Point(*map(float, v)) for v in triangle)))
    batch = ocl.BatchDropCutter()
    batch.setSTL(surface)
    batch.setThreads(1)
    # Long enough that the end of the tool is never in the part.
    batch.setCutter(ocl.BallCutter(2.0 * radius, 10.0 * radius - 10.0 * floor))
    batch.appendPoint(ocl.CLPoint(float(x), 0.0, float(floor)))
    batch.run()
    tip = batch.getCLPoints()[0].z
    return tip + radius if tip > floor else None


def main():
    parser = common.arguments(__doc__)
    parser.add_argument("mesh", help="STL file")
    parser.add_argument("csv", help="path.csv under test, of a ball and facet contact")
    parser.add_argument("--radius", type=float, required=True, help="of the ball, mm")
    parser.add_argument("--positions", type=int, default=1000, help="how many to test, spread over the path")
    parser.add_argument("--tolerance", type=float, default=1e-6, help="mm")
    common.add_axis_arguments(parser)
    args = parser.parse_args()
    path = common.read_path(args.csv)
    cos, sin = path.turn()
    part = common.placed(common.read_stl(args.mesh), args)
    low, high = part[:, :, 0].min(axis=1), part[:, :, 0].max(axis=1)
    floor = -np.abs(part).max() * 2.0 - 10.0 * args.radius

    chosen = common.spread(path, args.positions)
    errors, grazes = [], 0
    for i in chosen:
        x, c, s = path.x[i], cos[i], sin[i]
        near = part[(high >= x - args.radius) & (low <= x + args.radius)]
        y, z = near[..., 1], near[..., 2]
        turned = np.stack([near[..., 0], s * y + c * z, c * y - s * z], axis=-1)
        # Nothing beside the ball can be touched.
        turned = turned[np.abs(turned[..., 1]).min(axis=1) <= args.radius + crossing(turned)]
        centre = drop(turned, x, args.radius, floor)
        where = f"position {i} (x {x}, angle {path.angle[i]})"
        if (centre is not None) != path.touched[i]:
            # At the very end of the part, whether the rim touches is rounding.
            if abs(x - low.min()) >= args.radius - 1e-6 or abs(x - high.max()) >= args.radius - 1e-6:
                grazes += 1
                continue
            common.disagree(f"{where}: y is {path.y[i]}, the drop cutter gives {centre}")
        if centre is not None:
            errors.append(abs(centre - path.y[i]))
            if errors[-1] > args.tolerance:
                common.disagree(f"{where}: y is {path.y[i]}, the drop cutter gives {centre}")
    angles = len(np.unique(np.round(np.fmod(path.angle[chosen], 360.0), 9)))
    print(
        f"agrees: {len(chosen)} positions at {angles} angles, {len(errors)} in contact, "
        f"{grazes} grazing; centre within {max(errors, default=0.0):.2e} mm, "
        f"mean {np.mean(errors or [0.0]):.2e} mm"
    )


def crossing(triangles):
    """Extent of each triangle across the attack axis: it may reach over the ball."""
    return np.ptp(triangles[..., 1], axis=1)


if __name__ == "__main__":
    main()
