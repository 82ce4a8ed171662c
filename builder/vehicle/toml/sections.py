"""What every section of a TOML file is, and the kinds of values that several of them take."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from builder.vehicle.toml.limits import (
    ALTITUDE_KM,
    HALF_ANGLE_DEG,
    MACH_NUMBER,
    STATION_M,
    STREAM_ANGLE_DEG,
    one_line,
)


class Section(BaseModel):
    """A table of a file: unknown entries, wrong types, NaN and infinity are refused; it never changes."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


MachNumber = Annotated[float, Field(ge=MACH_NUMBER.low, le=MACH_NUMBER.high)]
StreamAngle = Annotated[float, Field(ge=STREAM_ANGLE_DEG.low, le=STREAM_ANGLE_DEG.high)]
Altitude = Annotated[float, Field(ge=ALTITUDE_KM.low, le=ALTITUDE_KM.high)]
HalfAngle = Annotated[float, Field(ge=HALF_ANGLE_DEG.low, le=HALF_ANGLE_DEG.high)]
Station = Annotated[float, Field(ge=STATION_M.low, le=STATION_M.high)]
FileName = Annotated[str, Field(min_length=1, max_length=1000), AfterValidator(one_line)]
"""Relative to the vehicle file."""
