"""The loads of a map behind the five: one table of what there is, and the groups that a map has of it.

:data:`FAMILIES` is the table. A family is one kind of place, such as sections along the body, with the loads that
a map gives at each of its places. A group is one load of a family at all places of a map: an array of the outputs.
Python, FMUs, columns, the bus and the compiled core follow the groups; none of them names a family. Rows stand
family by family, group by group, place by place: the rolling moment of the whole body, then the axial force of
every section, the normal force of every section and so on.

A coefficient is a force over q_inf S, a moment over q_inf S L, with the reference area and length of the vehicle.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

import numpy as np

from strainfmu.arrays import BoolArray
from strainfmu.errors import InputError
from strainfmu.estimator.signal_names import MOMENT

ROLLING = "M_R"
"""Coefficient of the rolling moment, the sixth load of a body that is none of revolution."""

FIVE_LOADS, OTHER_LOADS = slice(0, 5), slice(5, None)
"""Rows of the five loads, which every map has, and of those behind them."""

LIKE_THE_WIDEST = 5
"""Of a load that is like none of the five: its standard deviation grows as the fastest of the five."""

SIGMA = "sigma."


@dataclass(frozen=True, eq=False, kw_only=True)
class LoadKind:
    """A load that a family has at each of its places.

    Attributes
    ----------
    key : short name, unique in the family.
    name, output : its names in Python and columns, and among the outputs of an FMU, without a number.
    coefficient : name of its coefficient among the outputs, "" where an FMU states the load alone.
    symbol : of the coefficient on a page.
    text, coefficient_text : what load and coefficient are, with the sign.
    unit, shown : "N" or "N.m", and the unit that people read, with or without a k in front.
    step : of the standard deviation in a classic frame, which is rounded up to whole steps.
    like : number of the load among the five whose standard deviation grows as its own does, or
        :data:`LIKE_THE_WIDEST`.
    """

    key: str
    name: str
    output: str
    text: str
    unit: str
    shown: str
    like: int
    step: float = 1.0
    coefficient: str = ""
    coefficient_text: str = ""
    symbol: str = ""


@dataclass(frozen=True, eq=False, kw_only=True)
class LoadFamily:
    """One kind of place, and the loads at each place.

    Attributes
    ----------
    loads : the loads at a place.
    places : the places of a map, as texts; InputError if the entries of the map are wrong.
    place : what a place is, with {} for its text; "" for the whole body, which is one place without a number.
    singular : name of a place.
    frame, frame_text : name of the frames on the bus without a number, and what is in one, with {} for the place.
    sends_coefficients : whether frames hold coefficients; they hold loads if not.
    title, place_title : what a page calls all of it, and the place.
    """

    loads: tuple[LoadKind, ...]
    places: Callable[[Any], tuple[str, ...]]
    frame: str
    frame_text: str
    title: str
    place: str = ""
    place_title: str = ""
    singular: str = ""
    sends_coefficients: bool = False

    @property
    def is_listed(self) -> bool:
        """Whether places, and names of loads at them, have numbers."""
        return bool(self.place)


@dataclass(frozen=True)
class LoadGroup:
    """One load of a family at all ``places`` of a map: rows from ``first`` on of the loads behind the five."""

    family: LoadFamily
    load: LoadKind
    places: tuple[str, ...]
    first: int

    @property
    def size(self) -> int:
        """Number of places."""
        return len(self.places)

    @property
    def rows(self) -> slice:
        """Rows among the loads behind the five."""
        return slice(self.first, self.first + self.size)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the loads in Python and columns."""
        return self.numbered(self.load.name)

    def numbered(self, name: str) -> tuple[str, ...]:
        """Return ``name`` with the number of each place, from 1; as it is for the whole body."""
        return tuple(f"{name}[{i}]" for i in range(1, self.size + 1)) if self.family.is_listed else (name,)

    def described(self, text: str) -> tuple[str, ...]:
        """Return ``text`` with each place behind it."""
        family = self.family
        return tuple(
            f"{text}, of {family.place.format(place)}" if family.is_listed else text for place in self.places
        )


