"""Section [recorder] of the vehicle file: what reads the gauges."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from builder.vehicle.toml.toml_sections import Section

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
