#!/usr/bin/env python3
"""Does a STEP file of ours open in OpenCASCADE?

Prints what each face is and the part's bounding box. Fails with a message unless the file reads
without a complaint into the expected number of valid faces, each a whole B-spline surface.
OpenCASCADE makes a smooth closed surface periodic, which saves it one row of poles.
"""

import argparse
import sys

from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Tool
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepTools import BRepTools
from OCP.GeomAbs import GeomAbs_BSplineSurface
from OCP.GeomAdaptor import GeomAdaptor_Surface
from OCP.IFSelect import IFSelect_RetDone
from OCP.Message import Message_ProgressRange
from OCP.STEPControl import STEPControl_Reader
from OCP.TopAbs import TopAbs_FACE
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS

# How far the trim of a face may be from the boundary of its surface, in parameters.
PARAMETER_TOLERANCE = 1e-6


def read(path):
    reader = STEPControl_Reader()
    if reader.ReadFile(path) != IFSelect_RetDone:
        sys.exit(f"{path}: OpenCASCADE cannot read it")
    if reader.Model().GlobalCheck(True).NbFails():
        sys.exit(f"{path}: OpenCASCADE finds errors in its syntax")
    reader.TransferRoots(Message_ProgressRange())
    transfer, model = reader.WS().TransferReader(), reader.Model()
    complaints = [n for n in range(1, model.NbEntities() + 1)
                  if transfer.HasChecks(model.Value(n), False)]
    if complaints:
        sys.exit(f"{path}: OpenCASCADE complains about {len(complaints)} entities, "
                 f"the first is #{complaints[0]}")
    return reader.OneShape()


def faces(shape):
    explorer = TopExp_Explorer(shape, TopAbs_FACE)
    while explorer.More():
        yield TopoDS.Face(explorer.Current())
        explorer.Next()


def describe(path, number, face):
    """What the face is; ends the check if it is not the whole of a B-spline surface."""
    adaptor = GeomAdaptor_Surface(BRep_Tool.Surface_s(face))
    if adaptor.GetType() != GeomAbs_BSplineSurface:
        sys.exit(f"{path}: face {number} is no B-spline surface")
    surface = adaptor.BSpline()
    trim, whole = BRepTools.UVBounds_s(face), surface.Bounds()
    if max(abs(a - b) for a, b in zip(trim, whole)) > PARAMETER_TOLERANCE:
        sys.exit(f"{path}: face {number} is trimmed to {trim} of {whole}")
    closed = [d for d, yes in (("u", surface.IsUClosed()), ("v", surface.IsVClosed())) if yes]
    return (f"degree {surface.UDegree()} x {surface.VDegree()}, "
            f"{surface.NbUPoles()} x {surface.NbVPoles()} poles, "
            f"closed in {' and '.join(closed) or 'nothing'}")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", help="STEP file")
    parser.add_argument("faces", type=int, help="how many faces it must have")
    args = parser.parse_args()
    shape = read(args.file)
    found = list(faces(shape))
    for number, face in enumerate(found, 1):
        print(f"face {number}: {describe(args.file, number, face)}")
    if len(found) != args.faces:
        sys.exit(f"{args.file}: {len(found)} faces, but {args.faces} are expected")
    if not BRepCheck_Analyzer(shape).IsValid():
        sys.exit(f"{args.file}: the shape is not valid")
    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(shape, box, False, False)
    low, high = box.CornerMin(), box.CornerMax()
    extents = (f"{axis} {getattr(low, axis.upper())():.3f} to {getattr(high, axis.upper())():.3f}"
               for axis in "xyz")
    print(f"box, mm: {', '.join(extents)}")
    print(f"{args.file}: {len(found)} valid faces")


main()
