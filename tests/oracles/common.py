"""What the oracles share: the path under test, wheels, meshes, and how to disagree.

Nothing here comes from the product. Part frame, mm: X along the spindle, the cutter comes from +Y;
at angle t a part point is at y' = y cos t - z sin t, z' = y sin t + z cos t.
"""

import argparse
import dataclasses
import math
import pathlib
import sys

import numpy as np

HEADER = "index,x,angle,y,contact_x,contact_y,contact_z"


def disagree(message):
    """Ends the oracle: the path is wrong."""
    sys.exit(f"DISAGREES: {message}")


@dataclasses.dataclass
class Path:
    """A path.csv; y and contact are NaN where there is no contact."""

    x: np.ndarray
    angle: np.ndarray
    y: np.ndarray
    contact: np.ndarray

    def __len__(self):
        return len(self.x)

    @property
    def touched(self):
        return ~np.isnan(self.y)

    def turn(self):
        """cos and sin of each angle, whole revolutions dropped first."""
        t = np.radians(np.fmod(self.angle, 360.0))
        return np.cos(t), np.sin(t)


def read_path(file):
    lines = pathlib.Path(file).read_text().split("\n")
    if lines[0] != HEADER or lines[-1] != "":
        disagree(f"{file}: not a path with the header {HEADER}")
    fields = [line.split(",") for line in lines[1:-1]]
    for number, found in enumerate(fields):
        empty = [f == "" for f in found]
        shape_ok = len(found) == 7 and empty[3:] in ([True] * 4, [False] * 4)
        if not shape_ok or found[0] != str(number):
            disagree(f"{file}: line {number + 2} is {','.join(found)!r}")
    table = np.array([[float(f) if f else math.nan for f in line[1:]] for line in fields])
    if len(table) == 0:
        disagree(f"{file}: no positions")
    return Path(table[:, 0], table[:, 1], table[:, 2], table[:, 3:6])


def spread(path, count):
    """Indices of about `count` positions over the whole path and over all angles."""
    count = min(count, len(path))
    even = np.linspace(0, len(path) - 1, count).round().astype(int)
    # An even stride meets few angles again and again; a small shift, growing, meets them all.
    return np.unique(np.minimum(even + np.arange(count) % 7, len(path) - 1))


def read_stl(file):
    """Triangles of an STL file, n x 3 x 3; binary numbers are single, so exact as doubles."""
    data = pathlib.Path(file).read_bytes()
    count = int.from_bytes(data[80:84], "little")
    if len(data) == 84 + 50 * count:
        record = np.dtype([("normal", "<f4", 3), ("v", "<f4", (3, 3)), ("attribute", "<u2")])
        return np.frombuffer(data, record, count, 84)["v"].astype(float)
    words = [line.split() for line in data.decode("ascii").splitlines()]
    v = [[float(c) for c in w[1:]] for w in words if w[:1] == ["vertex"]]
    return np.array(v).reshape(-1, 3, 3)


def add_axis_arguments(parser):
    parser.add_argument("--axis-y", type=float, default=0.0, help="y of the spindle axis in the file, mm")
    parser.add_argument("--axis-z", type=float, default=0.0, help="z of the spindle axis in the file, mm")


def placed(points, args):
    return points - np.array([0.0, args.axis_y, args.axis_z])


@dataclasses.dataclass
class Wheel:
    """A wheel by its profile, the radius m(d) at axial distance d from its centre."""

    kind: str
    major: float = 0.0
    minor: float = 0.0
    radius: float = 0.0
    width: float = 0.0
    half_angle: float = 0.0

    @property
    def half_width(self):
        return self.minor if self.kind == "torus" else self.width / 2.0

    @property
    def slope(self):
        return math.tan(math.radians(self.half_angle)) if self.kind == "cone" else 0.0

    def profile(self, d):
        """m(d) for |d| within the half width; the caller sees to that."""
        if self.kind == "torus":
            return self.major + np.sqrt(np.maximum(self.minor**2 - d**2, 0.0))
        return self.radius + self.slope * d

    def highest(self, low, high):
        """The largest m over low <= d <= high, both within the half width."""
        top = 0.0 if self.kind == "torus" else math.copysign(math.inf, self.slope)
        return self.profile(np.clip(top, low, high))


def add_wheel_arguments(parser):
    parser.add_argument("--cutter", choices=["torus", "cylinder", "cone"], default="torus")
    parser.add_argument("--major", type=float, default=0.0, help="torus: R, mm; 0 is a ball")
    parser.add_argument("--minor", type=float, default=0.0, help="torus: r, mm")
    parser.add_argument("--radius", type=float, default=0.0, help="cylinder, cone: radius, mm")
    parser.add_argument("--width", type=float, default=0.0, help="cylinder, cone: width, mm")
    parser.add_argument("--half-angle", type=float, default=0.0, help="cone: degrees")


def wheel(args):
    return Wheel(args.cutter, args.major, args.minor, args.radius, args.width, args.half_angle)


def arguments(doc):
    """A parser whose help is the oracle's own text."""
    return argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
