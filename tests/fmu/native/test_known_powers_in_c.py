"""Several known parameters of the flow in the native library, with section loads: the numbers of numpy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from flight_fmu import FlightFmu, check, random_flight, whole_map
from further_maps import STATIONS, check_further, with_further_tables
from parameter_maps import PARAMETERS, with_parameter_tables
from raw_fmu import OK, write_resource

from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.tracker import FlightTracker
from strainfmu.interface.estimator_variables import estimator_interface, output_values
from strainfmu.interface.fmi_variables import value_references

pytestmark = pytest.mark.fast

TOLERANCE = 1e-11
"""Of the largest of a kind."""


def test_each_set_of_known_parameters(tmp_path: Path) -> None:
    """One, several, none of them; cold and warm; of what holds one value in the snapshots nothing follows."""
    held = with_parameter_tables(with_further_tables(whole_map()))
    reference = value_references(estimator_interface(held))
    fmu = FlightFmu(write_resource(held, tmp_path).as_uri(), held.n_gauges)
    fmu.start()
    tracker, random = FlightTracker(ManifoldEstimator(held)), np.random.default_rng(4)
    inputs = [reference[f"{prefix}{name}"] for prefix in ("parameter.", "parameter_std.") for name in PARAMETERS]
    sections = range(reference["M_R"], reference["M_R"] + 4 + 12 * len(STATIONS))
    fits = 0
    for k, sample in enumerate([one for seed in range(3) for one in random_flight(held, 8, seed=seed)]):
        value = np.array([0.2, 0.25, 2.0]) + random.normal(size=3) * [0.3, 0.03, 0.0]
        std = np.where(random.random(3) < 0.6, random.choice([1e-3, 0.05, 1.0]), np.nan)
        if k % 8 == 0:
            assert fmu.call("Reset") == OK
            fmu.start()
            tracker = FlightTracker(ManifoldEstimator(held))
        assert fmu.set_reals(inputs, [*value, *std]) == OK
        flow = dict(sample.flow)
        found = tracker.step(
            sample.strain,
            flow.pop("dynamic_pressure", np.nan),
            sample.valid,
            **flow,
            parameters=dict(zip(PARAMETERS, value.tolist(), strict=True)),
            parameters_std=dict(zip(PARAMETERS, std.tolist(), strict=True)),
        )
        check(fmu.advance(sample), found, TOLERANCE)
        expected = np.array(
            output_values(found, with_further=True)[-len(sections) - len(PARAMETERS) : -len(PARAMETERS)]
        )
        check_further(fmu.get_reals(sections), expected, TOLERANCE)
        fits += bool(found.fits)
    assert fits > 12