@dataclass(frozen=True)
class LoadArray:
    """Outputs of one group: loads or coefficients, or the standard deviations of either."""

    group: LoadGroup
    is_coefficient: bool
    is_std: bool

    @property
    def name(self) -> str:
        """Name of the array in FMI 3.0; of the whole body the name of the scalar."""
        load = self.group.load
        return f"{SIGMA if self.is_std else ''}{load.coefficient if self.is_coefficient else load.output}"

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs, one by one."""
        return self.group.numbered(self.name)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns that hold them."""
        load = self.group.load
        named = load.coefficient if self.is_coefficient else load.name
        return self.group.numbered(f"{SIGMA if self.is_std else ''}{named}")

    @property
    def unit(self) -> str:
        return "1" if self.is_coefficient else self.group.load.unit

    @property
    def value(self) -> int:
        """Number of what it holds: 0 loads, 1 their sigma, 2 coefficients, 3 their sigma."""
        return 2 * self.is_coefficient + self.is_std


def load_groups(inverse_map: Any) -> tuple[LoadGroup, ...]:
    """Return the groups of a map, in the order of their rows."""
    return groups_at([family.places(inverse_map) for family in FAMILIES])


@lru_cache(maxsize=64)
def load_arrays(groups: tuple[LoadGroup, ...]) -> tuple[LoadArray, ...]:
    """Return the outputs of ``groups`` in their order.

    Family by family come coefficients, if an FMU states them, and their standard deviations, then loads and
    standard deviations.
    """
    return tuple(
        LoadArray(group, is_coefficient, is_std)
        for family in FAMILIES
        for is_coefficient in (True, False)
        for is_std in (False, True)
        for group in groups
        if group.family is family and (group.load.coefficient or not is_coefficient)
    )


def output_units(groups: tuple[LoadGroup, ...]) -> dict[str, str]:
    """Return the unit of each output of ``groups`` by name, in their order."""
    return {name: array.unit for array in load_arrays(groups) for name in array.outputs}


def number_of(groups: Sequence[LoadGroup]) -> int:
    """Return the number m of loads of ``groups``."""
    return sum(group.size for group in groups)


def names_of(groups: Sequence[LoadGroup]) -> tuple[str, ...]:
    """Return m names, ``rolling_moment``, then ``section.axial[1]`` .."""
    return tuple(name for group in groups for name in group.names)


def is_moment(groups: Sequence[LoadGroup]) -> BoolArray:
    """Return (m,) whether each load is a moment."""
    return np.array([group.load.unit == "N.m" for group in groups for _ in group.places], dtype=bool)


@cache
def column_of(output: str) -> str | None:
    """Return the column of an output; None where it is no load behind the five, coefficient or sigma."""
    sigma = SIGMA if output.startswith(SIGMA) else ""
    stem, bracket, number = output.removeprefix(SIGMA).partition("[")
    column = _columns().get(stem)
    return None if column is None else f"{sigma}{column}{bracket}{number}"


def is_column(name: str) -> bool:
    """Return whether ``name`` is a column of a load behind the five, of a coefficient or a standard deviation."""
    return name.removeprefix(SIGMA).partition("[")[0] in _columns().values()


def coefficient_names() -> tuple[str, ...]:
    """Return the names of all coefficients, without numbers."""
    return tuple(load.coefficient for family in FAMILIES for load in family.loads if load.coefficient)


@lru_cache(maxsize=1)
def _columns() -> dict[str, str]:
    """Return the column of each output by name, both without numbers."""
    loads = [load for family in FAMILIES for load in family.loads]
    return {load.output: load.name for load in loads} | {name: name for name in coefficient_names()}


def groups_at(places: Sequence[tuple[str, ...]]) -> tuple[LoadGroup, ...]:
    """Return the groups of the places of each family."""
    groups, first = list[LoadGroup](), 0
    for family, of_family in zip(FAMILIES, places, strict=True):
        for load in family.loads if of_family else ():
            groups.append(LoadGroup(family, load, of_family, first))
            first += len(of_family)
    return tuple(groups)


def _stations(inverse_map: Any) -> tuple[str, ...]:
    station = inverse_map.section_station
    if not (station.ndim == 1 and np.all(np.isfinite(station)) and np.all(np.diff(station) > 0.0)):
        raise InputError("inverse map: section_station must hold rising numbers")
    return tuple(f"{x:g}" for x in station.tolist())


