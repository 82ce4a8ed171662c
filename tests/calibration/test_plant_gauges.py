"""The gauges of the plant: with an uneven wall and turned gauges they read what the structure's operator gives."""

import numpy as np
import pytest

from builder.structure.as_built.as_built_structure import AsBuiltStructure
from builder.structure.as_built.as_built_vehicle import as_built_std, draw_as_built
from builder.vehicle.file import Vehicle

HARMONICS = 5


@pytest.mark.fast
def test_gauges_read_any_flow_at_any_roll_angle(vehicle: Vehicle, as_built: AsBuiltStructure) -> None:
    """Harmonics of a pressure whose crest is at several roll angles, against Z_p times the nodes' pressure."""
    random = np.random.default_rng(2)
    built = draw_as_built(as_built_std(vehicle.calibration, as_built.counts), random)
    response = as_built.flight_gauges(built, HARMONICS).response
    grid, operator = as_built.surface, as_built.strain_operator(built)
    amplitude, m = random.normal(size=(len(grid.x), HARMONICS + 1)), np.arange(HARMONICS + 1)
    for crest in (0.0, 1.3, -2.1):
        pressure = amplitude @ np.cos(np.outer(m, grid.roll_angle - crest))
        phase = np.outer(as_built.placed.roll_angle - crest, m)
        wave = np.stack([np.cos(phase), np.sin(phase)], axis=-1)
        found = np.einsum("gmxw,xm,gmw->g", response, amplitude, wave, optimize=True)
        expected = operator @ pressure.ravel()
        np.testing.assert_allclose(found, expected, atol=1e-10 * np.abs(expected).max())
