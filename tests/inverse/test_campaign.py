"""The snapshot file: what it holds comes back, what it lacks is said."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from builder.aero.euler.marching_grid import MarchingGrid
from builder.campaign import SCHEMA, SCHEMA_VERSION, Snapshots, load_snapshots, save_snapshots, take_snapshots
from builder.flight_conditions import condition_grid
from builder.geometry import chain_segments, surface_grid
from strainfmu.errors import InputError
from strainfmu.files import write_hdf5_atomically


def test_conditions_that_share_a_flow_share_its_solution(tmp_path: Path) -> None:
    body = chain_segments([(1.0, 0.1, 0.1), (2.0, 0.0, 0.0)])
    surface = surface_grid(body, 10, 16)
    conditions = condition_grid([5.0], [-4.0, 0.0, 4.0], [-4.0, 0.0, 4.0], 20e3)
    done: list[tuple[int, int]] = []
    snapshots = take_snapshots(
        body, conditions, MarchingGrid(8, 12), surface, lambda count, of: done.append((count, of))
    )
    # a_T takes three values: 0, 4 deg, and that of 4 and 4 deg.
    assert snapshots.solved.sum() == 3
    assert done == [(1, 3), (2, 3), (3, 3)]
    save_snapshots(snapshots, tmp_path / "snapshots.h5")
    loaded = load_snapshots(tmp_path / "snapshots.h5")
    for entry in fields(Snapshots):
        np.testing.assert_array_equal(getattr(loaded, entry.name), getattr(snapshots, entry.name))
    # Nose up and nose down by as much are each other's mirror image: half a turn of the nodes.
    maps = surface.as_map(snapshots.pressure)
    np.testing.assert_allclose(maps[7], np.roll(maps[1], 8, axis=1), rtol=1e-12)


def test_a_file_without_an_entry_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "snapshots.h5"
    write_hdf5_atomically(
        path, SCHEMA, SCHEMA_VERSION, lambda file: file.create_dataset("pressure", data=np.ones(3))
    )
    with pytest.raises(InputError, match=r"snapshots\.h5: damaged"):
        load_snapshots(path)
