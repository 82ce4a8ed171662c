"""Inertia of the vehicle at run time: its strain, subtracted from the readings as far as it is measured.

Material at r from the unit moves against a specific force f + dw/dt x r + w x (w x r), with the specific force f
of the unit (acceleration without gravity) and the angular rates w. Its inertia causes the strain Phi a of the
gauges. The amplitudes a are the channels of :func:`channels_of`: f, dw/dt about y and z, and the products
P = w w' - w'w 1 of w x (w x r) = P r. A priori they are independent with standard deviations s. Inertia modes are
modes of temperature, each with a sensor of its own (:mod:`strainfmu.estimator.map.temperature`):
:func:`with_inertia` joins both. Where nothing is measured, Phi diag(s^2) Phi' stays in the covariance of the
gauges. Modes of vibration have no sensors: the input ``vibration`` states their standard deviation, in steps of
the root of 2, instead of the map's.

In free flight strain per pressure has the inertia of the motion that the pressure causes: Phi of f and dw/dt is
then 0 for the masses of the model, and nothing counts twice.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import MEASURED_MOTION, NOT_KNOWN
from strainfmu.estimator.map.temperature import ThermalMap, known_sensors
from strainfmu.estimator.tables.schema import POSITIVE, check, described, entry

CHANNELS = ("f_x", "f_y", "f_z", "dw_y/dt", "dw_z/dt", "P_xx", "P_yy", "P_zz", "P_xy", "P_xz", "P_yz")
"""Names of the amplitudes for people; units m/s2, rad/s2, rad2/s2."""

SPECIFIC_FORCE = slice(0, 3)
"""Place of the specific force among the channels; own weight on the ground acts by it alone."""

LEAST_VIBRATION, MOST_VIBRATION, NO_VIBRATION = 0.0625, 1024.0, 1e-6
"""Vibration over its standard deviation in the map: what counts as none, and the largest; what stands for none."""

ROOT_2 = 1.4142135623730951

LARGEST_CHANNEL = 1e6
"""Size of a channel beyond which the unit is taken to be broken."""


@described
@dataclass(frozen=True, kw_only=True, eq=False)
class InertiaMap:
    """Inertia modes of a map for n_d gauges, one for each of the k :data:`CHANNELS`, and modes of vibration."""

    # fmt: off
    prior_std: FloatArray = entry("k", "m/s2, rad/s2, rad2/s2",
        "s, standard deviations of the channels where they are not measured")
    sensor_std: FloatArray = entry("k", "m/s2, rad/s2, rad2/s2",
        "standard deviations of the errors of measured channels")
    mode_strain: FloatArray = entry("n_d k", "(m/m)/(m/s2), (m/m)/(rad/s2), (m/m)/(rad2/s2)",
        "Phi, strain of the gauges per channel")
    rest_covariance: FloatArray = entry("n_d n_d", "(m/m)^2",
        "the map's gauge_covariance without modes of inertia, vibration and temperature")
    vibration_strain: FloatArray = entry("n_d v", "1",
        "strain of the gauges by each mode of vibration, over the strain of the gauge that it strains most")
    vibration_std: float = entry(unit="m/m", meaning="standard deviation of each mode where it is not known")
    vehicle_mass: float | None = entry(unit="kg",
        meaning="mass of the whole vehicle in flight, for :func:`contradicted_forces`; None where not stated",
        default=None, place="vehicle.mass", rule=POSITIVE, member="vehicle_mass")
    # fmt: on

    def __post_init__(self) -> None:
        check(self, "inertia", k=len(CHANNELS), n_d=len(self.mode_strain))
        if not self.vibration_std > 0.0:
            raise InputError(f"inertia: vibration_std is {self.vibration_std:g}, must be positive")
        if self.vehicle_mass is not None and not 0.0 < self.vehicle_mass < np.inf:
            raise InputError(f"inertia: vehicle_mass is {self.vehicle_mass:g}, must be positive")
        for name in ("prior_std", "sensor_std"):
            if not np.all(getattr(self, name) > 0.0):
                raise InputError(f"inertia: {name} must be positive")


LATERAL_FORCES = {"specific_force_y": 2, "specific_force_z": 1}
"""Place among the five loads of the force that causes each specific force across the axis."""

OTHER_FORCES = 0.5
"""Part of the larger force by which a fin or a jet may part the lateral force from the vehicle's mass times f."""


def contradicted_forces(
    inertia: InertiaMap | None,
    inertial: Mapping[str, FloatArray],
    loads: FloatArray,
    loads_std: FloatArray,
    limit: float,
) -> dict[str, BoolArray]:
    """Return (m,) whether each specific force across the axis contradicts the lateral force F of m samples.

    It does where F - m f is beyond ``limit`` by its variance, as chi-square with one degree of freedom, and beyond
    :data:`OTHER_FORCES`: m f in g instead of m/s2, for one. None of them without a mass of the vehicle.

    Parameters
    ----------
    inertial : inertial inputs (m,) by name, NaN or :data:`NOT_KNOWN` where not known.
    loads, loads_std : (m, 5) [N, N m].
    """
    if inertia is None or inertia.vehicle_mass is None:
        return {}
    mass, found = inertia.vehicle_mass, {}
    for (name, place), std in zip(LATERAL_FORCES.items(), inertia.sensor_std[1:3], strict=True):
        read = inertial[name]
        expected, force = mass * np.where(np.abs(read) <= LARGEST_CHANNEL, read, np.nan), loads[:, place]
        off = np.abs(force - expected)
        is_large = off > OTHER_FORCES * np.maximum(np.abs(force), np.abs(expected))
        beyond = off**2 > limit * ((mass * std) ** 2 + loads_std[:, place] ** 2)
        found[name] = is_large & beyond & (read != NOT_KNOWN)
    return found


