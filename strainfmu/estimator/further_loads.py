"""Linear outputs of a map beside the five loads: the rolling moment, and the loads of sections along the body.

The loads of a section at station x_s are those of the air on the part of the body ahead of it, about the point
(x_s, 0, 0): what a cut there carries if the part ahead has no weight and is not accelerated. Rows are ordered as
:func:`further_names` has them: the rolling moment of the whole body, then the axial force of every section, the
normal force of every section and so on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

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

UNITS = {
    "section_station": "m",
    "load_per_state": "N/state, N.m/state",
    "load_of_mean": "N, N.m",
    "error_load": "N, N.m",
    "fixed_load": "N, N.m",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class FurtherLoads:
    """What an inverse map holds of its m = 1 + 6 n_s further loads, named as in :class:`InverseMap`.

    Attributes
    ----------
    section_station : (n_s,) x of the sections [m], rising.
    load_per_state : (m, n_q) [N/state, N m/state].
    load_of_mean : (m,) loads of the mean pressure [N, N m].
    error_load : (m, k) loads of the columns of ``error_strain`` [N, N m]; zero, as the loads per state, of a load
        that is known, as the rolling moment of a body of revolution.
    fixed_load : (m,) loads that do not follow q_inf, or None.
    """

    section_station: FloatArray
    load_per_state: FloatArray
    load_of_mean: FloatArray
    error_load: FloatArray
    fixed_load: FloatArray | None = None

    def __post_init__(self) -> None:
        if not (self.section_station.ndim == 1 and np.all(np.diff(self.section_station) > 0.0)):
            raise InputError("further loads: section_station must hold rising numbers")
        if self.load_per_state.shape[:1] != (1 + len(SECTION_LOADS) * len(self.section_station),):
            raise InputError(
                f"further loads: {self.load_per_state.shape[:1]} rows for {len(self.section_station)} sections, "
                f"must be {1 + len(SECTION_LOADS) * len(self.section_station)}"
            )

    def check(self, n_states: int, n_errors: int) -> None:
        """Check shapes against those of the map, and that every number is finite.

        Raises
        ------
        InputError
            A shape is wrong or a value is not finite.
        """
        m = len(self.load_per_state)
        expected: dict[str, tuple[int, ...]] = {
            "load_per_state": (m, n_states),
            "load_of_mean": (m,),
            "error_load": (m, n_errors),
            "fixed_load": (m,),
        }
        for name, shape in expected.items():
            value = getattr(self, name)
            if value is None:
                continue
            if value.shape != shape or not np.all(np.isfinite(value)):
                raise InputError(f"further loads: {name} has shape {value.shape}, must be {shape} finite numbers")


def further_names(section_station: FloatArray) -> tuple[str, ...]:
    """Return the name of each further load: ``rolling_moment``, then ``section.axial[1]`` .."""
    sections = range(1, len(section_station) + 1)
    return (ROLLING, *(f"section.{name}[{i}]" for name in SECTION_LOADS for i in sections))


def is_moment(n_sections: int) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return (m,) whether each further load is a moment."""
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
