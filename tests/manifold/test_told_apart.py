"""Gauges that read a wind and its mirror image alike are refused: one of two solutions would pass for certain."""

from dataclasses import replace

import flight_maps
import numpy as np
import pytest
from flight_maps import ROWS, STATIONS, flight_map

from builder.manifold.nonlinear_build import check_told_apart, winds_read_alike
from strainfmu.errors import InputError
from strainfmu.estimator.map.nonlinear_map import ManifoldMap

pytestmark = pytest.mark.fast


def rows_at(monkeypatch: pytest.MonkeyPatch, *degrees: float) -> None:
    """Let the gauges of each station stand at these roll angles, in turn."""
    around = np.radians(np.resize(degrees, ROWS))
    monkeypatch.setattr(flight_maps, "gauge_roll_angles", lambda: np.tile(around, STATIONS))


def low_flight(hardware: bool) -> ManifoldMap:
    """Tables for altitudes at which strain tells the wind well."""
    return replace(flight_map(discrepancy=1e-3, hardware=hardware), pressure_range=np.array([3e4, 1e5]))


@pytest.mark.parametrize("hardware", [False, True])
@pytest.mark.parametrize(("degrees", "winds"), [((0.0, 180.0), (90, 270)), ((60.0,), (150, 330))])
def test_gauges_in_one_plane_are_refused(
    monkeypatch: pytest.MonkeyPatch, degrees: tuple[float, ...], winds: tuple[int, int], hardware: bool
) -> None:
    rows_at(monkeypatch, *degrees)
    with pytest.raises(InputError, match=f"wind at roll angle {winds[0]} deg and at {winds[1]} deg"):
        check_told_apart(low_flight(hardware))


@pytest.mark.parametrize("degrees", [(0.0, 90.0), (0.0, 120.0, 240.0), (0.0, 180.0, 30.0)])
def test_gauges_off_it_are_not(monkeypatch: pytest.MonkeyPatch, degrees: tuple[float, ...]) -> None:
    rows_at(monkeypatch, *degrees)
    assert winds_read_alike(low_flight(hardware=True)) is None