def channels_of(values: Mapping[str, FloatArray]) -> FloatArray:
    """Return the channels (m, k) of m samples of the inertial inputs by name, NaN where not known."""
    known = [
        np.where(values[name] == NOT_KNOWN, np.nan, values[name]) for name in (one.name for one in MEASURED_MOTION)
    ]
    force, (x, y, z), turn = known[:3], known[3:6], known[6:]
    products = (-(y * y + z * z), -(x * x + z * z), -(x * x + y * y), x * y, x * z, y * z)
    return np.stack([*force, *turn, *products], axis=1)


def known_channels(channels: FloatArray) -> BoolArray:
    """Return (m, k) which of ``channels`` (m, k) are measured: finite and plausible."""
    return np.asarray(np.abs(channels) <= LARGEST_CHANNEL)


def with_inertia(thermal: ThermalMap, inertia: InertiaMap | None) -> ThermalMap:
    """Return ``thermal`` with the modes of ``inertia`` behind its own, and the channels behind its sensors.

    Its sensors read channels above the reference temperature. The gauges are no warmer by the modes. Modes of
    vibration are the last; nothing measures them.
    """
    if inertia is None:
        return thermal
    k, n_t, n, v = len(CHANNELS), thermal.n_sensors, thermal.n_modes, inertia.vibration_strain.shape[1]
    of_both = np.zeros((n_t + k, n + k + v))
    of_both[:n_t, :n] = thermal.sensor_operator
    of_both[n_t:, n : n + k] = np.eye(k)
    strain = np.hstack([inertia.mode_strain, inertia.vibration_strain])
    return ThermalMap(
        reference_temperature=thermal.reference_temperature,
        prior_std=np.concatenate([thermal.prior_std, inertia.prior_std, np.full(v, inertia.vibration_std)]),
        mode_strain=np.hstack([thermal.mode_strain, strain]),
        gauge_operator=np.hstack([thermal.gauge_operator, np.zeros_like(strain)]),
        sensor_names=(*thermal.sensor_names, *CHANNELS),
        sensor_operator=of_both,
        sensor_std=np.append(thermal.sensor_std, inertia.sensor_std),
        apparent_strain=thermal.apparent_strain,
        gauge_factor_slope=thermal.gauge_factor_slope,
        modulus_slope=thermal.modulus_slope,
        isothermal_covariance=inertia.rest_covariance,
    )


def readings_of_modes(
    thermal: ThermalMap,
    inertia: InertiaMap | None,
    temperature: FloatArray,
    inertial: Mapping[str, FloatArray],
) -> tuple[FloatArray, BoolArray]:
    """Return readings (m, n_t + k) of :func:`with_inertia` of m samples, and which of them are known.

    ``temperature`` is (m, n_t) [K], ``inertial`` holds (m,) of each inertial input.
    """
    known = known_sensors(thermal, temperature)
    if inertia is None:
        return temperature, known
    channels = channels_of(inertial)
    read = np.hstack([temperature, thermal.reference_temperature + channels])
    return read, np.hstack([known, known_channels(channels)])


def vibration_ratio(inertia: InertiaMap | None, vibration: FloatArray) -> FloatArray:
    """Return (m,) the ``vibration`` (m,) [m/m] over the vibration of the map, as the covariance takes it.

    NaN where it is not known. It is the next larger power of the root of 2: matrices stay while the vibration
    changes little.
    """
    if inertia is None:
        return np.full(len(vibration), np.nan)
    known = np.isfinite(vibration) & (vibration >= 0.0)
    ratio = np.where(known, vibration, 0.0) / inertia.vibration_std
    steps, step = [NO_VIBRATION], LEAST_VIBRATION
    while step <= MOST_VIBRATION:
        steps += [step * ROOT_2, 2.0 * step]
        step *= 2.0
    found = np.array(steps)[np.searchsorted([LEAST_VIBRATION, *steps[1:-1]], np.minimum(ratio, MOST_VIBRATION))]
    return np.where(known, found, np.nan)


def with_vibration(modes: ThermalMap, inertia: InertiaMap | None, ratio: float) -> ThermalMap:
    """Return the ``modes`` of :func:`with_inertia` whose vibration is ``ratio`` of the map's; NaN: as it is."""
    if inertia is None or np.isnan(ratio):
        return modes
    first = modes.n_modes - inertia.vibration_strain.shape[1]
    scale = np.where(np.arange(modes.n_modes) < first, 1.0, ratio)
    return replace(modes, prior_std=modes.prior_std * scale)
