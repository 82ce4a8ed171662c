"""What a vehicle as built, and its test, may have different from what the files state: the CSV file of this name.

A kind has one name, one unit and one size in all uses: the prior of a calibration ([calibration] of the vehicle
file), vehicles that are drawn as truth and error columns of a map ([noise]), cases of the fault detection study at
twice the stated size, and errors of the loads of a ground test ([errors] of its file). The sections state standard
deviations, with their defaults; the table says which entry belongs to which kind.
"""

import csv
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE

Extent = Literal["gauge", "vehicle", "region", "row", "joint", "load"]
"""What has its own parameter: each gauge, the vehicle, each region of the wall, each row of gauges at one roll
angle, each joint, or each load."""

Role = Literal["estimated", "considered", "split"]
"""What the gain of a map may do about an error, see :mod:`builder.inverse.noise.error_list`."""

UNIT = {"%": 0.01, "mm": 1e-3, "um/m": 1e-6, "deg": float(np.pi / 180.0), "N": 1.0, "kg": 1.0}
"""Size of the units of entries, in SI."""
UNIT_OF_END = {"_percent": "%", "_um_per_m": "um/m", "_mm": "mm", "_deg": "deg", "_N": "N", "_kg": "kg"}
"""Units by the ends of entries' names."""


@dataclass(frozen=True, kw_only=True)
class ParameterKind:
    """One kind of error.

    Attributes
    ----------
    name : of the kind, and of the field that holds it.
    error : name of the kind in the fault detection study; empty where that has no case of it.
    column : name of its error columns in a map, where that is another than the kind's own in words.
    extent : what has its own parameter of this kind.
    acts_on : what it changes, for pages.
    relative_to : what a size in percent is a part of, where the kind's name does not say so.
    entry : of each of the ``sections`` of the vehicle file or of a test's file that states its standard deviation.
    step : of central differences of the readings by it; 0 where the derivative has a closed form.
    flight : whether strain in flight depends on it; a ground test alone does otherwise.
    taken_for_zero : whether the standard deviation is 0 by default, and the test says whether that holds.
    alike_in_flight : whether [noise] states one number for all regions alike, not one for each.
    role : in maps. The gain corrects errors of single gauges, of gains and of zeros, and does not know errors of
        the layout and the wall.
    """

    name: str
    extent: Extent
    acts_on: str
    entry: str
    sections: tuple[str, ...] = ("calibration", "noise")
    error: str = ""
    column: str = ""
    relative_to: str = ""
    step: float = 0.0
    flight: bool = True
    taken_for_zero: bool = False
    alike_in_flight: bool = False
    role: Role = "estimated"

    @cached_property
    def unit(self) -> str:
        """Unit of the entry, by its end; parameters themselves are in SI."""
        return next(unit for end, unit in UNIT_OF_END.items() if self.entry.endswith(end))

    @cached_property
    def scale(self) -> float:
        """Size of the unit, in SI."""
        return UNIT[self.unit]

    @property
    def in_words(self) -> str:
        """The name as it is printed."""
        return self.name.replace("_", " ")

    @property
    def column_name(self) -> str:
        """Name of its error columns in a map."""
        return self.column or self.in_words

    @property
    def is_one_in_flight(self) -> bool:
        """Whether [noise] states one error of the whole vehicle."""
        return self.extent == "vehicle" or self.alike_in_flight

    def std(self, section: object) -> float:
        """Return the standard deviation that a section states, in SI."""
        return self.scale * float(getattr(section, self.entry))


def _kind(row: dict[str, str]) -> ParameterKind:
    marks = row.pop("marks").split()
    texts = {name: text for name, text in row.items() if text and name not in ("group", "sections", "step")}
    return ParameterKind(
        **texts,  # type: ignore[arg-type]  # columns of the table are fields of text
        sections=tuple(row["sections"].split()),
        step=float(row["step"] or 0.0),
        flight="test_alone" not in marks,
        taken_for_zero="taken_for_zero" in marks,
        alike_in_flight="alike_in_flight" in marks,
    )


def _read() -> dict[str, tuple[ParameterKind, ...]]:
    """Return the kinds of the CSV file of this name, by group."""
    groups: dict[str, list[ParameterKind]] = {}
    with Path(__file__).with_suffix(".csv").open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            groups.setdefault(row["group"], []).append(_kind(row))
    return {name: tuple(kinds) for name, kinds in groups.items()}


_GROUPS = _read()

AS_BUILT = _GROUPS["as built"]
"""Kinds of the vehicle as a calibration estimates it, in the order of its vector. New ones go to the end, so that
the same seed draws the same vehicle."""

IN_FLIGHT = _GROUPS["in flight"]
"""Kinds that no ground test knows."""

OF_LOADS = _GROUPS["of loads"]
"""Kinds of the loads of a ground test."""


def by_name(kinds: Iterable[ParameterKind]) -> dict[str, ParameterKind]:
    """Return kinds by their names, in order."""
    return {kind.name: kind for kind in kinds}


KINDS = by_name((*AS_BUILT, *IN_FLIGHT, *OF_LOADS))
"""The whole table."""

ALWAYS_DRAWN = (
    "gauge_gain",
    "common_gain",
    "axial_shift",
    "circumferential_shift",
    "orientation",
    "layout_roll",
    "wall_thickness",
    "apparent_strain",
    "internal_pressure",
    DYNAMIC_PRESSURE,
)
"""Kinds whose numbers are drawn first, and even at size 0: the vehicles of a seed stay the same."""

IN_NOISE = tuple(
    KINDS[name]
    for name in dict.fromkeys(
        (*ALWAYS_DRAWN, *(kind.name for kind in (*AS_BUILT, *IN_FLIGHT) if "noise" in kind.sections))
    )
)
"""Kinds that [noise] states, in the order in which vehicles are drawn.

Young's modulus is in the common gain there, zeros are subtracted, and mass does not change strain under pressure:
inertia is no load of a map.
"""

BY_REGION = tuple(
    kind.name for kind in IN_NOISE if kind.extent in ("region", "joint") and not kind.alike_in_flight
)
"""Kinds of [noise] of which each region of the wall, or each joint, has its own."""
