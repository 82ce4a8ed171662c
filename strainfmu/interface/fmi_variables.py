"""Elements of an FMU's interface: variables and their units, for FMI 2.0 and 3.0."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from math import pi
from typing import Any, Literal

Kind = Literal["reading", "air data", "parameter", "output", "health"]
"""Kinds of signals: what gauges and sensors read, air data and flow, settings, loads, and what states how good."""


@dataclass(frozen=True)
class DisplayUnit:
    """A unit for people: shown value = ``factor`` * value in the parent unit (FMI 2.0, section 2.2.2)."""

    name: str
    factor: float


@dataclass(frozen=True)
class Unit:
    """A unit with its exponents of SI base units (and rad), as FMI 2.0, section 2.2.2 wants it."""

    name: str
    base: tuple[tuple[str, int], ...] = ()
    display_units: tuple[DisplayUnit, ...] = ()


@dataclass(frozen=True)
class Variable:
    """One variable: a ScalarVariable of FMI 2.0 (section 2.2.7), an array in FMI 3.0; numbers are in ``unit``.

    Attributes
    ----------
    kind : what it is to a reader.
    label, symbol : short name and symbol of tables and figures, "" where its name serves.
    fmi_type : type in FMI 2.0: Real, Integer, Boolean or Enumeration.
    depends_on : names of the inputs that an output depends on at a communication point.
    dependencies_kind : how it does, FMI's word, the same for all of ``depends_on``.
    initially_depends_on : names of the parameters its first value depends on besides.
    array : name of the FMI 3.0 array that it is an element of.
    dimension : number of elements of such an array, None for a scalar; then ``start`` holds one value each.
    """

    name: str
    description: str
    causality: str
    kind: Kind = "output"
    label: str = ""
    symbol: str = ""
    variability: str = "continuous"
    fmi_type: str = "Real"
    unit: str | None = None
    display_unit: str | None = None
    nominal: float | None = None
    minimum: float | None = None
    maximum: float | None = None
    start: float | int | bool | tuple[float | int | bool, ...] | None = None
    declared_type: str | None = None
    depends_on: tuple[str, ...] = ()
    dependencies_kind: str = "dependent"
    initially_depends_on: tuple[str, ...] = ()
    array: str | None = None
    dimension: int | None = None


COEFFICIENTS = {
    "C_A": "Axial force coefficient of pressure less internal pressure, positive aft, fore-body",
    "C_N": "Normal force coefficient, positive up",
    "C_Y": "Side force coefficient, positive to starboard",
    "M_P": "Pitching moment coefficient, positive nose-up",
    "M_Y": "Yawing moment coefficient, positive nose to starboard",
}

UNITS = (
    Unit("1", (), (DisplayUnit("um/m", 1e6),)),
    Unit("N", (("kg", 1), ("m", 1), ("s", -2)), (DisplayUnit("kN", 1e-3),)),
    Unit("N.m", (("kg", 1), ("m", 2), ("s", -2)), (DisplayUnit("kN.m", 1e-3),)),
    Unit("Pa", (("kg", 1), ("m", -1), ("s", -2)), (DisplayUnit("kPa", 1e-3),)),
    Unit("m", (("m", 1),), (DisplayUnit("mm", 1e3), DisplayUnit("km", 1e-3))),
    Unit("m2", (("m", 2),), (DisplayUnit("cm2", 1e4),)),
    Unit("rad", (("rad", 1),), (DisplayUnit("deg", 180.0 / pi),)),
    Unit("rad/s", (("rad", 1), ("s", -1)), (DisplayUnit("deg/s", 180.0 / pi),)),
    Unit("m/s2", (("m", 1), ("s", -2))),
    Unit("rad/s2", (("rad", 1), ("s", -2))),
    Unit("K", (("K", 1),)),
    Unit("s", (("s", 1),), (DisplayUnit("ms", 1e3),)),
    Unit("kg", (("kg", 1),)),
    Unit("kg.m2", (("kg", 1), ("m", 2))),
)


def shown_unit(variable: Variable) -> tuple[str, float]:
    """Return the unit that people read, "" for none, and the factor to it."""
    return unit_shown(variable.unit or "", variable.display_unit)


def unit_shown(unit: str, shown: str | None) -> tuple[str, float]:
    """Return the unit ``shown`` that people read of values in ``unit``, and the factor to it."""
    for definition in UNITS:
        for display in definition.display_units:
            if definition.name == unit and display.name == shown:
                return display.name, display.factor
    return unit, 1.0


def strain_names(n_gauges: int) -> tuple[str, ...]:
    """Return ``strain[1]`` .. ``strain[n]``, which structured naming makes an array (FMI 2.0, 2.2.9)."""
    return tuple(f"strain[{i}]" for i in range(1, n_gauges + 1))


def deviation_of(value: Variable) -> Variable:
    """Return the standard deviation of the output ``value``, in an array of its own where that is in one."""
    return replace(
        value,
        name=f"sigma.{value.name}",
        description=f"Standard deviation of {value.name}",
        nominal=None,
        minimum=0.0,
        array=None if value.array is None else f"sigma.{value.array}",
    )


def depending_on(
    interface: Sequence[Variable], names: tuple[str, ...], but: tuple[str, ...] = (), initially: bool = False
) -> tuple[Variable, ...]:
    """Return ``interface`` whose outputs, but those named, depend on ``names`` too, or ``initially`` do."""

    def changed(variable: Variable) -> Variable:
        if initially:
            return replace(variable, initially_depends_on=(*variable.initially_depends_on, *names))
        return replace(variable, depends_on=(*variable.depends_on, *names))

    return tuple(
        changed(variable) if variable.causality == "output" and variable.name not in but else variable
        for variable in interface
    )


def with_arrays(interface: Sequence[Variable], descriptions: Mapping[str, str]) -> tuple[Variable, ...]:
    """Return the interface of FMI 3.0: elements of one array become one variable, dependencies follow.

    ``descriptions`` holds the description of each array.
    """
    array_of = {variable.name: variable.array or variable.name for variable in interface}

    def merged(names: Iterable[tuple[str, ...]]) -> tuple[str, ...]:
        return tuple(dict.fromkeys(array_of[name] for some in names for name in some))

    variables = []
    for name, group in groupby(interface, key=lambda variable: array_of[variable.name]):
        elements = list(group)
        first = elements[0]
        changed: dict[str, Any] = {
            "array": None,
            "depends_on": merged(element.depends_on for element in elements),
            "initially_depends_on": merged(element.initially_depends_on for element in elements),
        }
        if first.array is not None:
            nominals = [element.nominal for element in elements if element.nominal is not None]
            changed |= {
                "name": name,
                "description": descriptions[name],
                "dimension": len(elements),
                "nominal": max(nominals, default=None),
                "start": None if first.start is None else tuple(element.start for element in elements),
            }
        variables.append(replace(first, **changed))
    return tuple(variables)


def value_references(interface: Sequence[Variable]) -> dict[str, int]:
    """Return the value reference of each variable name: its index in the interface."""
    return {variable.name: index for index, variable in enumerate(interface)}
