"""The table of surface pressure: exact where it must be, symmetric at zero incidence, closed outside its knots."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from builder.aero.engine import Flow, FlowKey
from builder.aero.engines.euler import pieces
from builder.aero.engines.surface_pressure import pressure_at_stations
from builder.truth.revolution.flow_table import (
    FlowTable,
    harmonics_at,
    load_flow_table,
    load_truth_flows,
    pressure_harmonics,
    save_flow_table,
    truth_surface,
)
from builder.truth.revolution.strain import TrueStructure
from builder.vehicle.file import VEHICLES, load_vehicle
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

MACH = np.array([5.0, 5.5, 6.2, 7.0])
INCIDENCE = np.array([0.05, 0.09, 0.16, 0.2])
N_X, N_M = 3, 5


def table_of(values: FloatArray) -> FlowTable:
    return FlowTable(vehicle="random", mach_knots=MACH, incidence_knots=INCIDENCE, harmonic=values, provenance={})


def random_table() -> FlowTable:
    values = np.random.default_rng(1).standard_normal((len(MACH), len(INCIDENCE), N_X, N_M))
    return table_of(values)


def polynomial(mach: FloatArray, incidence: FloatArray) -> FloatArray:
    """Return (k, N_X, N_M) cubics in M; in a_T, 1 and a^2 for even harmonics, a and a^3 for odd ones."""
    random = np.random.default_rng(2)
    of_mach = random.standard_normal((4, N_X, N_M))
    in_mach = np.einsum("kp,pxm->kxm", (mach[:, None] - 6.0) ** np.arange(4), of_mach)
    first, second = random.standard_normal((2, N_X, N_M))
    a = incidence[:, None, None]
    odd = np.arange(N_M) % 2 == 1
    return in_mach * np.where(odd, first * a + second * a**3, first + second * a**2)


def test_knots_and_cubics_between_them_are_met_from_zero_incidence_on() -> None:
    """At every knot the table's own harmonics; a cubic of the flow's symmetry is its own spline: 1e-12."""
    mach, incidence = (grid.ravel() for grid in np.meshgrid(MACH, INCIDENCE, indexing="ij"))
    table, values = random_table(), polynomial(mach, incidence)
    found = harmonics_at(table, mach, incidence)
    np.testing.assert_allclose(found, table.harmonic.reshape(-1, N_X, N_M), rtol=0.0, atol=1e-12)
    random = np.random.default_rng(3)
    at_mach, at_incidence = random.uniform(5.0, 7.0, 40), random.uniform(0.0, 0.2, 40)
    at_incidence[:5] = 0.0
    found = harmonics_at(table_of(values.reshape(table.harmonic.shape)), at_mach, at_incidence)
    np.testing.assert_allclose(found, polynomial(at_mach, at_incidence), rtol=0.0, atol=1e-12)


def test_odd_harmonics_vanish_without_incidence_and_even_ones_are_level() -> None:
    """Through a_T = 0 odd harmonics change sign, even ones have no slope; whatever the values at the knots."""
    table, step = random_table(), 1e-6
    mach = np.array([5.0, 5.7, 6.9])
    at_zero = harmonics_at(table, mach, np.zeros(3))
    odd = np.arange(N_M) % 2 == 1
    np.testing.assert_allclose(at_zero[:, :, odd], 0.0, atol=1e-12)
    beside = harmonics_at(table, mach, np.full(3, step))
    slope = (beside - at_zero) / step
    # The slope of an even harmonic is its curvature (some 1e3) times the step.
    assert np.abs(slope[:, :, ~odd]).max() < 1e-2
    assert np.abs(slope[:, :, odd]).min() > 1e-2


@pytest.mark.parametrize(
    ("mach", "incidence", "message"),
    [
        (4.9, 0.1, "mach_number: 4.9 to 4.9 found, 5 to 7 known"),
        (6.0, 0.21, r"total incidence \[rad\]: 0.21 to 0.21 found, 0 to 0.2 known"),
        (np.nan, 0.1, "mach_number: nan to nan found"),
    ],
)
def test_outside_the_knots_nothing_is_known(mach: float, incidence: float, message: str) -> None:
    with pytest.raises(InputError, match=message):
        harmonics_at(random_table(), np.array([mach]), np.array([incidence]))


def test_a_table_is_read_as_it_was_written_and_no_other(tmp_path: Path) -> None:
    """A blunt tip has more stations than the vehicle file states; flows with these stations are the vehicle's."""
    path, table = tmp_path / "flow.h5", random_table()
    save_flow_table(table, path)
    loaded = load_flow_table(path)
    np.testing.assert_array_equal(loaded.harmonic, table.harmonic)
    assert loaded.vehicle == "random"
    with pytest.raises(InputError, match=r"expected shape \(4, 4, stations, harmonics\), got \(4, 4, 3\)"):
        replace(table, harmonic=table.harmonic[..., 0])
    with pytest.raises(InputError, match="harmonic: not all values are finite"):
        replace(table, harmonic=np.where(table.harmonic > 1.0, np.nan, table.harmonic))
    vehicle = load_vehicle(VEHICLES / "blunt_cone.toml")
    truth, n_x = vehicle.resolution.truth, len(truth_surface(vehicle).x)
    assert n_x > truth.surface_stations
    for n_m, name in (
        (truth.harmonics + 1, vehicle.name),
        (truth.harmonics, vehicle.name),
        (truth.harmonics + 1, ""),
    ):
        save_flow_table(replace(table_of(np.zeros((len(MACH), len(INCIDENCE), n_x, n_m))), vehicle=name), path)
        if n_m > truth.harmonics and name:
            load_truth_flows(path, vehicle)
            continue
        with pytest.raises(InputError, match=f"expected flows of '{vehicle.name}' at .* got flows of '{name}'"):
            load_truth_flows(path, vehicle)


def test_harmonics_of_a_flow_are_its_pressure(
    table: FlowTable, true_model: TrueStructure, truth_flows: dict[FlowKey, Flow]
) -> None:
    """All harmonics that 16 cells resolve add up to the pressure in the cells, and the table holds them: 1e-12."""
    surface, flow = true_model.surface, truth_flows[max(truth_flows, key=lambda key: key[1])]
    found = pressure_harmonics(flow, surface, 15) @ np.cos(np.outer(np.arange(16), flow.arrays["roll_angle"]))
    np.testing.assert_allclose(found, pressure_at_stations(pieces(flow), surface), rtol=1e-12)
    # What the cells do not resolve is zero.
    assert not np.any(pressure_harmonics(flow, surface, 18)[:, 16:])
    mach, incidence = table.mach_knots[1], table.incidence_knots[2]
    flow = truth_flows[round(float(mach), 9), float(incidence)]
    expected = pressure_harmonics(flow, surface, table.harmonic.shape[3] - 1)
    np.testing.assert_array_equal(table.harmonic[1, 2], expected)
    found = harmonics_at(table, np.array([mach]), np.array([incidence]))[0]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())
