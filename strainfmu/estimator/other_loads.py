"""The loads of a map behind the five: the rolling moment, and the loads of sections along the body.

The loads of a section at station x_s are those of the air on the part of the body ahead of it, about the point
(x_s, 0, 0): what a cut there carries if the part ahead has no weight and is not accelerated. Rows are ordered as
:func:`other_load_names` has them: the rolling moment of the whole body, then the axial force of every section, the
normal force of every section and so on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray

FIVE_LOADS, OTHER_LOADS = slice(0, 5), slice(5, None)
"""Rows of the five loads, which every map has, and of those behind them."""

ROLLING = "rolling_moment"

SECTION_LOADS = {
    "axial": ("Axial force, positive aft", "N"),
    "normal": ("Normal shear force, positive up", "N"),
    "side": ("Side shear force, positive to starboard", "N"),
    "pitch": ("Bending moment, positive as nose-up pitching moment", "N.m"),
    "yaw": ("Bending moment, positive as nose-to-starboard yawing moment", "N.m"),
    "torsion": ("Torsion moment, positive as rolling moment with starboard going down", "N.m"),
}
"""Loads of one section: what they are, and their unit."""


def other_load_names(section_station: FloatArray) -> tuple[str, ...]:
    """Return the names of the loads behind the five: ``rolling_moment``, then ``section.axial[1]`` .."""
    sections = range(1, len(section_station) + 1)
    return (ROLLING, *(f"section.{name}[{i}]" for name in SECTION_LOADS for i in sections))


def is_moment(n_sections: int) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return (1 + 6 n_s,) whether each load behind the five is a moment."""
    of_section = [unit == "N.m" for _, unit in SECTION_LOADS.values()]
    return np.array([True, *np.repeat(of_section, n_sections)])


@dataclass(frozen=True, eq=False)
class SectionLoads:
    """Loads of n_s sections along the body, of the air on the part ahead of each of them.

    Attributes
    ----------
    station : (n_s,) x of the sections [m].
    loads : (.., n_s, 6) axial force, normal and side shear [N], pitch and yaw bending moment, torsion [N m].
    std : (.., n_s, 6) their standard deviations.
    """

    station: FloatArray
    loads: FloatArray
    std: FloatArray

    @property
    def axial(self) -> FloatArray:
        """(.., n_s) axial force [N], positive aft."""
        return self.loads[..., 0]

    @property
    def normal_shear(self) -> FloatArray:
        """(.., n_s) shear force along z [N], positive up."""
        return self.loads[..., 1]

    @property
    def side_shear(self) -> FloatArray:
        """(.., n_s) shear force along y [N], positive to starboard."""
        return self.loads[..., 2]

    @property
    def pitch_bending(self) -> FloatArray:
        """(.., n_s) bending moment about y [N m], positive nose-up."""
        return self.loads[..., 3]

    @property
    def yaw_bending(self) -> FloatArray:
        """(.., n_s) bending moment about z [N m], positive nose to starboard."""
        return self.loads[..., 4]

    @property
    def torsion(self) -> FloatArray:
        """(.., n_s) torsion moment about x [N m], positive with starboard going down."""
        return self.loads[..., 5]
