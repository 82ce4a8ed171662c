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

LARGEST_RISE = 2000.0
"""|rise| above the reference [K] beyond which a sensor is taken to be broken."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ThermalMap:
    """Temperature modes of a map for n_d gauges, k modes and n_t sensors.

    Attributes
    ----------
    reference_temperature : at which zeros, gauge factors and modulus hold [K].
    prior_std : (k,) s, standard deviation of each mode's amplitude [K].
    mode_strain : (n_d, k) Phi, what gauges read of each mode per amplitude [(m/m)/K].
    gauge_operator : (n_d, k) B, temperature of the gauges per amplitude [1].
    sensor_names : n_t names.
    sensor_operator : (n_t, k) C, temperature of the sensors per amplitude [1].
    sensor_std : (n_t,) standard deviations of the sensors' errors [K].
    apparent_strain : (j,) coefficients of p, of rise^1 to rise^j [(m/m)/K^j].
    gauge_factor_slope : g [1/K].
    modulus_slope : m [1/K].
    isothermal_covariance : (n_d, n_d) the map's gauge_covariance without the modes [(m/m)^2].
    """

    reference_temperature: float
    prior_std: FloatArray
    mode_strain: FloatArray
    gauge_operator: FloatArray
    sensor_names: tuple[str, ...]
    sensor_operator: FloatArray
    sensor_std: FloatArray
    apparent_strain: FloatArray
    gauge_factor_slope: float
    modulus_slope: float
    isothermal_covariance: FloatArray

    def __post_init__(self) -> None:
        k, n_d, n_t = len(self.prior_std), len(self.mode_strain), len(self.sensor_names)
        shapes = {
            "mode_strain": (n_d, k),
            "gauge_operator": (n_d, k),
            "sensor_operator": (n_t, k),
            "sensor_std": (n_t,),
            "isothermal_covariance": (n_d, n_d),
        }
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value.shape != shape or not np.all(np.isfinite(value)):
                raise InputError(f"thermal {name}: expected finite values of shape {shape}, got {value.shape}")
        for name in ("prior_std", "sensor_std"):
            if not np.all(getattr(self, name) > 0.0):
                raise InputError(f"thermal {name}: expected positive values")

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


UNITS = {
    "reference_temperature": "K",
    "prior_std": "K",
    "mode_strain": "1/K",
    "sensor_std": "K",
    "apparent_strain": "1/K, 1/K^2 ..",
    "gauge_factor_slope": "1/K",
    "modulus_slope": "1/K",
}


def known_sensors(thermal: ThermalMap, temperature: FloatArray) -> BoolArray:
    """Return (k, n_t) which of ``temperature`` [K] are readings: above 0 and plausible."""
    return np.asarray((temperature > 0.0) & (np.abs(temperature - thermal.reference_temperature) <= LARGEST_RISE))
