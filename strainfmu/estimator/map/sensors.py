"""Sensors of a map that are no strain gauges, and lines about which it gives hinge moments.

A map's rows all have the unit m/m inside. The row of another sensor is divided by its scale, so that its own noise
equals the noise of a typical gauge: rows of Pa, m/s2 and m/m together would cost most of the digits of every
covariance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.signal_names import FORCE, MOMENT
from strainfmu.estimator.signal_names import STRAIN as STRAIN
from strainfmu.estimator.tables.schema import POSITIVE, check, described, entry

KINDS = (
    STRAIN,
    "pressure",
    "acceleration",
    "angular acceleration",
    FORCE,
    MOMENT,
    "displacement",
    "fibre strain",
)

_SHOWN_STRAIN = (1e6, "um/m")


@described
@dataclass(frozen=True, kw_only=True, eq=False)
class SensorRows:
    """What the n_d rows of a map measure."""

    # fmt: off
    kind: tuple[str, ...] = entry("n_d", "", "strain or another kind of sensor")
    unit: tuple[str, ...] = entry("n_d", "", "unit of the readings")
    scale: FloatArray = entry("n_d", "unit/(m/m)", "reading per row; 1 for strain", place="sensors.scale",
        stored="n_others", rule=POSITIVE)
    largest: FloatArray = entry("n_d", "unit",
        "largest |reading| of a working sensor; of strain the estimator's setting counts", place="sensors.largest",
        stored="n_others", rule=POSITIVE)
    thrust_response: FloatArray = entry("n_d", "unit/N", "reading per thrust, forward along the axis",
        place="sensors.thrust_response", stored="n_others")
    # fmt: on

    def __post_init__(self) -> None:
        n = len(self.kind)
        unknown = sorted(set(self.kind) - set(KINDS))
        if unknown:
            raise InputError(f"sensors: kind '{unknown[0]}', must be one of {', '.join(KINDS)}")
        check(self, "sensors")
        if not (np.all(self.scale > 0.0) and np.all(self.largest > 0.0)):
            raise InputError("sensors: scale and largest must be positive")
        if n and (STRAIN not in self.kind or not np.all(self.is_strain[: self.n_strain_gauges])):
            raise InputError("sensors: expected strain gauges, then the other sensors, got another order")

    @property
    def is_empty(self) -> bool:
        """Whether there are no rows."""
        return not self.kind

    @property
    def is_strain(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """(n_d,) which rows are strain gauges."""
        return np.array([kind == STRAIN for kind in self.kind], dtype=bool)

    @property
    def n_strain_gauges(self) -> int:
        """Number of strain gauges, whose rows come first."""
        return self.kind.count(STRAIN)

    @property
    def follows_thrust(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """(n_d,) which readings thrust moves."""
        return self.thrust_response != 0.0

    def without_thrust(self, readings: ArrayLike, thrust: ArrayLike) -> FloatArray:
        """Return ``readings`` (n_d,) or (k, n_d) less what ``thrust`` [N], a number or (k,), makes of them.

        Thrust that is NaN leaves NaN in the readings that it moves, and the others alone.
        """
        found, moved = np.array(readings, dtype=float), self.follows_thrust
        found[..., moved] -= np.asarray(thrust, dtype=float)[..., None] * self.thrust_response[moved]
        return found


def strain_rows(n: int) -> SensorRows:
    """Return the rows of a map of ``n`` strain gauges alone; of a map yet to come for 0."""
    return SensorRows(
        kind=(STRAIN,) * n,
        unit=("m/m",) * n,
        scale=np.ones(n),
        largest=np.ones(n),
        thrust_response=np.zeros(n),
    )


def shown_units(rows: SensorRows) -> list[tuple[float, str]]:
    """Return for each row of a map the factor from m/m to what users see, and its unit.

    Strain is shown in um/m, another sensor's reading in its own unit.
    """
    each = zip(rows.kind, rows.scale.tolist(), rows.unit, strict=True)
    return [_SHOWN_STRAIN if kind == STRAIN else (scale, unit) for kind, scale, unit in each]


def refuse_sensors(rows: SensorRows, what: str) -> None:
    """Refuse a map with sensors that are no strain gauges.

    Raises
    ------
    InputError
        It has some; the message says that ``what`` takes strain alone.
    """
    found = sorted(set(rows.kind) - {STRAIN})
    if found:
        raise InputError(f"{what}: expected a map of strain gauges alone, got one with {', '.join(found)} sensors")


@described
@dataclass(frozen=True, kw_only=True, eq=False)
class HingeLines:
    """Hinge lines, each of a region of the surface.

    Raises
    ------
    InputError
        Shapes or values are wrong.
    """

    # fmt: off
    name: tuple[str, ...] = entry("n_h", "", "unique names")
    region: tuple[str, ...] = entry("n_h", "", "names of the regions by the vehicle file")
    point: FloatArray = entry("n_h 3", "m", "a point of each line in body axes")
    direction: FloatArray = entry("n_h 3", "1",
        "its direction, a unit vector in body axes; moments are right-handed about it")
    # fmt: on

    def __post_init__(self) -> None:
        n = len(self.name)
        if not n or not all(self.name) or len(set(self.name)) != n:
            raise InputError("hinge_lines: expected names, none empty or twice")
        check(self, "hinge_lines")
        if not np.allclose(np.linalg.norm(self.direction, axis=1), 1.0, rtol=0.0, atol=1e-9):
            raise InputError("hinge_lines: direction must hold unit vectors")
