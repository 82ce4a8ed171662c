"""The map of a vehicle as built: its strain operator, and what the test left unknown as errors of the map."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from builder.calibration.after_test.left_by_test import LeftByTest, Remaining, left_by_test
from builder.calibration.estimate.estimated_vehicle import Estimate
from builder.calibration.ground_test.load_test import REPLACED
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.ensemble import ensemble_of
from builder.inverse.problem import inverse_problem, on_structure
from builder.manifold.nonlinear_build import with_manifold
from builder.structure.as_built.as_built_vehicle import GAUGE_KINDS, AsBuilt, slices
from builder.structure.as_built.displaced_structure import AnyAsBuilt, DisplacedStructure
from builder.structure.as_built_kinds import AS_BUILT
from builder.structure.fourier.fourier_model import StructuralModel
from builder.structure.mapped_structure import MappedStructure
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.signal_names import ZERO

CALIBRATED = tuple(dict.fromkeys(kind.entry for kind in AS_BUILT if "noise" in kind.sections))
"""Entries of [noise] that the test takes the place of."""


def remaining_after(fit: Estimate) -> Remaining:
    """Return what a test left of the vehicle; gauges that changed since are as before it."""
    model, n = fit.model, fit.model.n_built
    vector, covariance = fit.vector[:n].copy(), fit.covariance[:n, :n].copy()
    where = slices(model.structure.counts)
    for name, change in model.test.changed.items():
        gauge = model.structure.gauges.names.index(name)
        entries = np.array(
            [where[kind].start + gauge for kind in (GAUGE_KINDS if change == REPLACED else (ZERO,))]
        )
        vector[entries] = covariance[entries] = covariance[:, entries] = 0.0
        covariance[entries, entries] = model.std[entries] ** 2
    return Remaining(parameters=model.prior.of_vector(vector), covariance=covariance)


def calibrated_structure(
    structure: AnyAsBuilt, parameters: AsBuilt, layout: str, other_layouts: Mapping[str, FloatArray]
) -> MappedStructure:
    """Return the structure that maps are built on; ``others`` are operators of other layouts, as drawn."""
    if isinstance(structure, DisplacedStructure):
        mapped = structure.mapped
        return replace(
            mapped,
            description=f"{mapped.description}, calibrated",
            operators={**mapped.operators, layout: structure.strain_operator(parameters)},
        )
    return MappedStructure(
        surface=structure.surface,
        description="fourier, calibrated",
        layouts={layout: structure.gauges},
        operators={**other_layouts, layout: structure.strain_operator(parameters)},
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
    structure: AnyAsBuilt,
    remaining: Remaining,
    other_layouts: Mapping[str, FloatArray] | None = None,
    remainder: LeftByTest | None = None,
) -> InverseMap:
    """Build the map of the vehicle as built by the section [map], with tables where it asks for them.

    Parameters
    ----------
    vehicle : the vehicle file.
    snapshots : surface pressure at the flight conditions.
    structure : with what may differ from the drawing.
    remaining : what the test says.
    other_layouts : operators (n_d, n_p) of other layouts that the section [noise] names.
    remainder : what the test left; found here by default.

    Raises
    ------
    InputError
        As :func:`builder.inverse.build.build_inverse_map`.
    """
    known = calibrated_vehicle(vehicle)
    mapped = calibrated_structure(structure, remaining.parameters, vehicle.gauges.layout, other_layouts or {})
    snapshots = on_structure(snapshots, mapped)
    if remainder is None:
        remainder = left_by_test(structure, remaining, ensemble_of(known, snapshots))
    problem = inverse_problem(known, snapshots, mapped, remainder.zeros, remainder.errors)
    if vehicle.map.estimator == "nonlinear":
        return with_manifold(None, known, snapshots, mapped, remainder.zeros, problem)
    return build_inverse_map(known, snapshots, mapped, remainder.zeros, problem)


def with_provenance(inverse_map: InverseMap, facts: Mapping[str, Any]) -> InverseMap:
    """Return ``inverse_map`` with ``facts`` of its calibration."""
    return replace(inverse_map, provenance={**inverse_map.provenance, "calibration": dict(facts)})
