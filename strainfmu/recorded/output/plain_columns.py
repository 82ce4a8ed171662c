"""The plain form of a table of estimates: loads, angles in degrees, and health in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.estimator.other_loads import is_column
from strainfmu.interface.health_names import STATE as STATE

FORMS = ("plain", "all")
HEALTH_COLUMN = "health"
"""Column of text: the name of the state; empty for a sample that an FMU refused."""

_AIR_DATA = "air_data."
_ANGLES = ("air_data.angle_of_attack", "air_data.sideslip_angle")
_SIGMA = "sigma."
_RESIDUALS = ("residual.", "health.residual_limit")


@dataclass(frozen=True, eq=False)
class PlainColumns:
    """The columns of the plain form, taken from all columns.

    Attributes
    ----------
    columns : name and unit of each of n_p columns.
    index : (n_p,) column of all that it is taken from.
    factor : (n_p,) from the unit there to its own [1].
    state : column of the state of health.
    """

    columns: tuple[tuple[str, str], ...]
    index: IntArray
    factor: FloatArray
    state: int

    def rows(self, rows: FloatArray) -> FloatArray:
        """Return rows (n, n_p) of rows (n, n_c) of all columns."""
        return rows[:, self.index] * self.factor

    def health(self, rows: FloatArray) -> list[str]:
        """Return the name of the state of each of n rows (n, n_c) of all columns."""
        return ["" if np.isnan(state) else HealthState(int(state)).name for state in rows[:, self.state]]


def plain_columns(columns: Sequence[tuple[str, str]]) -> PlainColumns:
    """Return the plain form of ``columns``, name and unit of all: time, loads, angles and residuals.

    Names stay, but for angles of the air data, which lose their prefix and are in degrees.
    """
    kept = [(i, *_plain(name, unit)) for i, (name, unit) in enumerate(columns) if _is_kept(name)]
    return PlainColumns(
        columns=tuple((name, unit) for _, name, unit, _ in kept),
        index=np.array([i for i, *_ in kept]),
        factor=np.array([factor for *_, factor in kept]),
        state=[name for name, _ in columns].index(STATE),
    )


def _is_kept(name: str) -> bool:
    plain = name.removeprefix(_SIGMA)
    of_loads = plain in COEFFICIENT_NAMES or is_column(name)
    return name == "time" or of_loads or plain in _ANGLES or plain.startswith(_RESIDUALS)


def _plain(name: str, unit: str) -> tuple[str, str, float]:
    """Return name, unit and factor of a column in the plain form."""
    if unit != "rad":
        return name, unit, 1.0
    return name.replace(_AIR_DATA, "", 1), "deg", 180.0 / np.pi
