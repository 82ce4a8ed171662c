"""The classical way: loads as sums of bridge readings, by regression on the load cases of the same test.

Gauges are chosen by their T values: :mod:`builder.calibration.estimate.regression`.
"""

from __future__ import annotations

import numpy as np

from builder.calibration.estimate.estimated_vehicle import Estimate
from builder.calibration.estimate.readings_model import ReadingsModel
from builder.calibration.estimate.regression import LoadEquation, load_equation
from builder.calibration.ground_test.load_changes import scaled
from builder.structure.as_built.as_built_structure import OF_MASS
from builder.structure.loads.applied import Load
from builder.structure.loads.gauge_strain import load_resultant
from builder.structure.loads.temperature import TemperatureField
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import LOAD_NAMES


def load_equations(fit: Estimate, moment_station: float) -> list[LoadEquation]:
    """Return the equation of each load from the cases that were used; zeros are taken off.

    The loads are the forces and moments of what was applied, weight included, about ``moment_station`` [m].
    """
    model, used = fit.model, fit.used
    good = np.asarray(used.any(axis=0))
    rows = np.asarray(used[:, good].all(axis=1))
    errors = model.errors(fit.vector)
    group = [model.groups.index(case.group) for case in model.test.cases]
    strain = (model.test.readings - errors.zero[group])[rows]
    loads = applied_loads(model, moment_station, float(fit.parameters.mass[0]))[rows]
    gauges = np.flatnonzero(good).tolist()
    return [load_equation(name, strain, loads[:, k], gauges, "selected") for k, name in enumerate(LOAD_NAMES)]


def applied_loads(model: ReadingsModel, moment_station: float, mass: float = 0.0) -> FloatArray:
    """Return the five loads (n_cases, 5) of every case as stated [N, N m]; ``mass`` is the vehicle's error [1]."""
    structure = model.structure.loaded
    resultant = np.zeros((len(model.test.cases), 5))
    for k, case in enumerate(model.test.cases):
        acting: list[Load] = [
            scaled(known.load, 1.0 + mass) if isinstance(known.load, OF_MASS) else known.load
            for known in case.loads
            if not isinstance(known.load, TemperatureField)
        ]
        x, y, z, _, about_y, about_z = load_resultant(structure, acting)
        nose_up, nose_port = about_y + moment_station * z, about_z - moment_station * y
        resultant[k] = x, z, y, nose_up, -nose_port
    return resultant
