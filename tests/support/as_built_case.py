"""The shipped vehicle on a coarse mesh, solved for what may differ as built, once per run."""

import numpy as np
import pytest

from builder.calibration.ground_test.structure_of_test import structure_of_test
from builder.structure.as_built.as_built_structure import AsBuiltStructure, as_built_structure
from builder.structure.as_built.as_built_vehicle import (
    AsBuilt,
    of_gauges,
    parameter_derivatives,
    slices,
    uncertain_keys,
)
from builder.structure.loads.loaded_structure import LoadProperties
from builder.vehicle.file import Vehicle

TITANIUM = LoadProperties(density=4430.0)
LAYOUT = "configuration_2"


@pytest.fixture(scope="session")
def as_built(vehicle: Vehicle) -> AsBuiltStructure:
    return as_built_structure(vehicle, LAYOUT, properties=TITANIUM, max_harmonic=12)


@pytest.fixture(scope="session")
def tested(vehicle: Vehicle) -> AsBuiltStructure:
    """With all that a ground test may show."""
    return structure_of_test(vehicle, TITANIUM, 12)


def strain_covariances(
    structure: AsBuiltStructure, parameters: AsBuilt, covariance: np.ndarray, pressure: np.ndarray
) -> np.ndarray:
    """J C J' (n, n_d, n_d) under each of the fields (n, n_p), J by differences of every single parameter."""
    n_d = structure.n_gauges
    jacobian = np.zeros((len(pressure), n_d, len(covariance)))
    where, std = slices(structure.counts), parameters.of_vector(np.sqrt(np.diag(covariance)))
    for (kind, region), slope in parameter_derivatives(
        lambda vehicle: structure.strain_operator(vehicle) @ pressure.T, parameters, uncertain_keys(std)
    ).items():
        start = where[kind].start
        if of_gauges((kind, region)):
            jacobian[:, np.arange(n_d), start + np.arange(n_d)] = slope.T
        else:
            jacobian[:, :, start + region] = slope.T
    return np.asarray(jacobian @ covariance @ jacobian.transpose(0, 2, 1))
