"""What a run also writes, read back by libraries of others: the path as NumPy and Arrow have it, surfaces and the
scene as trimesh has them. Arguments: a run's directory."""

import csv
import json
import pathlib
import sys

import numpy
import pyarrow.parquet
import trimesh

run = pathlib.Path(sys.argv[1])
report = json.loads((run / "report.json").read_text())

with open(run / "path.csv") as file:
    names, *rows = csv.reader(file)
expected = numpy.array([[float(n) if n else numpy.nan for n in row] for row in rows])
missing = numpy.isnan(expected)
assert missing.any() and not missing.all(axis=0).any(), "the path is to be one with and without contact"

array = numpy.load(run / "path.npy")
assert list(array.dtype.names) == names, array.dtype
for k, name in enumerate(names):
    assert numpy.array_equal(array[name], expected[:, k], equal_nan=True), name

table = pyarrow.parquet.read_table(run / "path.parquet")
assert table.column_names == names, table.column_names
assert table.schema.metadata[b"units"] == b"mm, degrees"
for k, name in enumerate(names):
    column = table[name]
    assert column.null_count == missing[:, k].sum(), name
    there = column.drop_null().to_numpy()
    assert numpy.array_equal(there, expected[~missing[:, k], k]), name
    assert table.schema.field(name).nullable == (k >= 3), name

deepest = report["machined"]["deepest_gouge"]
surfaces = {}
for name in ("designed", "machined"):
    ply = trimesh.load(run / f"{name}.ply", process=False)
    stl = trimesh.load(run / f"{name}.stl", process=False)
    assert len(ply.faces) == len(stl.faces) > 10_000, (len(ply.faces), len(stl.faces))
    assert numpy.allclose(ply.triangles, stl.triangles, atol=1e-4)
    assert ply.is_winding_consistent
    # Outward: a body of revolution's worth of volume, were its ends closed.
    assert ply.volume > 0
    deviation = ply.metadata["_ply_raw"]["vertex"]["data"]["deviation"]
    known = ~numpy.isnan(deviation)
    assert known.any()
    low = deviation[known].min()
    assert abs(low - (deepest["deviation"] if deepest else low)) < 1e-6
    colours = ply.visual.vertex_colors[:, :3].astype(int)
    red = (colours[:, 0] > colours[:, 1] + 70) & (colours[:, 0] > colours[:, 2] + 70)
    assert not (red & ~(known & (deviation < 0))).any(), "only gouges are red"
    surfaces[name] = ply
high = report["machined"]["largest_excess"]
off = numpy.linalg.norm(surfaces["machined"].vertices - high["point"], axis=1).min()
assert off < 1e-3, off

scene = trimesh.load(run / "scene.glb", force="scene")
bodies = {}
for node in scene.graph.nodes_geometry:
    place, geometry = scene.graph[node]
    assert numpy.allclose(numpy.diag(place), [0.001, 0.001, 0.001, 1]), place
    bodies.setdefault(node.split("_")[0].rstrip("0123456789"), []).append(scene.geometry[geometry])
assert set(bodies) == {"part", "machined", "contacts", "tool centres"}, set(bodies)
[shown] = bodies["machined"]
assert len(shown.faces) == len(surfaces["machined"].faces)
assert numpy.allclose(shown.bounds, surfaces["machined"].bounds, atol=1e-3)
assert len(bodies["part"]) == len(report["bodies"])
touched = expected[~missing.any(axis=1)]
for name, points in {
    "contacts": touched[:, 4:],
    "tool centres": numpy.column_stack(
        [
            touched[:, 1],
            touched[:, 3] * numpy.cos(numpy.radians(touched[:, 2])),
            -touched[:, 3] * numpy.sin(numpy.radians(touched[:, 2])),
        ]
    ),
}.items():
    [line] = bodies[name]
    assert numpy.allclose(line.bounds, [points.min(axis=0), points.max(axis=0)], atol=1e-3), name
print(f"outputs: {len(rows)} positions, {len(shown.faces)} triangles as machined, read back by numpy, pyarrow, trimesh")
