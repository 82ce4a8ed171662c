"""The section [temperature] of a vehicle file: how warm the wall may become, and what measures it."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from builder.vehicle.toml.toml_sections import Section, Station

Rise = Annotated[float, Field(ge=0.0, le=2000.0)]


class TemperatureSensor(Section):
    """A temperature sensor on the wall."""

    name: Annotated[str, Field(min_length=1, max_length=100)]
    x_m: Station
    roll_angle_deg: float = Field(default=0.0, ge=-360.0, le=360.0)
    surface: Literal["inner", "outer"] = "inner"
    std_K: float = Field(default=1.0, ge=1e-3, le=100.0)


class Temperature(Section):
    """Temperature of the wall above ``reference_degC``, at which zeros, gauge factors and modulus hold.

    The rise is a sum of modes along the body, linear between ``stations_m`` (default: five, evenly spaced): in
    the middle of the wall of all its roll angles (``rise_K``), with the first and the second harmonic round the
    body (``side_K``, ``second_harmonic_K``); the difference from the inner to the outer surface
    (``through_wall_K``) and its first harmonic (``through_wall_side_K``). Each is one standard deviation of the
    mode's amplitude at each station; 0 leaves a kind of modes out.

    Gauges cancel ``compensation_um_per_m_per_K`` (default: the expansion of the material);
    ``apparent_strain_um_per_m`` are the coefficients of rise, rise^2 .. of their data sheet [um/m, K], the same of
    all gauges of the lot, ``apparent_strain_scatter_um_per_m_per_K`` the standard deviation of the first of them
    from gauge to gauge. ``gauge_factor_percent_per_100K`` and ``modulus_percent_per_100K`` are changes with
    temperature.
    """

    reference_degC: float = Field(default=20.0, ge=-200.0, le=1000.0)
    expansion_um_per_m_per_K: float = Field(ge=-100.0, le=100.0)
    compensation_um_per_m_per_K: float | None = Field(default=None, ge=-100.0, le=100.0)
    apparent_strain_um_per_m: tuple[Annotated[float, Field(ge=-1e3, le=1e3)], ...] = Field(
        default=(), max_length=6
    )
    apparent_strain_scatter_um_per_m_per_K: float = Field(default=0.0, ge=0.0, le=100.0)
    gauge_factor_percent_per_100K: float = Field(default=0.0, ge=-50.0, le=50.0)
    modulus_percent_per_100K: float = Field(default=0.0, ge=-50.0, le=50.0)
    stations_m: Annotated[list[Station], Field(min_length=1, max_length=50)] | None = None
    rise_K: Rise = 40.0
    side_K: Rise = 2.0
    second_harmonic_K: Rise = 0.2
    through_wall_K: Rise = 1.0
    through_wall_side_K: Rise = 0.2
    sensor: Annotated[list[TemperatureSensor], Field(max_length=200)] = Field(default_factory=list)

    @field_validator("apparent_strain_um_per_m", mode="before")
    @classmethod
    def _tuple(cls, value: object) -> object:
        return tuple(value) if isinstance(value, list) else value

    @model_validator(mode="after")
    def _check(self) -> Temperature:
        stations, names = self.stations_m or [], [one.name for one in self.sensor]
        if any(b <= a for a, b in pairwise(stations)):
            raise ValueError(f"stations_m: expected increasing stations, got {stations}")
        if len(set(names)) < len(names):
            raise ValueError(f"sensor: expected names once each, got {names}")
        if not any((self.rise_K, self.side_K, self.second_harmonic_K, self.through_wall_K)):
            raise ValueError("rise_K: expected some mode above 0, got none")
        return self
