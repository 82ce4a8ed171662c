"""Conditions outside the engine's reach: named and left out, and the rest goes on."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import radians
from pathlib import Path

import numpy as np
import pytest
from campaign_case import THREADS, campaign_of, run
from ogive import OGIVE

from builder.aero.engine import Flow, FlowKey
from builder.aero.engines.euler import EulerEngine
from builder.campaign.campaign_run import Campaign, campaign_notes
from builder.campaign.failures import (
    ConditionsMissing,
    failed_conditions,
    failure_lines,
    refuse_missing,
)
from builder.campaign.journal import journal_path
from builder.campaign.scheduling import solve_flows
from builder.campaign.snapshots import load_flows, load_snapshots
from builder.vehicle.file import Vehicle
from strainfmu.errors import FlowReachError, InputError
from strainfmu.flight_condition import FlightCondition

REACHED = ((4.0, 0.0, 0.0), (4.0, 2.0, 0.0), (4.0, 0.0, 2.0))
BEYOND = ((1.1, 0.0, 0.0), (1.1, 2.0, 0.0), (1.1, 0.0, 2.0))


def conditions(*rows: tuple[float, float, float]) -> list[FlightCondition]:
    return [FlightCondition(mach, radians(alpha), radians(beta), 20e3) for mach, alpha, beta in rows]


def mixed(vehicle: Vehicle) -> Campaign:
    """Return the campaign of three conditions within reach and three beyond it, one by one."""
    return campaign_of(vehicle, conditions(*(one for pair in zip(BEYOND, REACHED, strict=True) for one in pair)))


@pytest.mark.fast
def test_the_rest_goes_on(vehicle: Vehicle, tmp_path: Path) -> None:
    """The result holds what could be solved as if the rest had not been asked for, and names the rest."""
    path = tmp_path / "snapshots.h5"
    result = run(mixed(vehicle), path)
    assert [one.number for one in result.failed] == [0, 2, 4]
    assert [one.condition.mach_number for one in result.failed] == [1.1, 1.1, 1.1]
    assert all("the axial Mach number falls to 1" in one.cause for one in result.failed)
    found = load_snapshots(path)
    assert failed_conditions(found) == result.failed
    alone = run(campaign_of(vehicle, conditions(*REACHED)), tmp_path / "alone.h5").snapshots
    for name in ("condition", "pressure", "internal_pressure", "solved", "flow", "momentum_error", "mass_error"):
        np.testing.assert_array_equal(getattr(found, name), getattr(alone, name))
    assert not journal_path(path).exists()
    with pytest.raises(FlowReachError, match="3 of 6 conditions not solved; the first: euler: the axial"):
        refuse_missing(found)
    refuse_missing(alone)


def test_notes_name_each_flow_that_failed(vehicle: Vehicle, tmp_path: Path) -> None:
    """One line a flow with its conditions and the cause: alpha 2 and beta 2 deg are one flow."""
    result = run(mixed(vehicle), tmp_path / "snapshots.h5")
    notes = campaign_notes(result)
    assert "warning: 3 of 6 conditions are not in the result" in notes
    lines = [note for note in notes if note.startswith("not solved: ")]
    assert len(lines) == 2
    assert lines[0].startswith("not solved: M 1.1, alpha 0 deg, beta 0 deg, 20 km: euler: the axial Mach number")
    assert "alpha 2 deg, beta 0 deg, 20 km; M 1.1, alpha 0 deg, beta 2 deg, 20 km: euler: " in lines[1]
    assert not any("\n" in line for line in lines)
    many = [replace(result.failed[0], cause=str(number)) for number in range(25)]
    assert len(failure_lines(many)) == 21
    assert "5 further flows" in failure_lines(many)[-1]


class Counting(EulerEngine):
    """An engine that remembers what it was asked for."""

    asked: Sequence[FlowKey] = ()

    def solve(self, key: FlowKey) -> Flow:
        Counting.asked = [*Counting.asked, key]
        return super().solve(key)


@pytest.mark.fast
def test_a_further_run_tries_only_what_failed(vehicle: Vehicle, tmp_path: Path) -> None:
    campaign, path = mixed(vehicle), tmp_path / "snapshots.h5"
    assert isinstance(campaign.engine, EulerEngine)
    engine = Counting(campaign.engine.body, campaign.engine.marching_grid, campaign.engine.grid)
    campaign = replace(campaign, engine=engine)
    first = run(campaign, path)
    assert len(Counting.asked) == 4
    assert len(load_flows(path).flows) == 2
    Counting.asked = ()
    second = run(campaign, path)
    assert [key[0] for key in Counting.asked] == [1.1, 1.1]
    assert second.up_to_date
    assert second.failed == first.failed
    assert (second.tally.solved, second.tally.reused) == (0, 2)


@pytest.mark.fast
def test_nothing_left_is_an_error(vehicle: Vehicle, tmp_path: Path) -> None:
    path = tmp_path / "snapshots.h5"
    with pytest.raises(InputError, match=r"3 of 3 conditions not solved; the first: euler: .* for M 1\.1"):
        run(campaign_of(vehicle, conditions(*BEYOND)), path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.fast
def test_without_a_taker_the_first_failure_is_an_error(vehicle: Vehicle) -> None:
    """Where every flow is needed, as for tables over Mach number and incidence."""
    engine, keys = mixed(vehicle).engine, [(1.1, 0.0), (4.0, 0.0)]
    with pytest.raises(FlowReachError, match="the axial Mach number falls to 1"):
        list(solve_flows(engine, keys, THREADS))
    failed: list[FlowKey] = []
    solved = list(solve_flows(engine, keys, THREADS, failed=lambda one: failed.append(one.key)))
    assert [one.flow.key for one in solved] == [(4.0, 0.0)]
    assert failed == [(1.1, 0.0)]


def test_mass_is_noted_next_to_momentum(vehicle: Vehicle, tmp_path: Path) -> None:
    """In the notes and, per condition, in the file; it survives file and reuse."""
    path = tmp_path / "snapshots.h5"
    campaign = campaign_of(vehicle, conditions(*REACHED))
    result = run(campaign, path)
    found = result.snapshots.mass_error
    assert found is not None
    assert np.all((found > 0.0) & (found < 1e-3))
    momentum = 100.0 * result.snapshots.momentum_error.max()
    expected = (
        f"force and momentum agree within {momentum:.2g} %, mass is conserved within {100.0 * found.max():.2g} %"
    )
    assert expected in campaign_notes(result)
    np.testing.assert_array_equal(load_snapshots(path).mass_error, found)
    assert run(campaign, path).up_to_date


def test_the_command_says_what_failed(tmp_path: Path, run: Callable[..., tuple[int, str, str]]) -> None:
    """The file is written, what is missing is listed, and exit code 3 with one line says that it is not all."""
    table = tmp_path / "some.csv"
    rows = ["mach_number,angle_of_attack_deg,sideslip_angle_deg,altitude_km", "4,0,0,20", "1.1,2,0,20", "4,2,0,20"]
    table.write_text("\n".join(rows) + "\n")
    output = tmp_path / "snapshots.h5"
    code, printed, message = run("snapshots", OGIVE, "--set", table, "-o", output, "--workers", 0)
    assert code == ConditionsMissing.exit_code == 3
    assert len(load_snapshots(output).condition) == 2
    assert "not solved: M 1.1, alpha 2 deg" in " ".join(printed.split())
    assert "mass is conserved within" in " ".join(printed.split())
    assert message.count("\n") == 1
    assert f"{output}: 1 of 3 conditions not solved; the first: euler: the axial Mach number falls to 1" in message
    _, shown, _ = run("inspect", output, "-o", tmp_path / "figures")
    assert "not solved: M 1.1, alpha 2 deg, beta 0 deg, 20 km: euler: the axial Mach number falls to 1" in shown
    assert " momentum     mass repairs" in shown
