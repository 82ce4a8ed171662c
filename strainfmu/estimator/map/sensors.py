"""Sensors of a map that are no strain gauges: their units, and the scale that makes their rows look like strain.

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

UNITS = {"thrust_response": "unit/N", "scale": "unit/(m/m)", "largest": "unit"}


@dataclass(frozen=True, kw_only=True, eq=False)
class SensorRows:
    """What the n_d rows of a map measure.

    Attributes
    ----------
    kind : n_d names of :data:`KINDS`.
    unit : n_d units of the readings.
    scale : (n_d,) reading per row [unit/(m/m)]; 1 for strain.
    largest : (n_d,) largest |reading| of a working sensor [unit]; of strain the estimator's setting counts.
    thrust_response : (n_d,) reading per thrust [unit/N], forward along the axis.
    """

    kind: tuple[str, ...]
    unit: tuple[str, ...]
    scale: FloatArray
    largest: FloatArray
    thrust_response: FloatArray

    def __post_init__(self) -> None:
        n = len(self.kind)
        unknown = sorted(set(self.kind) - set(KINDS))
        if unknown:
            raise InputError(f"sensors: kind '{unknown[0]}', must be one of {', '.join(KINDS)}")
        for name in ("scale", "largest", "thrust_response"):
            value = getattr(self, name)
            if value.shape != (n,) or not np.all(np.isfinite(value)):
                raise InputError(f"sensors: {name} has shape {value.shape}, must be ({n},) finite numbers")
        if len(self.unit) != n or not (np.all(self.scale > 0.0) and np.all(self.largest > 0.0)):
            raise InputError(f"sensors: {len(self.unit)} units, must be {n}, with positive scale and largest")
        if n and (STRAIN not in self.kind or not np.all(self.is_strain[: self.n_strain_gauges])):
            raise InputError("sensors: expected strain gauges, then the other sensors, got another order")

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
