"""From snapshots and strain per pressure to the finished inverse map."""

from __future__ import annotations

from math import degrees

import numpy as np
from numpy.typing import NDArray

from builder.aero.loads import coefficient_scale, load_operator
from builder.inversion import least_squares_map
from builder.reduction import proper_orthogonal_decomposition
from builder.snapshot_transfer import snapshots_on
from builder.snapshots import Snapshots
from builder.structural_model import StructuralModel
from builder.uncertainty import load_covariance
from builder.vehicle import Vehicle
from strainfmu import __version__
from strainfmu.errors import InputError
from strainfmu.inverse_map import InverseMap

FloatArray = NDArray[np.float64]


def gauge_noise_std(vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel) -> float:
    """Return sigma [m/m], one for all gauges.

    Absolute, or a share of the median |strain| over the snapshots and the gauges of ``noise.of_layout``.
    """
    if vehicle.noise.std_um_per_m is not None:
        return 1e-6 * vehicle.noise.std_um_per_m
    assert vehicle.noise.percent_of_median_strain is not None
    layout = vehicle.noise.of_layout or vehicle.gauges.layout
    strain = (snapshots.pressure - internal_pressure(vehicle, snapshots)) @ structure.strain_operator(layout).T
    return float(0.01 * vehicle.noise.percent_of_median_strain * np.median(np.abs(strain)))


def internal_pressure(vehicle: Vehicle, snapshots: Snapshots) -> float:
    """Return p_internal [Pa] of all snapshots.

    Raises
    ------
    InputError
        The snapshots' altitudes differ and so does the pressure inside.
    """
    inside = [vehicle.internal_pressure(condition) for condition in snapshots.conditions()]
    if min(inside) != max(inside):
        raise InputError(
            f"snapshots: internal pressures {min(inside):.6g} to {max(inside):.6g} Pa found, one is needed: give "
            "one altitude, or structure.internal_pressure_Pa as a number"
        )
    return inside[0]


def build_inverse_map(vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel) -> InverseMap:
    """Build the map of Case 1 for the layout in use.

    Raises
    ------
    InputError
        The gauges cannot identify the modes asked for, or the snapshots' surface is not the structure's.
    """
    snapshots = snapshots_on(snapshots, structure.surface)
    layout = vehicle.gauges.layout
    z_p = structure.strain_operator(layout)
    inside = internal_pressure(vehicle, snapshots)
    reference = vehicle.reference_quantities()
    loads = load_operator(structure.surface, reference.moment_station)
    sigma = gauge_noise_std(vehicle, snapshots, structure)
    noise_std = np.full(len(z_p), sigma)
    modes = proper_orthogonal_decomposition(snapshots.pressure)
    n_modes = vehicle.map.modes
    solved = least_squares_map(z_p, modes, n_modes, noise_std, inside)
    coefficients = snapshot_coefficients(vehicle, snapshots, loads)
    gauges = structure.layouts[layout]
    conditions = snapshots.conditions()
    return InverseMap(
        vehicle=vehicle.name,
        gauge_names=gauges.names,
        gauge_position=gauges.position,
        gauge_direction=gauges.direction / np.linalg.norm(gauges.direction, axis=1, keepdims=True),
        noise_std=noise_std,
        strain_gain=solved.strain_gain,
        state_offset=solved.state_offset,
        load_per_state=loads @ modes.modes[:, :n_modes],
        load_of_mean=loads @ (modes.mean - inside),
        load_covariance=load_covariance(solved, modes, loads, noise_std),
        mean_strain=solved.mean_strain,
        residual_whitening=solved.residual_whitening,
        residual_degrees_of_freedom=len(z_p) - n_modes,
        strain_range=np.abs((snapshots.pressure - inside) @ z_p.T).max(axis=0),
        coefficient_range=np.column_stack([coefficients.min(axis=0), coefficients.max(axis=0)]),
        reference_area=reference.area,
        reference_length=reference.length,
        nominal_dynamic_pressure=float(np.mean([c.dynamic_pressure for c in conditions])),
        provenance={
            "strainfmu_version": __version__,
            "layout": layout,
            "snapshots": len(conditions),
            "flows_solved": int(snapshots.solved.sum()),
            "modes": n_modes,
            "energy_of_modes": float(modes.energy[n_modes - 1]),
            "condition_number": solved.condition_number,
            "internal_pressure_Pa": inside,
            "mach_number": _range([c.mach_number for c in conditions]),
            "angle_of_attack_deg": _range([degrees(c.angle_of_attack) for c in conditions]),
            "sideslip_angle_deg": _range([degrees(c.sideslip_angle) for c in conditions]),
            "altitude_m": conditions[0].altitude,
            "moment_station_m": reference.moment_station,
            "resolution": vehicle.resolution.map.model_dump(),
        },
    )


def snapshot_coefficients(vehicle: Vehicle, snapshots: Snapshots, loads: FloatArray) -> FloatArray:
    """Return (N, 5) coefficients of the snapshots; ``loads`` is the load operator (5, n_p)."""
    reference = vehicle.reference_quantities()
    net = snapshots.pressure - internal_pressure(vehicle, snapshots)
    scale = [coefficient_scale(c.dynamic_pressure, reference) for c in snapshots.conditions()]
    return net @ loads.T * np.array(scale)


def _range(values: list[float]) -> list[float]:
    return [min(values), max(values)]
