"""Errors of readings that the section [recorder] states, as noise and columns of a map."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from builder.inverse.noise.recorder import (
    MISMATCH,
    PICKUP,
    reading_in_words,
    reading_std,
    recorder_terms,
    scan_errors,
)
from builder.vehicle.gauges.gauge_entries import Recorder
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast


def test_parts_of_a_reading() -> None:
    entry = Recorder(noise_um_per_m=0.3, bits=12, range_um_per_m=5000.0, pickup_um_per_m=1.0)
    assert entry.step_um_per_m == pytest.approx(1e4 / 4096)
    parts = {name: 1e6 * one[0] for name, one in reading_std(entry, 4).items()}
    assert parts == pytest.approx({"noise": 0.3, "step": 2.4414 / 12**0.5, "pickup": 0.5**0.5}, rel=1e-4)
    assert reading_in_words(entry, 0.24).startswith("1.07 um/m (gauge 0.24, noise 0.3, step 0.705, pickup 0.707")
    assert not any(one.any() for one in reading_std(Recorder(), 4).values())
    assert recorder_terms(Recorder(), np.ones(4)) == []
    with pytest.raises(InputError, match=r"recorder.noise_um_per_m: 2 values found, must be 1 or 4"):
        reading_std(Recorder(noise_um_per_m=[0.1, 0.2]), 4)
    with pytest.raises(ValidationError, match="bits and range_um_per_m: expected both or none"):
        Recorder(bits=12)


def test_common_columns() -> None:
    entry = Recorder(pickup_um_per_m=2.0, pickup="common", mismatch_um_per_m_per_K=2.2, gradient_K=2.0)
    aft = np.array([0.0, 0.5, 1.0])
    columns = {term.name: 1e6 * term.strain[:, 0] for term in recorder_terms(entry, aft)}
    np.testing.assert_allclose(columns[PICKUP], np.sqrt(2.0))
    np.testing.assert_allclose(columns[MISMATCH], 4.4 * aft)
    assert not reading_std(entry, 3)["pickup"].any()


def test_a_scanner_reads_strain_of_its_rate_late() -> None:
    """Strain per p_inf that is linear in the angles, by Mach number: derivatives are exact."""
    angles = [(0.03 * ring, 1.3 * place + ring) for ring in range(5) for place in range(5)]
    conditions = [
        SimpleNamespace(mach_number=mach, total_incidence=size, leeward_roll_angle=roll)
        for mach in (5.0, 6.0)
        for size, roll in angles
    ]
    random, pressure = np.random.default_rng(1), np.full(50, 5e3)
    slope = random.standard_normal((2, 2, 3))
    strain = [
        one.mach_number
        + one.total_incidence
        * np.array([np.cos(one.leeward_roll_angle), np.sin(one.leeward_roll_angle)])
        @ slope[int(one.mach_number) - 5]
        for one in conditions
    ]
    ensemble: Any = SimpleNamespace(
        conditions=conditions,
        rolls=1,
        ambient_pressure=pressure,
        responses=lambda operator: 5e3 * np.array(strain),
    )
    entry = Recorder(channel_ms=2.0, turn_deg_per_s=30.0)
    errors = scan_errors(entry, np.zeros((3, 7)), ensemble)
    late = 2e-3 * np.radians(30.0) * np.arange(3)
    for axis, error in enumerate(errors):
        assert error.common
        expected = 5e3 * late * slope[np.repeat([0, 1], 25), axis]
        np.testing.assert_allclose(error.strain, expected, rtol=1e-6)
    assert scan_errors(Recorder(), np.zeros((3, 7)), ensemble) == []
