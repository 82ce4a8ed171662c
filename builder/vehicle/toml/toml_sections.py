"""What every section of a TOML file is, and the limits of values that several of them take.

Limits, of derived sizes too, are wide enough for any vehicle that can be meant. A value beyond them is a slip of
unit or of a digit; it is refused before it costs hours or memory.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from builder.vehicle.toml.entry_faults import all_faults
from strainfmu.errors import FaultsError


@dataclass(frozen=True)
class Limits:
    """A closed range of numbers; as text ``low .. high``."""

    low: float
    high: float

    def holds(self, value: float) -> bool:
        """Return whether ``value`` lies in the range; NaN does not."""
        return self.low <= value <= self.high

    def __str__(self) -> str:
        return f"{self.low:g} .. {self.high:g}"


MACH_NUMBER = Limits(1.01, 30.0)
STREAM_ANGLE_DEG = Limits(-60.0, 60.0)
HALF_ANGLE_DEG = Limits(-45.0, 45.0)
ALTITUDE_KM = Limits(0.0, 71.0)
"""Of the US Standard Atmosphere 1976 as far as it is modelled."""
STATION_M = Limits(1e-4, 1e3)
INTERNAL_PRESSURE_PA = Limits(0.0, 1e8)
GAMMA = Limits(1e-12, 1e12)

MAX_CONDITIONS = 20_000
MAX_GAUGES = 4_096
"""Of one layout; maps of more than 2,000 hold for the linear estimator alone, and for strain gauges."""
MAX_PRESSURES = 250_000_000
"""Values of one array: conditions or gauges, times surface nodes; 2 GB."""
MIN_ELEMENTS = 10
"""Along the meridian."""
MAX_ELEMENTS = 200_000
"""Elements along the meridian times layers of the wall."""


CLOSEST_VALUES = 1e-6
"""Between two values of one list, in its unit: closer ones are one value that was rounded twice."""


def once_each(values: list[float]) -> list[float]:
    """Return ``values``.

    Raises
    ------
    ValueError
        A value is there more than once, as far as can be seen: every combination with it would count again.
    """
    for low, high in pairwise(sorted(values)):
        if low == high:
            raise ValueError(f"expected each value once, got {low:g} more than once")
        if high - low < CLOSEST_VALUES:
            raise ValueError(f"expected values at least {CLOSEST_VALUES:g} apart, got {low!r} and {high!r}")
    return values


def one_line(text: str) -> str:
    """Return text that a file name, a table or XML can hold.

    Raises
    ------
    ValueError
        It holds control characters or line breaks, or nothing but blanks.
    """
    if not text.isprintable():
        raise ValueError(f"expected printable text on one line, got {text!r}")
    if not text.strip():
        raise ValueError(f"expected text, got {text!r}")
    return text


class Section(BaseModel):
    """A table of a file: unknown entries, wrong types, NaN and infinity are refused; it never changes."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with other entries, checked as entries of a file are.

        Raises
        ------
        FaultsError
            Entries are unknown or outside their limits, or do not fit the others: one line each.
        """
        copy = super().model_copy(deep=deep)
        if not update:
            return copy
        try:
            checked = type(self).model_validate({**dict(copy), **update})
        except ValidationError as error:
            name = type(self).__name__
            raise FaultsError("\n".join(f"{name}: {line}" for line in all_faults(error, type(self)))) from error
        # The copy has what is no entry, too: the folder of the file, and which entries were given.
        return super(Section, copy).model_copy(update={name: getattr(checked, name) for name in update})


MachNumber = Annotated[float, Field(ge=MACH_NUMBER.low, le=MACH_NUMBER.high)]
StreamAngle = Annotated[float, Field(ge=STREAM_ANGLE_DEG.low, le=STREAM_ANGLE_DEG.high)]
Altitude = Annotated[float, Field(ge=ALTITUDE_KM.low, le=ALTITUDE_KM.high)]
HalfAngle = Annotated[float, Field(ge=HALF_ANGLE_DEG.low, le=HALF_ANGLE_DEG.high)]
Station = Annotated[float, Field(ge=STATION_M.low, le=STATION_M.high)]
FileName = Annotated[str, Field(min_length=1, max_length=1000), AfterValidator(one_line)]
"""Relative to the vehicle file."""
