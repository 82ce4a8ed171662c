"""Section [conditions] of the vehicle file: flight conditions, and flow parameters such as deflections."""

from __future__ import annotations

import re
from typing import Annotated, Any

from pydantic import AfterValidator, Field, field_validator, model_validator

from builder.vehicle.toml.entry_limits import ALTITUDE_KM, once_each
from builder.vehicle.toml.toml_sections import Altitude, FileName, MachNumber, Section, StreamAngle
from strainfmu.flight_condition import ALTITUDE_COLUMN, CONDITION_COLUMNS

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")
MAX_PARAMETERS = 6
TAKEN = ("time_s", *CONDITION_COLUMNS, "file")
"""Columns of the files in which parameters are columns, too."""

Value = Annotated[float, Field(ge=-1e6, le=1e6)]


class DeflectedSurface(Section):
    """The surface at one value of a parameter: a file with the triangles of ``shape.surface``, in their order."""

    value: Value
    file: FileName


class FlowParameter(Section):
    """One parameter: its values in the snapshots, and the surfaces that belong to values of it.

    ``shape.surface`` is that at ``undeflected``. Between the values of the surfaces nodes move in straight lines.
    """

    values: Annotated[list[Value], AfterValidator(once_each)] = Field(min_length=1)
    undeflected: Value = 0.0
    surfaces: list[DeflectedSurface] = Field(default_factory=list, max_length=50)

    @model_validator(mode="after")
    def _surfaces_hold_the_values(self) -> FlowParameter:
        if not self.surfaces:
            return self
        known = once_each([self.undeflected, *(one.value for one in self.surfaces)])
        low, high = min(known), max(known)
        for value in self.values:
            if not low <= value <= high:
                raise ValueError(f"values: expected {low:g} .. {high:g}, the range of the surfaces, got {value:g}")
        return self


def checked_names(parameters: dict[str, FlowParameter]) -> dict[str, FlowParameter]:
    """Return ``parameters``.

    Raises
    ------
    ValueError
        There are too many, or a name cannot be the name of a column.
    """
    if len(parameters) > MAX_PARAMETERS:
        raise ValueError(f"expected at most {MAX_PARAMETERS} parameters, got {len(parameters)}")
    for name in parameters:
        if not NAME.fullmatch(name) or name in TAKEN:
            raise ValueError(
                f"expected names of letters, digits and _ other than {', '.join(TAKEN)}, got '{name}'"
            )
    return parameters


class Conditions(Section):
    """Flight conditions of the snapshots: all combinations. ``altitude_km`` is one number or a list.

    ``parameters`` are flow parameters, each a section with a name of the user's.
    """

    mach_number: list[MachNumber] = Field(min_length=1)
    angle_of_attack_deg: list[StreamAngle] = Field(min_length=1)
    sideslip_angle_deg: list[StreamAngle] = Field(min_length=1)
    altitude_km: Altitude | Annotated[list[Altitude], Field(min_length=1)]
    parameters: Annotated[dict[str, FlowParameter], AfterValidator(checked_names)] = Field(default_factory=dict)

    @field_validator(ALTITUDE_COLUMN, mode="before")
    @classmethod
    def _number_or_list(cls, value: Any) -> Any:
        """Refuse here, in one line, what is no altitude: a union has a fault for each of its parts."""
        given = value if isinstance(value, list) else [value]
        if not given:
            raise ValueError("expected at least 1 value, got []")
        for one in given:
            if isinstance(one, bool) or not isinstance(one, int | float) or not ALTITUDE_KM.holds(one):
                raise ValueError(f"expected {ALTITUDE_KM}, or a list of such numbers, got {one!r}")
        return value

    @field_validator(*CONDITION_COLUMNS)
    @classmethod
    def _each_value_once(cls, values: list[float] | float) -> list[float] | float:
        return once_each(values) if isinstance(values, list) else values

    @property
    def altitudes_km(self) -> list[float]:
        """Altitudes [km], in the order of the file."""
        return self.altitude_km if isinstance(self.altitude_km, list) else [self.altitude_km]
