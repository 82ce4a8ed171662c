"""What every section of a TOML file is, and the kinds of values that several of them take."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from builder.vehicle.toml.entry_faults import all_faults
from builder.vehicle.toml.entry_limits import (
    ALTITUDE_KM,
    HALF_ANGLE_DEG,
    MACH_NUMBER,
    STATION_M,
    STREAM_ANGLE_DEG,
    one_line,
)
from strainfmu.errors import FaultsError


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
