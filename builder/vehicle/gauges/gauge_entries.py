"""Sections of the vehicle file on gauges.

[gauges] holds named layouts, each of rows or a file of positions; [recorder] states what reads the gauges.
"""

from __future__ import annotations

from itertools import product
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from builder.vehicle.toml.toml_sections import FileName, Section, Station, once_each
from strainfmu.estimator.settings import SENSOR_RANGE

GaugeLength = Annotated[float, Field(ge=0.0, le=100.0)]


class GaugeRow(Section):
    """Gauges along one meridian of a surface, axial, hoop or both; of length 0 read strain at a point."""

    roll_angle_deg: float = Field(ge=-360.0, le=360.0)
    surface: Literal["inner", "outer"] = "inner"
    length_mm: GaugeLength = 0.0
    directions: list[Literal["axial", "hoop"]] = Field(min_length=1, max_length=2)
    x_m: Annotated[list[Station], AfterValidator(once_each)] | None = Field(default=None, min_length=1)
    first_x_m: Station | None = None
    last_x_m: Station | None = None
    count: int | None = Field(default=None, ge=2, le=1000)

    @model_validator(mode="after")
    def _one_way_to_give_stations(self) -> GaugeRow:
        spread = [self.first_x_m, self.last_x_m, self.count]
        if (self.x_m is None) != all(value is not None for value in spread) or (
            self.x_m is not None and any(value is not None for value in spread)
        ):
            raise ValueError("stations must be given either as x_m or as first_x_m, last_x_m and count")
        if self.first_x_m is not None and self.first_x_m == self.last_x_m:
            raise ValueError(f"first_x_m, last_x_m: expected two stations, got {self.first_x_m:g} twice")
        return self

    @property
    def stations(self) -> list[float]:
        """Axial stations [m]."""
        if self.x_m is not None:
            return self.x_m
        assert self.first_x_m is not None
        assert self.last_x_m is not None
        assert self.count is not None
        step = (self.last_x_m - self.first_x_m) / (self.count - 1)
        return [self.first_x_m + step * i for i in range(self.count)]


class GaugeLayoutEntry(Section):
    """One layout: rows, or a CSV file of positions and directions; surface and length are of all its gauges.

    Gauges of a file on a vehicle of another shape than a profile are moved to the surface from
    ``largest_distance_mm`` at most.
    """

    rows: list[GaugeRow] | None = Field(default=None, min_length=1)
    file: FileName | None = None
    surface: Literal["inner", "outer"] | None = None
    length_mm: GaugeLength | None = None
    largest_distance_mm: float = Field(default=0.5, ge=1e-3, le=1e3)

    @model_validator(mode="after")
    def _rows_or_file(self) -> GaugeLayoutEntry:
        if (self.rows is None) == (self.file is None):
            raise ValueError("a layout needs either rows or file")
        if self.rows is not None and (self.surface is not None or self.length_mm is not None):
            raise ValueError("surface and length_mm belong in each row; next to rows they have no meaning")
        known: dict[tuple[float, str, float, str], int] = {}
        for number, row in enumerate(self.rows or (), start=1):
            roll = round(row.roll_angle_deg % 360.0, 6) % 360.0
            for kind, x in product(row.directions, row.stations):
                first = known.setdefault((roll, row.surface, round(x, 6), kind), number)
                if first != number or row.directions.count(kind) > 1:
                    raise ValueError(
                        f"rows.{number}: expected each gauge once, got the {kind} one at {x:g} m of rows.{first} "
                        "again"
                    )
        return self


class Gauges(Section):
    """Named layouts and the one in use; ``range_um_per_m`` is the largest strain that they measure.

    A reading beyond it leaves its gauge out. Amplifiers limit it, too; without the entry it is 50,000 um/m, which
    foil gauges bear.
    """

    layout: str
    range_um_per_m: float | None = Field(default=None, ge=1.0, le=1e6 * SENSOR_RANGE)
    layouts: dict[str, GaugeLayoutEntry] = Field(min_length=1)

    @model_validator(mode="after")
    def _layout_exists(self) -> Gauges:
        if self.layout not in self.layouts:
            raise ValueError(f"layout '{self.layout}' is not among the layouts {sorted(self.layouts)}")
        return self


Strain = Annotated[float, Field(ge=0.0, le=1e5)]


class Recorder(Section):
    """Errors of the readings in addition to the noise of the gauges in [noise], all 0 by default.

    ``noise_um_per_m`` is the standard deviation of an amplifier's noise, one for all or one of each gauge in use.
    Readings have steps of 2 ``range_um_per_m`` over 2 to the power of ``bits``. A hum has the amplitude
    ``pickup_um_per_m``, the same in all readings (``pickup`` "common") or of each cable ("cable"). A scanner reads
    the gauges in order, ``channel_ms`` apart: in turns of the angular rate ``turn_deg_per_s`` across the axis they
    read different flights. Gauges for another metal leave ``mismatch_um_per_m_per_K`` of the wall's expansion
    uncompensated, while the wall is ``gradient_K`` warmer at the aft end than at the nose. Rate and gradient are
    standard deviations.
    """

    noise_um_per_m: Strain | list[Strain] = 0.0
    bits: int | None = Field(default=None, ge=4, le=32)
    range_um_per_m: float | None = Field(default=None, gt=0.0, le=1e6)
    pickup_um_per_m: Strain = 0.0
    pickup: Literal["common", "cable"] = "cable"
    channel_ms: float = Field(default=0.0, ge=0.0, le=1e3)
    turn_deg_per_s: float = Field(default=10.0, ge=0.0, le=360.0)
    mismatch_um_per_m_per_K: float = Field(default=0.0, ge=-100.0, le=100.0)
    gradient_K: float = Field(default=0.0, ge=0.0, le=1e3)

    @model_validator(mode="after")
    def _range_and_bits(self) -> Recorder:
        if (self.bits is None) != (self.range_um_per_m is None):
            raise ValueError("bits and range_um_per_m: expected both or none, they make the step of a reading")
        return self

    @property
    def step_um_per_m(self) -> float:
        """Step of a reading, 0 where it is not stated."""
        return (
            0.0 if self.bits is None or self.range_um_per_m is None else 2.0 * self.range_um_per_m / 2**self.bits
        )
