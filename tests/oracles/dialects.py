#!/usr/bin/env python3
"""A program against its path, through a public G-code parser (pygcode).

Every block has to be parsed whole, with no word left over; the moves under G1 between the plunge and the
retract, with G92 followed, have to be the positions of path.csv, all of them and in order, to the decimals
that are asked for; every one of them needs its own F. Blocks that only Siemens and Beckhoff know are left
out by name, for no public parser has them.
"""

import pathlib
import re

import numpy as np
from pygcode import Line, words

import common
from ngc_moves import bridge

# What the parser does not know, and what it means.
FOREIGN = re.compile(r"^(N\d+ )?(FGROUP|FGREF|#FGROUP|G641 )")


def blocks(text):
    """The words of each line, by letter."""
    for number, line in enumerate(text.splitlines(), 1):
        if line in ("%", "") or FOREIGN.match(line):
            continue
        # Program numbers are no words to it, and DIN's units not those of its dialect.
        line = re.sub(r"^O\d{4}", "", line)
        line = re.sub(r"\b(G7[01]0?|G700|D0)\b", "", line)
        line = re.sub(r"=AC[PN]\(([^)]*)\)", r"\1", line)
        parsed = Line(line)
        if line and "(" not in line and ";" not in line:
            known = "".join(str(w) for w in parsed.block.words)
            left = re.sub(r"[^A-Z]", "", line)
            if sorted(re.sub(r"[^A-Z]", "", known)) != sorted(left):
                common.disagree(f"line {number}: {line!r} was parsed as {known!r}")
        found = {}
        for word in parsed.block.words:
            found.setdefault(word.letter, []).append(word.value)
        if found:
            yield found


def moves(text, letters):
    """Position and F of each move; where the axes have to be named it is one that cuts."""
    x, y, a = letters
    mode, at, added = None, {}, 0.0
    for found in blocks(text):
        codes = [float(g) for g in found.get("G", [])]
        if 92.0 in codes:
            value = float(found[a][0])
            added += at[a] - value
            at[a] = value
            continue
        mode = next((g for g in codes if g in (0.0, 1.0)), mode)
        named = [c for c in letters if c in found]
        at.update({c: float(found[c][0]) for c in named})
        if named:
            feed = float(found["F"][0]) if "F" in found else None
            yield mode, named, [at.get(x), at.get(y), at.get(a, 0.0) + added], feed


def main():
    parser = common.arguments(__doc__)
    parser.add_argument("csv", help="path.csv under test")
    parser.add_argument("programs", nargs="+", help="the program's files, in order")
    parser.add_argument("--decimals", type=int, nargs=3, default=[4, 4, 4])
    parser.add_argument("--letters", default="XYA")
    parser.add_argument("--modulo", action="store_true", help="angles count to 360")
    args = parser.parse_args()
    path = common.read_path(args.csv)
    expected = np.stack([path.x, bridge(path.y), path.angle], axis=1)

    cuts, begin = [], 0
    for file in args.programs:
        found = list(moves(pathlib.Path(file).read_text("ascii"), args.letters))
        x, y, a = args.letters
        shape = [(mode, named) for mode, named, _, _ in found]
        if shape[:3] != [(0.0, [y]), (0.0, [x, a]), (1.0, [y])] or shape[-1] != (0.0, [y]):
            common.disagree(f"{file}: it begins {shape[:3]} and ends {shape[-1]}")
        part = found[2:-1]
        if any(mode != 1.0 or not feed for mode, _, _, feed in part):
            common.disagree(f"{file}: a move has no G1 or no F of its own")
        at = np.array([place for _, _, place, _ in part])
        # A file may begin at any turn, and its first position is the last one of the file before.
        at[:, 2] += 360.0 * np.round((path.angle[begin] - at[0, 2]) / 360.0)
        cuts.append(at if begin == 0 else at[1:])
        begin += len(part) - 1
    cuts = np.concatenate(cuts)
    if len(cuts) != len(path):
        common.disagree(f"{len(cuts)} positions in the program, {len(path)} in the path")
    off = np.abs(cuts - expected)
    if args.modulo:
        off[:, 2] = np.abs((off[:, 2] + 180.0) % 360.0 - 180.0)
    allowed = 0.5 * 10.0 ** -np.array(args.decimals) + 1e-8
    if not (off <= allowed).all():
        i = np.flatnonzero((off > allowed).any(axis=1))[0]
        common.disagree(f"position {i}: the move is to {cuts[i]}, the path says {expected[i]}")
    print(f"agrees: {len(cuts)} positions in {len(args.programs)} files; largest difference {off.max():.1e}")


if __name__ == "__main__":
    main()
