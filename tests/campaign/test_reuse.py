"""What is solved again after a change, and what is not."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from campaign_case import THREADS, Undisturbed, campaign_of, run, stored_hash, undisturbed_campaign
from ogive import OGIVE

from builder.campaign.campaign_run import run_campaign
from builder.campaign.snapshots import Snapshots, load_flows, load_snapshots
from builder.reporting import Progress, Silent
from builder.vehicle.file import Vehicle, load_vehicle
from builder.vehicle.flight_conditions import condition_grid


def changed(vehicle: Vehicle, **entries: Any) -> Vehicle:
    """Return the vehicle with entries ``section__key`` changed; ``section__sub__key`` one level deeper."""
    values = vehicle.model_dump()
    for name, value in entries.items():
        *path, last = name.split("__")
        section: Any = values
        for part in path:
            section = section[int(part)] if part.isdigit() else section[part]
        section[last] = value
    return Vehicle.model_validate(values)


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    """The small vehicle on the coarsest grid there is: what is solved again does not depend on the cells."""
    cells = {"resolution__map__radial_cells": 8, "resolution__map__circumferential_cells": 8}
    return changed(load_vehicle(OGIVE), **cells)


@pytest.fixture(scope="module")
def undisturbed(vehicle: Vehicle, tmp_path_factory: pytest.TempPathFactory, compiled_solver: None) -> Undisturbed:
    return undisturbed_campaign(vehicle, tmp_path_factory.mktemp("undisturbed") / "snapshots.h5")


@pytest.mark.parametrize(
    ("entries", "solved"),
    [
        ({}, 0),
        ({"structure__wall_thickness_mm": 5.0}, 0),
        ({"structure__internal_pressure_Pa": "ambient"}, 0),
        ({"conditions__altitude_km": 25.0}, 0),
        ({"conditions__altitude_km": [15.0, 22.0, 30.0]}, 0),
        ({"reference__moment_station_m": 1.0}, 0),
        ({"resolution__map__surface_roll_angles": 48}, 0),
        ({"resolution__map__surface_stations": 60}, 0),
        ({"conditions__angle_of_attack_deg": [6.0, 3.0]}, 0),
        # (0, 3), (3, 0) and their like known; new are M 4, 4.5, 5 at a = -4, b = 0 and 3.
        ({"conditions__angle_of_attack_deg": [-3.0, 0.0, -4.0]}, 6),
        ({"conditions__mach_number": [4.0, 4.2]}, 5),
        ({"resolution__map__radial_cells": 10}, 15),
        pytest.param({"resolution__map__circumferential_cells": 20}, 15, marks=pytest.mark.slow),
        ({"profile__1__end_x_m": 2.6}, 15),
    ],
)
def test_a_change_invalidates_what_it_must(
    entries: dict[str, Any], solved: int, vehicle: Vehicle, undisturbed: Undisturbed, tmp_path: Path
) -> None:
    output = tmp_path / "snapshots.h5"
    shutil.copy(undisturbed.path, output)
    campaign = campaign_of(changed(vehicle, **entries))
    result = run(campaign, output)
    assert result.tally.solved == solved
    assert result.up_to_date == (not entries or entries == {"structure__wall_thickness_mm": 5.0})
    assert load_snapshots(output).conditions() == list(campaign.conditions)
    again = tmp_path / "again" / "snapshots.h5"
    if 0 < solved < 15 or not solved:
        # What was reused is what would have been solved.
        run(campaign, again)
        assert stored_hash(again) == stored_hash(output)


def test_progress_begins_with_what_is_known(vehicle: Vehicle, undisturbed: Undisturbed, tmp_path: Path) -> None:
    """So that the time left is reckoned from flows that are solved: 10 of 15 known, then one by one."""
    output = tmp_path / "snapshots.h5"
    run(campaign_of(changed(vehicle, conditions__mach_number=[4.0, 4.5])), output)
    seen: list[tuple[int, int]] = []

    class Listening(Silent):
        @contextmanager
        def stage(self, title: str) -> Iterator[Progress]:
            yield lambda done, of: seen.append((done, of))

    run_campaign(campaign_of(vehicle), output, THREADS, Listening())
    assert seen == [(done, 15) for done in range(10, 16)]
    assert stored_hash(output) == undisturbed.content_hash


def test_a_file_that_is_up_to_date_is_left_alone(
    vehicle: Vehicle, undisturbed: Undisturbed, tmp_path: Path
) -> None:
    output = tmp_path / "snapshots.h5"
    shutil.copy(undisturbed.path, output)
    before = output.stat()
    assert run(campaign_of(vehicle), output).up_to_date
    after = output.stat()
    assert (after.st_ino, after.st_mtime_ns) == (before.st_ino, before.st_mtime_ns)
    assert list(tmp_path.iterdir()) == [output]


def test_a_damaged_file_is_made_again(vehicle: Vehicle, undisturbed: Undisturbed, tmp_path: Path) -> None:
    output = tmp_path / "snapshots.h5"
    content = bytearray(undisturbed.path.read_bytes())
    content[len(content) // 2] ^= 1
    output.write_bytes(content)
    assert run(campaign_of(vehicle), output).tally.solved == 15
    assert stored_hash(output) == undisturbed.content_hash


def test_flows_beside_a_failure_are_reused(vehicle: Vehicle, undisturbed: Undisturbed, tmp_path: Path) -> None:
    """M 1.1 has no axially supersonic flow over this tip. Nothing else is solved again, with it and without it."""
    output = tmp_path / "snapshots.h5"
    shutil.copy(undisturbed.path, output)
    conditions = campaign_of(vehicle).conditions
    slow = condition_grid([1.1], [0.0], [0.0], 22e3)
    result = run(campaign_of(vehicle, [*conditions, *slow]), output)
    assert "for M 1.1, total incidence 0 deg" in result.failed[0].cause
    assert (result.tally.solved, result.tally.reused) == (0, 15)
    assert run(campaign_of(vehicle), output).tally.solved == 0
    assert stored_hash(output) == undisturbed.content_hash


def test_a_condition_that_stands_twice_is_there_twice_and_solved_once(vehicle: Vehicle, tmp_path: Path) -> None:
    conditions = condition_grid([4.0], [3.0], [0.0], 22e3) * 2
    result = run(campaign_of(vehicle, conditions), tmp_path / "snapshots.h5")
    assert result.tally.solved == 1
    assert result.snapshots.solved.tolist() == [True, False]
    assert result.snapshots.flow.tolist() == [0, 0]
    np.testing.assert_array_equal(result.snapshots.pressure[0], result.snapshots.pressure[1])


def test_the_file_holds_what_the_campaign_found(
    vehicle: Vehicle, undisturbed: Undisturbed, tmp_path: Path
) -> None:
    result = run(campaign_of(vehicle), tmp_path / "snapshots.h5")
    loaded = load_snapshots(tmp_path / "snapshots.h5")
    for entry in fields(Snapshots):
        np.testing.assert_array_equal(getattr(loaded, entry.name), getattr(result.snapshots, entry.name))
    assert loaded.solved.sum() == 15
    assert len(load_flows(undisturbed.path).flows) == 15
    engine = campaign_of(vehicle).engine
    keys = [engine.flow_key(condition) for condition in loaded.conditions()]
    for number, origin in enumerate(loaded.flow.tolist()):
        assert keys[number] == keys[origin]
        assert loaded.solved[origin]
