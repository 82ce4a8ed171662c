"""The snapshot file: its content comes back; what is missing or does not fit is reported."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from builder.aero.engine import Flow
from builder.aero.surface.mesh import mesh_of_grid
from builder.campaign.snapshots import (
    SCHEMA,
    SCHEMA_VERSION,
    KeptFlows,
    Snapshots,
    load_flows,
    load_snapshots,
    save_snapshots,
)
from builder.vehicle.shape.geometry import chain_segments, surface_grid
from strainfmu.errors import InputError
from strainfmu.files import write_hdf5_atomically

pytestmark = pytest.mark.fast


@pytest.fixture
def snapshots() -> Snapshots:
    """Two conditions on a cone, with numbers of no meaning."""
    grid = surface_grid(chain_segments([(1.0, 0.1, 0.1)]), 5, 8)
    mesh = mesh_of_grid(grid)
    return Snapshots(
        vehicle="cone",
        engine="euler",
        settings={"inputs": {"cells": [8, 8]}},
        condition=np.array([[6.0, 0.02, 0.0, 20e3], [6.0, 0.0, 0.02, 20e3]]),
        pressure=np.linspace(1e4, 2e4, 2 * mesh.n_nodes).reshape(2, -1),
        internal_pressure=np.array([5e3, 6e3]),
        reference=np.array([0.03, 0.2, 0.5]),
        point=mesh.point,
        triangle=mesh.triangle,
        station=grid.x,
        radius=grid.radius,
        meridian_angle=grid.angle,
        solved=np.array([True, False]),
        flow=np.array([0, 0]),
        momentum_error=np.array([1e-3, np.nan]),
        repairs=np.array([0, 3]),
    )


def assert_same(loaded: Snapshots, expected: Snapshots) -> None:
    for entry in fields(Snapshots):
        np.testing.assert_array_equal(getattr(loaded, entry.name), getattr(expected, entry.name))


def test_it_survives_the_disk(snapshots: Snapshots, tmp_path: Path) -> None:
    path = tmp_path / "snapshots.h5"
    save_snapshots(snapshots, path)
    loaded = load_snapshots(path)
    assert_same(loaded, snapshots)
    assert loaded.grid is not None
    assert loaded.grid.n_roll == 8
    assert load_flows(path).flows == ()
    with h5py.File(path, "r+") as file:
        assert file["pressure"].attrs["unit"] == "Pa"
        file["pressure"][1, 3] += 1.0
    with pytest.raises(InputError, match="damaged or altered"):
        load_snapshots(path)


def test_a_free_surface_has_no_stations(snapshots: Snapshots, tmp_path: Path) -> None:
    free = replace(snapshots, station=None, radius=None, meridian_angle=None)
    save_snapshots(free, tmp_path / "snapshots.h5")
    loaded = load_snapshots(tmp_path / "snapshots.h5")
    assert_same(loaded, free)
    assert loaded.grid is None


def test_coefficients_are_those_of_the_net_pressure(snapshots: Snapshots) -> None:
    """1 kPa over the internal pressure, everywhere: C_A q S = 1 kPa x base area of the cone, no side force."""
    net = replace(snapshots, pressure=np.repeat(snapshots.internal_pressure[:, None] + 1e3, 40, axis=1))
    base_area = np.pi * np.tan(0.1) ** 2
    q = np.array([condition.dynamic_pressure for condition in net.conditions()])
    coefficients = net.coefficients()
    np.testing.assert_allclose(coefficients[:, 0], 1e3 * base_area / (q * 0.03), rtol=1e-12)
    np.testing.assert_allclose(coefficients[:, 1:], 0.0, atol=1e-15)


def test_flows_come_back_in_the_order_of_their_keys(snapshots: Snapshots, tmp_path: Path) -> None:
    path = tmp_path / "snapshots.h5"
    flows = [
        Flow(key=(6.0, 0.1 * i), arrays={"ratio": np.full((2, 2), float(i))}, momentum_error=0.01 * i, repairs=i)
        for i in range(3)
    ]
    save_snapshots(snapshots, path, KeptFlows("0123456789abcdef", tuple(reversed(flows))))
    kept = load_flows(path)
    assert kept.fingerprint == "0123456789abcdef"
    assert [flow.key for flow in kept.flows] == [flow.key for flow in flows]
    for found, expected in zip(kept.flows, flows, strict=True):
        assert (found.momentum_error, found.repairs) == (expected.momentum_error, expected.repairs)
        np.testing.assert_array_equal(found.arrays["ratio"], expected.arrays["ratio"])
    # They do not change how the pressures are read.
    assert_same(load_snapshots(path), snapshots)


def test_long_settings_come_back(snapshots: Snapshots, tmp_path: Path) -> None:
    """An HDF5 attribute holds less than 64 KiB: what is longer becomes a data set."""
    settings = {"inputs": {f"file_{i}": "0" * 64 for i in range(2000)}}
    save_snapshots(replace(snapshots, settings=settings), tmp_path / "snapshots.h5")
    assert load_snapshots(tmp_path / "snapshots.h5").settings == settings


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"condition": np.ones((2, 3))}, r"condition: shape \(2, 3\) found, must be \(2, 4\)"),
        ({"internal_pressure": np.ones(3)}, r"internal_pressure: shape \(3,\) found"),
        ({"point": np.zeros((39, 3))}, r"point: shape \(39, 3\) found, must be \(40, 3\)"),
        ({"pressure": np.full((2, 40), np.nan)}, "pressure: not all values are finite"),
        ({"station": np.linspace(0.0, 1.0, 7)}, "station: 7 found, they do not divide 40 nodes"),
    ],
)
def test_what_does_not_fit_is_refused(changes: dict[str, Any], message: str, snapshots: Snapshots) -> None:
    with pytest.raises(InputError, match=message):
        replace(snapshots, **changes)


def test_a_file_without_an_entry_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "snapshots.h5"
    write_hdf5_atomically(
        path, SCHEMA, SCHEMA_VERSION, lambda file: file.create_dataset("pressure", data=np.ones(3))
    )
    with pytest.raises(InputError, match=r"snapshots\.h5: damaged"):
        load_snapshots(path)


def test_an_older_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "snapshots.h5"
    write_hdf5_atomically(path, SCHEMA, 2, lambda file: None)
    with pytest.raises(InputError, match="expected schema version 3, got 2; build it again"):
        load_snapshots(path)
