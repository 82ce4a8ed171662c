"""STEP and STL files of a vehicle's wall, drawn by Gmsh as a user's CAD system would."""

from pathlib import Path
from typing import Any

import numpy as np

from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.solid.gmsh_mesh import ORIGIN, X_AXIS, gmsh_model
from builder.structure.wall import Wall
from builder.vehicle.shape.geometry import BodyOfRevolution

MILLIMETRES = 1e3


def write_step(body: BodyOfRevolution, wall: Wall, path: Path) -> None:
    """Write the wall in millimetres, turned once round the axis."""
    with gmsh_model("step") as session:
        _revolve(session, _meridian(session, body, wall), 2.0 * np.pi)
        session.option.setString("Geometry.OCCTargetUnit", "MM")
        session.write(str(path))


def write_stl(body: BodyOfRevolution, wall: Wall, path: Path, chord: float) -> None:
    """Write the wall's surface in millimetres as triangles of ``chord`` [mm], smaller towards the tip."""
    with gmsh_model("stl") as session:
        occ = session.model.occ
        face = _meridian(session, body, wall)
        for quarter in range(4):
            turned = occ.copy([(2, face)])
            occ.rotate(turned, *ORIGIN, *X_AXIS, 0.5 * np.pi * quarter)
            _revolve(session, turned[0][1], 0.5 * np.pi)
        occ.remove([(2, face)], recursive=True)
        occ.removeAllDuplicates()
        occ.synchronize()
        size = session.model.mesh.field.add("MathEval")
        session.model.mesh.field.setString(size, "F", f"Min({chord}, 0.6 + 0.3 * Sqrt(y * y + z * z))")
        session.model.mesh.field.setAsBackgroundMesh(size)
        session.model.mesh.generate(2)
        outside = session.model.getBoundary(session.model.getEntities(3), combined=True, oriented=False)
        session.model.addPhysicalGroup(2, [tag for _, tag in outside])
        session.write(str(path))


def _meridian(session: Any, body: BodyOfRevolution, wall: Wall) -> int:
    """Draw the meridian section of a body without a break of slope and return its number."""
    line, occ = shell_mesh(body, wall, body.length / 40.0), session.model.occ
    outer, inner = (
        [occ.addPoint(*(MILLIMETRES * line.node[i]).tolist(), 0.0) for i in np.append(edge[:, 0], edge[-1, 2])]
        for edge in (line.outer_edge, line.inner_edge)
    )
    front = MILLIMETRES * float(line.node[line.inner_edge[0, 0], 0])
    on_axis = occ.addPoint(front, 0.0, 0.0)
    curves = [
        occ.addSpline(outer),
        occ.addLine(outer[-1], inner[-1]),
        occ.addSpline(inner[::-1]),
        occ.addLine(inner[0], on_axis),
        occ.addLine(on_axis, outer[0]),
    ]
    return int(occ.addPlaneSurface([occ.addCurveLoop(curves)]))


def _revolve(session: Any, face: int, angle: float) -> None:
    session.model.occ.revolve([(2, face)], *ORIGIN, *X_AXIS, angle)
    session.model.occ.remove([(2, face)], recursive=True)
    session.model.occ.synchronize()
