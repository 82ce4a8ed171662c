"""Auxiliary sensors of the vehicle that flies, of a body of revolution: readings by harmonics of the pressure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.sensors import STRAIN, SensorRows
from strainfmu.flight_condition import FlightCondition


@dataclass(frozen=True, eq=False, kw_only=True)
class BuiltSensors:
    """The n_s sensors of one vehicle, with the errors of its hardware.

    Attributes
    ----------
    names, kind, unit : of the readings.
    response : (n_s, n_m, n_x, 2) reading per harmonic m of the pressure at a station, as cos and sin of m times
        the roll angle from the pressure's crest to roll angle 0 [unit/Pa].
    per_ambient, per_dynamic : (n_s,) what each reads besides, per p_inf and q_inf: base pressure, friction, an
        error of the pressure inside [unit/Pa].
    offset : (n_s,) reading without load [unit].
    std, largest : (n_s,) standard deviation of the noise, and largest reading [unit].
    thrust_response : (n_s,) [unit/N].
    """

    names: tuple[str, ...]
    kind: tuple[str, ...]
    unit: tuple[str, ...]
    response: FloatArray
    per_ambient: FloatArray
    per_dynamic: FloatArray
    offset: FloatArray
    std: FloatArray
    largest: FloatArray
    thrust_response: FloatArray

    @property
    def of_uniform(self) -> FloatArray:
        """(n_s,) reading per uniform pressure outside [unit/Pa]."""
        return np.asarray(self.response[:, 0, :, 0].sum(axis=1))

    def rows(self, n_gauges: int, noise_std: float) -> SensorRows:
        """Return what the rows of a plant read: ``n_gauges`` gauges of noise ``noise_std`` [m/m], then these."""
        ones = np.ones(n_gauges)
        return SensorRows(
            kind=(*(STRAIN,) * n_gauges, *self.kind),
            unit=(*("m/m",) * n_gauges, *self.unit),
            scale=np.concatenate([ones, self.std / noise_std]),
            largest=np.concatenate([ones, self.largest]),
            thrust_response=np.concatenate([0.0 * ones, self.thrust_response]),
        )


def sensor_response(operator: FloatArray, surface: SurfaceGrid, max_harmonic: int) -> FloatArray:
    """Return the response of :class:`BuiltSensors` from readings per nodal pressure, (n_s, n_p) [unit/Pa]."""
    m = np.arange(max_harmonic + 1)
    by_node = operator.reshape(len(operator), len(surface.x), surface.n_roll)
    phase = np.outer(surface.roll_angle, m)
    # A pressure cos m (phi - phi_T) is seen from roll angle 0, where the angle to the crest is -phi_T.
    even, odd = by_node @ np.cos(phase), -(by_node @ np.sin(phase))
    return np.stack([even, odd], axis=-1).transpose(0, 2, 1, 3)


def sensor_readings(
    sensors: BuiltSensors, harmonic: FloatArray, conditions: Sequence[FlightCondition]
) -> FloatArray:
    """Return (k, n_s) readings, without noise, where the inside is at p_inf.

    ``harmonic`` (k, n_x, n_m) are amplitudes of cos(m phi) in p / p_inf, as of the flights of the gauges.
    """
    roll = np.array([one.leeward_roll_angle for one in conditions])
    ambient = np.array([one.ambient_pressure for one in conditions])[:, None]
    dynamic = np.array([one.dynamic_pressure for one in conditions])[:, None]
    phase = -np.outer(roll, np.arange(harmonic.shape[2]))
    by_harmonic = np.einsum("smxp,kxm->ksmp", sensors.response[:, : harmonic.shape[2]], harmonic, optimize=True)
    of_flow = np.einsum("ksm,km->ks", by_harmonic[..., 0], np.cos(phase))
    of_flow += np.einsum("ksm,km->ks", by_harmonic[..., 1], np.sin(phase))
    net = of_flow - sensors.of_uniform + sensors.per_ambient
    return np.asarray(ambient * net + dynamic * sensors.per_dynamic + sensors.offset)
