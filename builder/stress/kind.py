"""A kind of error of the stress test: what is flown, with which hardware, and what becomes of the readings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np

from builder.stress.flights import DrawConditions, inside
from builder.stress.flows import OtherFlow
from builder.structure.as_built.vehicle import AsBuilt, Counts, exactly_built
from builder.truth.as_built import drawn
from builder.vehicle.map.options import Noise
from strainfmu.arrays import FloatArray
from strainfmu.flight_condition import FlightCondition

KindClass = Literal["within", "outside", "unobservable"]
"""``within``
    Inside the envelope, of a size within twice the stated standard deviation: the stated sigmas must include it.
``outside``
    Beyond the envelope, beyond the stated sizes, or of a kind that no sigma holds: health must show it, or the
    estimate must be right all the same.
``unobservable``
    The strain is the strain of another flight which is inside the envelope: no function of strain and
    q_inf can separate them. Only another sensor can. On the shipped vehicle the strain of these kinds differs
    from the strain of the nearest flight inside by a chi-square of 1 to 3, median over flights, with all hardware
    errors in the covariance; the strain of the kinds ``outside`` whose undetected fraction is large, by 60 to 870.
"""

SILENT_TARGET: dict[KindClass, float] = {"within": 3.0, "outside": 5.0}
"""Largest share [%] of silent samples that is aimed at."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Hardware:
    """The gauges of a vehicle, or its auxiliary sensors, and the stated sizes of its errors.

    Attributes
    ----------
    noise : section [noise] of the vehicle file.
    station, roll_angle : (n_d,) of the gauges [m], [rad].
    noise_std : (n_d,) of the gauges' own noise [m/m], or of the sensors' [their units].
    counts : numbers of what has errors of its own.
    """

    noise: Noise
    station: FloatArray
    roll_angle: FloatArray
    noise_std: FloatArray
    counts: Counts

    @property
    def n_gauges(self) -> int:
        return self.counts.gauge


Build = Callable[[Hardware, np.random.Generator], AsBuilt]
"""Returns one vehicle."""

Readings = Callable[[FloatArray, FloatArray, Hardware, np.random.Generator], FloatArray]
"""Takes strain (k, n_d) [m/m] with noise, and the roll angle (k, 1) of the leeward meridian [rad]; returns what is
read."""


def exact(hardware: Hardware, random: np.random.Generator) -> AsBuilt:
    """Return the vehicle of the file."""
    return exactly_built(hardware.counts)


def as_stated(hardware: Hardware, random: np.random.Generator) -> AsBuilt:
    """Return a vehicle with all errors drawn at their stated sizes."""
    return drawn(hardware.noise, hardware.counts, random)


def as_read(strain: FloatArray, wind: FloatArray, hardware: Hardware, random: np.random.Generator) -> FloatArray:
    """Return the strain itself."""
    return strain


@dataclass(frozen=True, kw_only=True)
class Filtered:
    """A filter over time: each condition is flown for a while, and its last sample counts.

    Attributes
    ----------
    time_constant, time_step : [s].
    steps : samples of each condition, with gauge noise of their own.
    zero, common : standard deviations of the zeros, of each gauge and in common, over the gauges' noise. The
        errors are drawn once for each vehicle.
    """

    time_constant: float = 10.0
    time_step: float = 0.1
    steps: int = 20
    zero: float = 0.0
    common: float = 0.0


@dataclass(frozen=True, kw_only=True)
class KnownParameters:
    """Flow parameters that the estimator is given.

    Attributes
    ----------
    std : their standard deviation, of their ranges [1].
    off : by how many of these each is off, besides an error that is drawn.
    """

    std: float
    off: float = 0.0


class AirData(Protocol):
    """Air data that the estimator is given, otherwise than the exact M, altitude or p_inf and q_inf."""

    def known(
        self, conditions: Sequence[FlightCondition], noise: Noise, random: np.random.Generator
    ) -> dict[str, Any]:
        """Return arguments of the estimator; with M or q_inf among them nothing else is given."""
        ...


class AddedStrain(Protocol):
    """Strain that no pressure makes."""

    def strain(self, conditions: Sequence[FlightCondition]) -> FloatArray:
        """Return (k, n_d) strain of the gauges [m/m] in flights at ``conditions``."""
        ...


@dataclass(frozen=True, eq=False, kw_only=True)
class Kind:
    """One kind of error.

    Attributes
    ----------
    error, size : names for the table.
    group : class of the error.
    what : what is done, and why the error is of its class.
    flights : where it is flown.
    flow : the pressure, None for the pressure of the independent model.
    build : the vehicle of one draw.
    added : strain that no pressure makes; None for none.
    readings, sensor_readings : what becomes of the strains, and of what auxiliary sensors read.
    parameters : flow parameters that are given; None for none.
    air_data : air data that are given otherwise; None for none.
    navigation : whether Mach number and altitude are given; the nonlinear estimator takes p_inf in its place.
    filtered : the filter over time that estimates; None for none.
    draws : vehicles and noise of the run, times this.
    flagged_target, outside_target : share [%] of flagged samples at least, and of OUTSIDE at most, aimed at.
    """

    error: str
    size: str
    group: KindClass
    what: str
    flights: DrawConditions = inside
    flow: OtherFlow | None = None
    build: Build = exact
    added: AddedStrain | None = None
    readings: Readings = as_read
    sensor_readings: Readings = as_read
    parameters: KnownParameters | None = None
    air_data: AirData | None = None
    navigation: bool = True
    filtered: Filtered | None = None
    draws: float = 1.0
    flagged_target: float | None = None
    outside_target: float | None = None

    @property
    def silent_target(self) -> float | None:
        """Largest share [%] of silent samples that is aimed at; None for what no strain can show."""
        return SILENT_TARGET.get(self.group)
