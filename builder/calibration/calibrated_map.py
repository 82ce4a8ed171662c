"""The map of a vehicle as built: its strain operator, and what the test left unknown as a term of the noise.

The remaining error of the hardware is mean_j J_j C J_j' over the pressure fields j of the map, with C the
covariance of the parameters after the test: a full matrix, correlated between gauges.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from builder.calibration.as_built_parameters import AsBuiltParameters, slices
from builder.calibration.as_built_structure import AsBuiltStructure
from builder.calibration.estimate import Estimate
from builder.calibration.parameter_derivatives import Key, of_gauges, parameter_derivatives
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map, inverse_problem, on_structure
from builder.inverse.ensemble import Ensemble, ensemble_of, rolled_modes
from builder.inverse.noise_model import NoiseTerm
from builder.inverse.pod import proper_orthogonal_decomposition
from builder.manifold.build import with_manifold
from builder.structure.fourier.model import StructuralModel
from builder.structure.mapped_structure import MappedStructure
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.estimator.inverse_map import InverseMap

CALIBRATED = (
    "gauge_gain_percent",
    "common_gain_percent",
    "gauge_position_mm",
    "gauge_orientation_deg",
    "layout_roll_deg",
    "wall_thickness_percent",
)
"""Entries of [noise] that the test takes the place of."""

NEGLIGIBLE = 1e-12
"""Variance relative to the largest below which a column of the remaining error is left out."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Remaining:
    """What of the hardware is not known.

    Attributes
    ----------
    parameters : the vehicle as built.
    covariance : (n, n) of its vector.
    """

    parameters: AsBuiltParameters
    covariance: FloatArray


def remaining_after(found: Estimate) -> Remaining:
    """Return what a test left of the vehicle."""
    n = found.model.n_built
    return Remaining(parameters=found.parameters, covariance=found.covariance[:n, :n])


def calibrated_structure(
    structure: AsBuiltStructure, parameters: AsBuiltParameters, layout: str, others: Mapping[str, FloatArray]
) -> MappedStructure:
    """Return the structure that maps are built on; ``others`` are operators of further layouts, as drawn."""
    return MappedStructure(
        surface=structure.surface,
        description="fourier, calibrated",
        layouts={layout: structure.gauges},
        operators={**others, layout: structure.strain_operator(parameters)},
        error_operators={} if structure.mesh_error is None else {layout: structure.mesh_error},
        checked_against=StructuralModel.checked_against,
    )


def calibrated_vehicle(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle without the errors that the test takes the place of."""
    noise = vehicle.noise.model_copy(update=dict.fromkeys(CALIBRATED, 0.0))
    return vehicle.model_copy(update={"noise": noise})


def calibrated_map(
    vehicle: Vehicle,
    snapshots: Snapshots,
    structure: AsBuiltStructure,
    remaining: Remaining,
    others: Mapping[str, FloatArray] | None = None,
    terms: list[NoiseTerm] | None = None,
) -> InverseMap:
    """Build the map of the vehicle as built by the section [map], with tables where it asks for them.

    Parameters
    ----------
    vehicle : the vehicle file.
    snapshots : surface pressure at the flight conditions.
    structure : with what may differ from the drawing.
    remaining : what the test says.
    others : operators (n_d, n_p) of further layouts that the section [noise] names.
    terms : noise of what the test left, by :func:`remaining_terms`; found here by default.

    Raises
    ------
    InputError
        As :func:`builder.inverse.build.build_inverse_map`.
    """
    known = calibrated_vehicle(vehicle)
    mapped = calibrated_structure(structure, remaining.parameters, vehicle.gauges.layout, others or {})
    snapshots = on_structure(snapshots, mapped)
    if terms is None:
        terms = remaining_terms(structure, remaining, ensemble_of(known, snapshots))
    problem = inverse_problem(known, snapshots, mapped, terms)
    found = build_inverse_map(known, snapshots, mapped, terms, problem)
    if vehicle.map.estimator == "manifold":
        found = with_manifold(found, known, snapshots, mapped, terms, problem)
    return found


def remaining_terms(structure: AsBuiltStructure, remaining: Remaining, ensemble: Ensemble) -> list[NoiseTerm]:
    """Return the noise terms of what the test left: of the hardware, which follows strain, and of the zeros.

    There are none where everything is known.
    """
    if not remaining.covariance.any():
        return []
    where = slices(structure.n_gauges, structure.n_regions)
    zero = remaining.covariance[where["zero"], where["zero"]]
    hardware = hardware_covariance(structure, remaining, pressure_factor(ensemble))
    return [
        NoiseTerm("left by the ground test", _factor(hardware), scales=True, hardware=True),
        NoiseTerm("zeros after the ground test", _factor(zero), hardware=True),
    ]


def pressure_factor(ensemble: Ensemble) -> FloatArray:
    """Return F (n_p, k) whose F F' is the mean of p p' over the flows at all roll angles [Pa^2]."""
    if ensemble.grid is None:
        modes = proper_orthogonal_decomposition(ensemble.pressure, None)
    else:
        modes = rolled_modes(ensemble, None)
    return np.column_stack([modes.mean - ensemble.fixed_pressure, modes.modes * modes.coefficient_std()])


def hardware_covariance(structure: AsBuiltStructure, remaining: Remaining, pressure: FloatArray) -> FloatArray:
    """Return (n_d, n_d) the mean of J C J' over pressure fields whose factor is ``pressure`` (n_p, k) [1]."""
    strain = parameter_derivatives(lambda one: structure.strain_operator(one) @ pressure, remaining.parameters)
    return propagated(strain, remaining.covariance, structure)


def propagated(
    strain: Mapping[Key, FloatArray], covariance: FloatArray, structure: AsBuiltStructure
) -> FloatArray:
    """Return (n_d, n_d) sums of J C J' of derivatives (n_d, k) by key, over the k fields."""
    n_d = structure.n_gauges
    where = slices(n_d, structure.n_regions)

    def rows(key: Key) -> slice:
        first = where[key[0]].start
        return slice(first, first + n_d) if of_gauges(key) else slice(first + key[1], first + key[1] + 1)

    total = np.zeros((n_d, n_d))
    for one, left in strain.items():
        for other, right in strain.items():
            # A parameter of the whole vehicle is the same one for every gauge: its block is one number.
            total += (left @ right.T) * covariance[rows(one), rows(other)]
    return np.asarray(0.5 * (total + total.T))


def _factor(covariance: FloatArray) -> FloatArray:
    value, vector = np.linalg.eigh(covariance)
    kept = value > NEGLIGIBLE * max(float(value[-1]), 0.0)
    if not kept.any():
        return np.zeros((len(covariance), 1))
    return np.asarray(vector[:, kept] * np.sqrt(value[kept]))


def with_provenance(inverse_map: InverseMap, facts: Mapping[str, Any]) -> InverseMap:
    """Return ``inverse_map`` with ``facts`` of its calibration."""
    return replace(inverse_map, provenance={**inverse_map.provenance, "calibration": dict(facts)})
