"""The small vehicle, and its undisturbed result."""

from __future__ import annotations

import pytest
from campaign_case import Undisturbed, campaign_of, run, stored_hash
from ogive import OGIVE

from builder.campaign.journal import encode_record
from builder.campaign.snapshots import load_flows
from builder.vehicle.file import Vehicle, load_vehicle


@pytest.fixture(scope="session")
def vehicle() -> Vehicle:
    return load_vehicle(OGIVE)


@pytest.fixture(scope="session")
def undisturbed(vehicle: Vehicle, tmp_path_factory: pytest.TempPathFactory, compiled_solver: None) -> Undisturbed:
    path = tmp_path_factory.mktemp("undisturbed") / "snapshots.h5"
    run(campaign_of(vehicle), path)
    kept = load_flows(path)
    size = sum(len(encode_record(kept.fingerprint, flow)) for flow in kept.flows)
    return Undisturbed(path, stored_hash(path), size)
