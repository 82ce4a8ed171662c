"""Temperature of the vehicle at run time: its strain, subtracted from the readings as far as sensors measure.

The rise of the wall's temperature above the reference is a sum of modes with amplitudes a, a priori independent
with standard deviations s. Sensors read theta = C a + e. Given those that are known,

    P = (diag(1/s^2) + C' R^-1 C)^-1,   a = P C' R^-1 theta,

gauges are B a warmer and read (1 + g B a) (strain / (1 + m B a) + Phi a + p(B a)) + zero: gauge-factor slope g,
modulus slope m, thermal strain Phi of the modes less the gauges' compensation, and the data sheet's polynomial p.
All but the strain is taken off; Phi P Phi' is left in the covariance. Without sensors P = diag(s^2), a = 0: the
modes are nuisances, which the gauges' covariance of the map holds already.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.tables.schema import COVARIANCE, POSITIVE, check, described, entry

LARGEST_RISE = 2000.0
"""|rise| above the reference [K] beyond which a sensor is taken to be broken."""


@described
@dataclass(frozen=True, kw_only=True, eq=False)
class ThermalMap:
    """Temperature modes of a map for n_d gauges, k modes and n_t sensors."""

    # fmt: off
    reference_temperature: float = entry(unit="K", meaning="at which zeros, gauge factors and modulus hold",
        place="thermal.reference_temperature")
    prior_std: FloatArray = entry("k", "K", "s, standard deviation of each mode's amplitude",
        place="thermal.prior_std", rule=POSITIVE)
    mode_strain: FloatArray = entry("n_d k", "1/K", "Phi, what gauges read of each mode per amplitude",
        place="thermal.mode_strain")
    gauge_operator: FloatArray = entry("n_d k", "1", "B, temperature of the gauges per amplitude",
        place="thermal.gauge_operator")
    sensor_names: tuple[str, ...] = entry("n_t", "", "names of the sensors")
    sensor_operator: FloatArray = entry("n_t k", "1", "C, temperature of the sensors per amplitude",
        place="thermal.sensor_operator")
    sensor_std: FloatArray = entry("n_t", "K", "standard deviations of the sensors' errors",
        place="thermal.sensor_std", rule=POSITIVE)
    apparent_strain: FloatArray = entry("j", "1/K, 1/K^2 ..", "coefficients of p, of rise^1 to rise^j",
        place="thermal.apparent_strain")
    gauge_factor_slope: float = entry(unit="1/K", meaning="g", place="thermal.gauge_factor_slope")
    modulus_slope: float = entry(unit="1/K", meaning="m", place="thermal.modulus_slope")
    isothermal_covariance: FloatArray = entry("n_d n_d", "(m/m)^2", "the map's gauge_covariance without the modes",
        place="thermal.isothermal_covariance", rule=COVARIANCE)
    # fmt: on

    def __post_init__(self) -> None:
        check(self, "thermal", n_d=len(self.mode_strain), k=len(self.prior_std))
        for name in ("prior_std", "sensor_std"):
            if not np.all(getattr(self, name) > 0.0):
                raise InputError(f"thermal: {name} must be positive")

    @property
    def is_empty(self) -> bool:
        """Whether there are no modes and no sensors."""
        return not (self.n_modes or self.n_sensors)

    @property
    def linear_strain(self) -> FloatArray:
        """(n_d, k) what gauges read of each mode per amplitude, the data sheet's first term with it [(m/m)/K]."""
        first = self.apparent_strain[0] if len(self.apparent_strain) else 0.0
        return np.asarray(self.mode_strain + first * self.gauge_operator)

    @property
    def n_modes(self) -> int:
        """Number of temperature modes k."""
        return len(self.prior_std)

    @property
    def n_sensors(self) -> int:
        """Number of sensors n_t."""
        return len(self.sensor_names)


def no_temperature(gauge_covariance: FloatArray) -> ThermalMap:
    """Return no modes and no sensors, for gauges whose errors have ``gauge_covariance`` (n_d, n_d) [(m/m)^2]."""
    n_d = len(gauge_covariance)
    return ThermalMap(
        reference_temperature=0.0,
        prior_std=np.zeros(0),
        mode_strain=np.zeros((n_d, 0)),
        gauge_operator=np.zeros((n_d, 0)),
        sensor_names=(),
        sensor_operator=np.zeros((0, 0)),
        sensor_std=np.zeros(0),
        apparent_strain=np.zeros(0),
        gauge_factor_slope=0.0,
        modulus_slope=0.0,
        isothermal_covariance=gauge_covariance,
    )


def known_sensors(thermal: ThermalMap, temperature: FloatArray) -> BoolArray:
    """Return (k, n_t) which of ``temperature`` [K] are readings: above 0 and plausible."""
    return np.asarray((temperature > 0.0) & (np.abs(temperature - thermal.reference_temperature) <= LARGEST_RISE))
