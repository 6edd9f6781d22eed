#!/usr/bin/env python3
"""A program against its path, through LinuxCNC's own stand-alone interpreter (rs274).

The interpreter must reach the end; its feed moves, printed to 4 decimals, must be the positions of
path.csv, all of them and in order; positions without contact must be no lower than the nearest
contacts before and after; traverses must stay above every position, before and after. With --feed,
each G93 block's F must be that feed divided by the length that the contact travels over the part. With
--wrapped, A is an axis that counts to 360 and is told by its sign which way to turn: the interpreter counts
on, and it has to turn the other way than the path's angles grow (rotation = "-A", angles = "modulo").
"""

import math
import pathlib
import re
import shutil
import subprocess
import tempfile

import numpy as np

import common

INI = """[EMC]
VERSION = 1.1
MACHINE = oracle
[RS274NGC]
PARAMETER_FILE = oracle.var
[TRAJ]
COORDINATES = X Y A
LINEAR_UNITS = mm
ANGULAR_UNITS = degree
[EMCIO]
TOOL_TABLE = oracle.tbl
"""
WRAPPED = """[AXIS_A]
WRAPPED_ROTARY = 1
"""
MOVE = re.compile(r"(STRAIGHT_FEED|STRAIGHT_TRAVERSE)\(([^,]+), ([^,]+), [^,]+, ([^,]+),")
HALF = 0.5e-4 + 1e-9


def interpret(program, more=""):
    """The canonical commands, as lines; the interpreter writes beside itself, so in a scratch folder."""
    rs274 = shutil.which("rs274")
    if rs274 is None:
        raise SystemExit("rs274 is missing: apt-get install linuxcnc-uspace")
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        (scratch / "oracle.ini").write_text(INI + more)
        (scratch / "oracle.tbl").write_text("")
        (scratch / "oracle.var").write_text("")
        command = [rs274, "-g", "-i", "oracle.ini", "-t", "oracle.tbl", "-v", "oracle.var"]
        done = subprocess.run(
            [*command, pathlib.Path(program).resolve()], cwd=scratch, capture_output=True, text=True
        )
    lines = done.stdout.splitlines()
    if done.returncode != 0 or not any("PROGRAM_END()" in line for line in lines[-5:]):
        common.disagree(f"{program}: exit {done.returncode}: {done.stderr.strip() or lines[-1:]}")
    return lines


def bridge(y):
    """The higher of the nearest heights before and after."""

    def carried(values):
        last, out = math.nan, []
        for v in values:
            last = last if math.isnan(v) else v
            out.append(last)
        return np.array(out)

    return np.fmax(carried(y), carried(y[::-1])[::-1])


def check_feeds(program, path, at, feed):
    """Largest relative error of F, for the way between the positions that the program says."""
    text = pathlib.Path(program).read_text()
    blocks = text.partition("G93\n")[2].partition("G94\n")[0].splitlines()
    if len(blocks) != len(path) - 1:
        common.disagree(f"{len(blocks)} blocks under G93, but {len(path)} positions")
    found = np.array([float(re.search(r"F([0-9.]+)$", block).group(1)) for block in blocks])
    reach = np.hypot(path.contact[:, 1], path.contact[:, 2])
    both = path.touched[1:] & path.touched[:-1]
    length = np.sqrt(
        np.diff(at[:, 0]) ** 2
        + np.diff(at[:, 1]) ** 2
        + (np.radians(np.diff(at[:, 2])) * (reach[1:] + reach[:-1]) / 2.0) ** 2
    )
    both &= length > 1e-3
    error = np.abs(found[both] * length[both] / feed - 1.0)
    if (found <= 0.0).any() or (error > 2e-5).any():
        common.disagree(f"F is off by up to {error.max():.2e} of itself, or zero")
    return error.max(initial=0.0)


def main():
    parser = common.arguments(__doc__)
    parser.add_argument("program", help="path.ngc under test")
    parser.add_argument("csv", help="path.csv beside it")
    parser.add_argument("--feed", type=float, help="mm/min at the contact; checks F too")
    parser.add_argument("--wrapped", action="store_true", help="A counts to 360, and the other way")
    args = parser.parse_args()
    path = common.read_path(args.csv)

    lines = pathlib.Path(args.program).read_bytes().decode("ascii").splitlines()
    longest = max(map(len, lines))
    if longest >= 252:
        common.disagree(f"{args.program}: a line of {longest} characters")

    moves = [m.groups() for m in map(MOVE.search, interpret(args.program, WRAPPED if args.wrapped else "")) if m]
    kinds = np.array([kind == "STRAIGHT_FEED" for kind, *_ in moves])
    at = np.array([[float(v) for v in values] for _, *values in moves])
    feeds, traverses = at[kinds], at[~kinds]
    if len(feeds) != len(path):
        common.disagree(f"{len(feeds)} feed moves, but {len(path)} positions")
    if kinds[0] or kinds[-1] or kinds[kinds.argmax() : len(kinds) - kinds[::-1].argmax()].sum() != len(feeds):
        common.disagree("the feed moves are not one run between traverses")

    y = bridge(path.y)
    angle = -path.angle if args.wrapped else path.angle
    expected = np.stack([path.x, y, angle], axis=1)
    worst = np.abs(feeds - expected)
    if not (worst <= HALF).all():
        i = np.flatnonzero((~(worst <= HALF)).any(axis=1))[0]
        common.disagree(f"position {i}: the move is to {feeds[i]}, the path says {expected[i]}")
    if traverses[:, 1].min() < y.max() - HALF:
        common.disagree(f"a traverse at Y {traverses[:, 1].min()}, but the path reaches {y.max()}")
    figures = f"largest difference {worst.max():.2e}"
    if args.feed:
        figures += f", F within {check_feeds(args.program, path, feeds, args.feed):.1e} of itself"
    print(
        f"agrees: interpreted to the end, {len(feeds)} feed moves, {path.touched.sum()} in contact; {figures}"
    )


if __name__ == "__main__":
    main()
