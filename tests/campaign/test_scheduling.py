"""Who solves: the engine as it travels, and workers that are not of this version."""

import pickle
import threading
from collections.abc import Mapping
from typing import Any

import pytest
from campaign_case import THREADS

from builder.aero.engines.euler import EulerEngine
from builder.aero.engines.registry import make_engine
from builder.campaign.scheduling import solve_flows
from builder.vehicle.file import Vehicle
from strainfmu.errors import StrainfmuError

pytestmark = pytest.mark.fast


class OtherVersion(EulerEngine):
    """An engine that has other inputs in every thread, as it would on a worker of another version."""

    def inputs(self) -> Mapping[str, Any]:
        return {**super().inputs(), "method_version": threading.get_ident()}


@pytest.fixture
def engine(vehicle: Vehicle) -> EulerEngine:
    made = make_engine(vehicle, "euler", vehicle.resolution.map)
    assert isinstance(made, EulerEngine)
    return made


def test_flows_come_once_each(engine: EulerEngine) -> None:
    keys = [(4.0, 0.0), (4.5, 0.05), (4.0, 0.0)]
    told: list[str] = []
    solved = list(solve_flows(engine, keys, THREADS, told.append))
    assert sorted(one.flow.key for one in solved) == [(4.0, 0.0), (4.5, 0.05)]
    assert all(one.seconds > 0.0 for one in solved)
    assert len(told) == 1
    assert list(solve_flows(engine, [], THREADS, told.append)) == []


def test_the_engine_travels_light(engine: EulerEngine) -> None:
    """Its triangles stay at home: as many bytes before they were made as after."""
    before = len(pickle.dumps(engine))
    assert engine.surface.n_nodes > 0
    assert len(pickle.dumps(engine)) == before
    assert pickle.loads(pickle.dumps(engine)).inputs() == engine.inputs()


def test_a_worker_of_another_version_is_refused(engine: EulerEngine) -> None:
    other = OtherVersion(engine.body, engine.marching_grid, engine.grid)
    with pytest.raises(StrainfmuError, match="a worker has another version of the euler engine"):
        list(solve_flows(other, [(4.0, 0.0)], THREADS))
