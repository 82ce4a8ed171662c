"""Load cases as Nastran input: GRID and FORCE cards in large fields, and the SUBCASEs that take them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from strainfmu.arrays import FloatArray, IntArray

FIELD = 16


def grid_cards(point: FloatArray) -> str:
    """Return the GRID cards of points (n, 3) [m], numbered from 1, in the basic coordinate system."""
    lines = ["$ nodes of the surface that carries the pressure, body axes: x aft, y starboard, z up [m]"]
    for number, (x, y, z) in enumerate(point.tolist(), start=1):
        lines += [f"GRID*   {number:16d}{0:16d}{_real(x)}{_real(y)}*", f"*       {_real(z)}"]
    return "\n".join(lines) + "\n"


def force_cards(set_number: int, title: str, force: FloatArray) -> str:
    """Return the FORCE cards of forces (n, 3) [N] at nodes 1 to n, one load set; none at nodes without force."""
    lines = [f"$ {title}"]
    loaded: IntArray = np.flatnonzero(np.any(force != 0.0, axis=1))
    for node in loaded.tolist():
        x, y, z = force[node].tolist()
        lines += [
            f"FORCE*  {set_number:16d}{node + 1:16d}{0:16d}{_real(1.0)}*",
            f"*       {_real(x)}{_real(y)}{_real(z)}",
        ]
    return "\n".join(lines) + "\n"


def case_control(names: Sequence[str]) -> str:
    """Return the case control of n load cases: subcase k takes load set k; strains are asked for at fibres."""
    lines = ["$ case control; the load sets stand in the files of the same names", "STRAIN(PLOT,FIBER) = ALL"]
    for number, name in enumerate(names, start=1):
        lines += [f"SUBCASE {number}", f"  LABEL = {name}", f"  LOAD = {number}"]
    return "\n".join(lines) + "\n"


def _real(value: float) -> str:
    """Return a number in a field of 16 columns, ten digits."""
    return f"{value:{FIELD}.9E}"
