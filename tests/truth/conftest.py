"""The independent model of the shipped vehicle at a coarse resolution."""

from __future__ import annotations

import numpy as np
import pytest

from builder.aero.engine import Flow, FlowKey
from builder.truth.flow_table import FlowTable, flow_table
from builder.truth.flows import truth_knots
from builder.truth.strain import TrueStructure, true_structure
from builder.vehicle.file import Vehicle


@pytest.fixture(scope="session")
def true_model(vehicle: Vehicle) -> TrueStructure:
    return true_structure(vehicle)


@pytest.fixture(scope="session")
def table(vehicle: Vehicle, true_model: TrueStructure, truth_flows: dict[FlowKey, Flow]) -> FlowTable:
    mach, incidence = truth_knots(vehicle)
    return flow_table(
        vehicle=vehicle.name,
        mach=mach,
        incidence=np.array(incidence[1:]),
        flows=truth_flows,
        surface=true_model.surface,
        max_harmonic=vehicle.resolution.truth.harmonics,
        provenance={},
    )
