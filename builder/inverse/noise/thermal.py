"""Temperature modes of a vehicle: thermal strain of its gauges, and what its sensors see of them."""

from dataclasses import replace

import numpy as np

from builder.inverse.noise.model import NoiseTerm, nuisance_modes
from builder.structure.loads.fourier import FourierStructure
from builder.structure.loads.gauge_strain import gauge_strain, gauge_temperature
from builder.structure.loads.of_vehicle import fourier_structure_of
from builder.structure.loads.temperature import TemperatureField, temperature_mode
from builder.vehicle.file import Vehicle
from builder.vehicle.structure_section import Temperature
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.sensors import ThermalMap
from strainfmu.estimator.signal_names import TEMPERATURE

NAME = TEMPERATURE
"""Name of the modes' noise term."""

_STATIONS = 5
HARMONICS = 2
"""Highest harmonic in roll angle of the modes."""
_MICRO, _PER_100K, _CELSIUS = 1e-6, 1e-4, 273.15


def thermal_modes(entry: Temperature, length: float) -> list[tuple[TemperatureField, float]]:
    """Return the modes of a body of ``length`` [m] at an amplitude of 1 K, and their standard deviations [K]."""
    stations = np.array(entry.stations_m) if entry.stations_m else np.linspace(0.0, length, _STATIONS)
    kinds = (
        (entry.rise_K, 0, False),
        (entry.through_wall_K, 0, True),
        (entry.side_K, 1, False),
        (entry.through_wall_side_K, 1, True),
        (entry.second_harmonic_K, 2, False),
    )
    modes = []
    for std, harmonic, through in kinds:
        crests = (0.0,) if harmonic == 0 else (0.0, 0.5 * np.pi / harmonic)
        for crest in crests if std > 0.0 else ():
            for hat in np.eye(len(stations)):
                middle, rise = (np.zeros_like(hat), hat) if through else (hat, None)
                modes.append((temperature_mode(stations, middle, harmonic, crest, rise), std))
    return modes


def thermal_map(vehicle: Vehicle, structure: FourierStructure | None = None) -> ThermalMap | None:
    """Return the modes of the layout in use, with a unit covariance that the map replaces.

    None without a section [temperature].

    Raises
    ------
    InputError
        The Fourier model cannot do the vehicle.
    """
    entry = vehicle.temperature
    if entry is None:
        return None
    if structure is None:
        structure = fourier_structure_of(vehicle, vehicle.gauges.layout, max_harmonic=HARMONICS)
    modes = thermal_modes(entry, vehicle.body().length)
    strain = np.column_stack([gauge_strain(structure, [mode]) for mode, _ in modes])
    x = np.array([sensor.x_m for sensor in entry.sensor])
    roll = np.radians([sensor.roll_angle_deg for sensor in entry.sensor])
    depth = np.array([float(sensor.surface == "outer") for sensor in entry.sensor])
    n_d = len(strain)
    return ThermalMap(
        reference_temperature=entry.reference_degC + _CELSIUS,
        prior_std=np.array([std for _, std in modes]),
        mode_strain=strain,
        gauge_operator=np.column_stack([gauge_temperature(structure, mode) for mode, _ in modes]),
        sensor_names=tuple(sensor.name for sensor in entry.sensor),
        sensor_operator=np.column_stack([mode.at(x, roll, depth) for mode, _ in modes]),
        sensor_std=np.array([sensor.std_K for sensor in entry.sensor]),
        apparent_strain=_MICRO * np.array(entry.apparent_strain_um_per_m, dtype=float),
        gauge_factor_slope=_PER_100K * entry.gauge_factor_percent_per_100K,
        modulus_slope=_PER_100K * entry.modulus_percent_per_100K,
        isothermal_covariance=np.eye(n_d),
    )


def thermal_terms(entry: Temperature | None, thermal: ThermalMap | None) -> list[NoiseTerm]:
    """Return what temperature adds to the noise: the modes, and the scatter of the gauges' own response.

    The mean response of the lot joins the modes: without sensors it is not known either.
    """
    if entry is None or thermal is None:
        return []
    terms = [nuisance_modes(NAME, thermal.linear_strain, thermal.prior_std)]
    scatter = _MICRO * entry.apparent_strain_scatter_um_per_m_per_K * gauge_rise(thermal)
    if scatter.any():
        terms.append(nuisance_modes("apparent strain with temperature", np.diag(scatter), np.ones(len(scatter))))
    return terms


def gauge_rise(thermal: ThermalMap) -> FloatArray:
    """Return (n_d,) the standard deviation of the gauges' temperature by the prior [K]."""
    return np.asarray(np.sqrt(np.sum((thermal.gauge_operator * thermal.prior_std) ** 2, axis=1)))


def modulus_std(thermal: ThermalMap | None) -> float:
    """Return the relative standard deviation of the modulus by the prior of the temperature, the same all over."""
    return 0.0 if thermal is None else abs(thermal.modulus_slope) * float(np.median(gauge_rise(thermal)))


def with_sensor_rows(thermal: ThermalMap | None, n_rows: int) -> ThermalMap | None:
    """Return ``thermal`` with ``n_rows`` rows behind the gauges, of sensors whose readings it does not move."""
    if thermal is None:
        return None
    below = ((0, n_rows), (0, 0))
    return replace(
        thermal,
        mode_strain=np.pad(thermal.mode_strain, below),
        gauge_operator=np.pad(thermal.gauge_operator, below),
        isothermal_covariance=np.eye(len(thermal.mode_strain) + n_rows),
    )