def _of_section(key: str, text: str, unit: str, like: int) -> LoadKind:
    name = f"section.{key}"
    return LoadKind(key=key, name=name, output=name, text=text, unit=unit, shown=f"k{unit}", like=like)


BODY = LoadFamily(
    loads=(
        LoadKind(
            key="roll",
            name="rolling_moment",
            output="moment.roll",
            text="Rolling moment, positive with starboard going down",
            unit="N.m",
            shown="kN.m",
            like=LIKE_THE_WIDEST,
            coefficient=ROLLING,
            coefficient_text="Rolling moment coefficient, positive with starboard down",
            symbol="C_l",
        ),
    ),
    places=lambda _: ("",),
    frame="RollingMoment",
    frame_text="Rolling moment coefficient C_l, positive with starboard down",
    title="Rolling moment",
    sends_coefficients=True,
)
"""The whole body: the rolling moment."""

SECTIONS = LoadFamily(
    loads=(
        _of_section("axial", "Axial force, positive aft", "N", 0),
        _of_section("normal", "Normal shear force, positive up", "N", 1),
        _of_section("side", "Side shear force, positive to starboard", "N", 2),
        _of_section("pitch", "Bending moment, positive as nose-up pitching moment", "N.m", 3),
        _of_section("yaw", "Bending moment, positive as nose-to-starboard yawing moment", "N.m", 4),
        _of_section(
            "torsion",
            "Torsion moment, positive as rolling moment with starboard going down",
            "N.m",
            LIKE_THE_WIDEST,
        ),
    ),
    places=_stations,
    place="the part ahead of x = {} m",
    singular="section",
    frame="Section",
    frame_text="Loads of the air on the part ahead of x = {} m",
    title="Loads of the air on the part ahead of x",
    place_title="x [m]",
)
"""Sections at stations x_s: loads of the air on the part of the body ahead of it, about the point (x_s, 0, 0).

A cut there carries them if the part ahead has no weight and is not accelerated.
"""

HINGES = LoadFamily(
    loads=(
        LoadKind(
            key=MOMENT,
            name="hinge_moment",
            output="moment.hinge",
            text="Hinge moment of the air, right-handed",
            unit="N.m",
            shown="N.m",
            like=LIKE_THE_WIDEST,
            step=0.01,
            coefficient="M_H",
            coefficient_text="Hinge moment over q_inf S L, right-handed",
            symbol="M_H",
        ),
    ),
    places=lambda inverse_map: () if inverse_map.hinge_lines is None else inverse_map.hinge_lines.name,
    place="hinge line {}",
    singular="hinge line",
    frame="Hinge",
    frame_text="Hinge moment of the air, right-handed about hinge line {}",
    title="Hinge moments of the air, right-handed",
    place_title="hinge line",
)
"""Hinge lines: moment of the air on a region of the surface, such as a fin, about a line of its own."""

BENDING = LoadFamily(
    loads=(
        LoadKind(
            key=MOMENT,
            name="bending_moment",
            output="moment.bending",
            text="Bending moment of the air on the part ahead, positive as the nose goes towards its roll angle",
            unit="N.m",
            shown="kN.m",
            like=LIKE_THE_WIDEST,
        ),
    ),
    places=lambda inverse_map: () if inverse_map.bending_lines is None else inverse_map.bending_lines.name,
    place="station {}",
    singular="station",
    frame="Bending",
    frame_text="Bending moment of the air at station {}, positive as the nose goes towards its roll angle",
    title="Bending moments of the air at stations",
    place_title="station",
)
"""Stations with a name: the bending moment of the part ahead, in a plane through the axis at a roll angle."""

FAMILIES = (BODY, SECTIONS, HINGES, BENDING)
"""All there is, in the order of rows and outputs."""


def rows_of(groups: Sequence[LoadGroup], family: LoadFamily) -> slice:
    """Return the rows of a family, which stand side by side; none where there is no group of it."""
    rows = [group.rows for group in groups if group.family is family]
    return slice(rows[0].start, rows[-1].stop) if rows else slice(0, 0)
