"""The wheel as its user meets it: beside the command, and beside brute force in NumPy.

Run with `python -m unittest discover python/tests`, the wheel installed; HORMA names the command.
"""

import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

import numpy as np

import horma

TORUS = {"kind": "torus", "major_radius": 40.0, "minor_radius": 8.0}
HELIX = {"step": 2.0, "points_per_revolution": 90}


def lobes(rows, columns):
    """Points of a body with three lobes and tapered ends: (rows, columns, 3)."""
    x = np.linspace(0.0, 60.0, rows)[:, None]
    angle = np.linspace(0.0, 2.0 * np.pi, columns)[None, :]
    radius = (12.0 + 3.0 * np.cos(3.0 * angle)) * (0.4 + np.sin(np.pi * x / 60.0))
    x = np.broadcast_to(x, radius.shape)
    points = np.stack([x, radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
    # The sine of a whole turn is not quite nothing; the command heals such a seam.
    points[:, -1] = points[:, 0]
    return points


def facets(points):
    """Two facets for each cell of a grid: (n, 3, 3)."""
    a, b = points[:-1, :-1], points[1:, :-1]
    c, d = points[1:, 1:], points[:-1, 1:]
    both = np.stack([np.stack([a, b, c], axis=-2), np.stack([a, c, d], axis=-2)])
    return both.reshape(-1, 3, 3)


def column(path, name):
    return path[:, horma.COLUMNS.index(name)]


def brute(points, path, major, minor):
    """The heights of eq. (4) over all points, position by position."""
    p = points.reshape(-1, 3)
    heights = np.full(len(path), np.nan)
    for i, (x, angle) in enumerate(zip(column(path, "x"), column(path, "angle"))):
        c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        y, z = p[:, 1] * c - p[:, 2] * s, p[:, 1] * s + p[:, 2] * c
        d = p[:, 0] - x
        with np.errstate(invalid="ignore"):
            height = y + np.sqrt((major + np.sqrt(minor**2 - d**2)) ** 2 - z**2)
        if not np.isnan(height).all():
            heights[i] = np.nanmax(height)
    return heights


class Digitize(unittest.TestCase):
    def test_points_equal_brute_force(self):
        grids = [lobes(60, 48), lobes(40, 32) + [50.0, 0.0, 0.0]]
        path = horma.digitize(
            points=grids, cutter=TORUS, motion=HELIX, digitizing={"contact": "point"}
        )
        every = path[::7]
        every_point = np.concatenate([g.reshape(-1, 3) for g in grids])
        np.testing.assert_allclose(
            column(every, "y"), brute(every_point, every, 40.0, 8.0), atol=1e-9
        )
        contact = path[:, 4:7][~np.isnan(column(path, "y"))]
        there = {tuple(p) for p in every_point}
        self.assertTrue(all(tuple(p) in there for p in contact), "contacts are points")

    def test_a_grid_is_its_facets(self):
        points = lobes(60, 48)
        grid = horma.digitize(points=points, cutter=TORUS, motion=HELIX)
        mesh = horma.digitize(triangles=facets(points), cutter=TORUS, motion=HELIX)
        self.assertEqual(grid.shape, mesh.shape)
        np.testing.assert_allclose(column(grid, "y"), column(mesh, "y"), atol=1e-9)

    def test_threads_change_nothing(self):
        points = lobes(30, 24)
        one = horma.digitize(points=points, cutter=TORUS, motion=HELIX, threads=1)
        many = horma.digitize(points=points, cutter=TORUS, motion=HELIX, threads=3)
        self.assertEqual(one.tobytes(), many.tobytes())

    def test_numbers_of_numpy_are_numbers(self):
        points = lobes(30, 24)
        plain = horma.digitize(points=points, cutter=TORUS, motion=HELIX)
        cutter = {**TORUS, "major_radius": np.float32(40.0)}
        motion = {"step": np.float64(2.0), "points_per_revolution": np.int64(90)}
        path = horma.digitize(points=points, cutter=cutter, motion=motion)
        self.assertEqual(plain.tobytes(), path.tobytes())

    def test_triangles_of_a_file_give_its_path_bit_for_bit(self):
        command = os.environ.get("HORMA") or shutil.which("horma")
        if command is None:
            self.skipTest("HORMA does not name the command, and there is none on the path")
        triangles = facets(lobes(60, 48)).astype(np.float32)
        with tempfile.TemporaryDirectory() as scratch:
            scratch = pathlib.Path(scratch)
            record = np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
            records = np.zeros(len(triangles), record)
            records["v"] = triangles
            head = b"\0" * 80 + np.uint32(len(records)).tobytes()
            (scratch / "part.stl").write_bytes(head + records.tobytes())
            (scratch / "job.toml").write_text(
                '[part]\nfiles = ["part.stl"]\n'
                '[cutter]\nkind = "torus"\nmajor_radius = 40.0\nminor_radius = 8.0\n'
                "[motion]\nstep = 2.0\npoints_per_revolution = 90\n"
            )
            out = scratch / "out"
            subprocess.run(
                [command, "run", scratch / "job.toml", "-o", out, "-q", "--no-verify"], check=True
            )
            expected = np.genfromtxt(out / "path.csv", delimiter=",", skip_header=1)
            header = (out / "path.csv").read_text().split("\n", 1)[0]
        self.assertEqual(tuple(header.split(",")), horma.COLUMNS)
        path = horma.digitize(triangles=triangles.astype(np.float64), cutter=TORUS, motion=HELIX)
        np.testing.assert_array_equal(path, expected)

    def test_what_is_wrong_is_said(self):
        points = lobes(10, 8)
        good = {"points": points, "cutter": TORUS, "motion": HELIX}
        crooked = points.copy()
        crooked[3, 4, 1] = np.nan
        cases = [
            (TypeError, "triangles or points", {**good, "points": None}),
            (TypeError, "triangles or points", {**good, "triangles": facets(points)}),
            (TypeError, "rows, columns, 3", {**good, "points": points[0]}),
            (ValueError, "rows, columns, 3", {**good, "points": points[:, :, :2]}),
            (ValueError, "columns", {**good, "points": points[:, :1]}),
            (ValueError, "finite", {**good, "points": crooked}),
            (ValueError, "n, 3, 3", {**good, "points": None, "triangles": points}),
            (ValueError, "raduis", {**good, "cutter": {"kind": "ball", "raduis": 8.0}}),
            (ValueError, "spoon", {**good, "cutter": {"kind": "spoon"}}),
            (ValueError, "step", {**good, "motion": {**HELIX, "step": -1.0}}),
        ]
        for kind, words, arguments in cases:
            with self.subTest(words), self.assertRaisesRegex(kind, words):
                horma.digitize(**arguments)

    def test_help_teaches(self):
        for word in ["triangles", "points", "cutter", "COLUMNS", "NaN"]:
            self.assertIn(word, horma.digitize.__doc__)


if __name__ == "__main__":
    unittest.main()
