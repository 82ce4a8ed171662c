"""Two gauges lost together, number of directions, cost of cables, and air data as the goal."""

from dataclasses import replace

import numpy as np
import pytest
from gaussian_case import random_model

from builder.campaign.snapshots import Snapshots
from builder.placement.candidates import CandidateGrid
from builder.placement.design import Aim, Study, aimed, pair_remarks, place, placement_study
from builder.placement.limits import Limits
from builder.placement.lost_gauge import LARGEST_RATIO, LostGauge, lost_gauges, pair_loss_ratios
from builder.reporting import Silent
from builder.structure.fourier.fourier_model import StructuralModel
from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError

GRID = CandidateGrid(
    stations=(0.6, 1.2, 1.8, 2.4, 3.0),
    roll_angles=tuple(45.0 * k for k in range(8)),
    directions=("axial", "hoop", "45"),
)


@pytest.fixture(scope="module")
def study(vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel) -> Study:
    return placement_study(vehicle, snapshots, structure, GRID, "nonlinear")


def test_the_loss_of_two_is_the_model_without_them() -> None:
    model, sites = random_model(3, b=2), [4, 7, 1]
    found = pair_loss_ratios(model, sites)
    rows = model.gauge_rows(sites)
    whole = model.weight @ model.goal_variance(sites)
    for first, second in ((0, 1), (1, 4), (2, 5)):
        left = [k for k in range(6) if k not in (first, second)]
        fewer = replace(model, rows=rows[:, left, None])
        expected = np.sqrt(model.weight @ fewer.goal_variance(range(4)) / whole)
        np.testing.assert_allclose(found[first, second], expected, rtol=1e-9)
        np.testing.assert_allclose(found[second, first], expected, rtol=1e-9)
    assert (np.diagonal(found) == 1.0).all()


def test_pairs_whose_loss_cannot_be_borne_are_named_the_worst_first() -> None:
    ratio = np.ones((3, 3, 5))
    ratio[0, 2] = ratio[2, 0] = [1.0, 1.4, 1.0, 1.0, 1.0]
    ratio[1, 2] = ratio[2, 1] = [1.0, 1.0, 1.0, 1.6, 1.0]
    lost = LostGauge(gauges=np.array([2, 0, 1]), ratio=np.ones((3, 5)), pair_ratio=ratio)
    first, second = pair_remarks(lost, ["a", "b", "c"])
    assert first.startswith("loss of a and b: sigma of M_P rises to 1.60 times, more than 1.3")
    assert second.startswith("loss of c and b: sigma of C_N rises to 1.40 times, more than 1.3")
    assert pair_remarks(lost_gauges(random_model(1), [0, 1], np.array([0, 1])), ["a", "b"]) == []


def test_a_placement_bears_the_loss_of_two(study: Study) -> None:
    """What raises a sigma beyond the limit is named; nothing else does."""
    found = place(study, Limits(gauges=10), Aim(starts=2, robust=True, losses=2), Silent())
    ratio = pair_loss_ratios(study.model, found.sites)
    assert found.lost.pair_ratio is not None
    np.testing.assert_allclose(found.lost.pair_ratio, ratio)
    too_large = int(np.sum(np.triu(ratio.max(axis=2), k=1) > LARGEST_RATIO))
    assert len(found.lost.pairs) == too_large
    assert (len(found.remarks) > 0) == (too_large > 0 or found.lost.ratio.max() > LARGEST_RATIO)


def test_as_many_directions_are_used_as_may_be(study: Study) -> None:
    """The best single direction, by trying each."""
    aim = Aim(starts=2)
    found = place(study, Limits(gauges=8, kinds=1), aim, Silent())
    used = {name.partition("_")[0] for name in found.layout.names}
    assert len(used) == 1
    each = {
        kind: place(study, Limits(gauges=8, directions=(kind,)), aim, Silent()).value
        for kind in ("axial", "hoop", "45")
    }
    assert found.value == pytest.approx(min(each.values()), rel=1e-12)
    free = place(study, Limits(gauges=8), aim, Silent())
    assert free.value <= found.value
    assert free.bound <= found.bound <= found.value
    rosettes = placement_study(
        study.parts.vehicle,
        study.parts.flows.snapshots,
        study.parts.structure,
        replace(GRID, directions=("rosette",), stations=(1.2, 2.4)),
        "linear",
    )
    with pytest.raises(InputError, match=r"^--forbid, --spacing, --kinds: expected candidates that they allow"):
        place(rosettes, Limits(gauges=3, kinds=2), aim, Silent())


def test_cables_cost_by_their_length(study: Study) -> None:
    """With a dear cable to the tail the gauges go aft, and all of it stays within the budget."""
    budget, rate, station = 12.0, 4.0, 3.3
    found = place(study, Limits(budget=budget, cable=(rate, station)), Aim(starts=2), Silent())
    x = found.layout.position[:, 0]
    assert len(x) + rate * float(np.abs(x - station).sum()) <= budget + 1e-9
    assert x.mean() > place(study, Limits(budget=budget), Aim(starts=2), Silent()).layout.position[:, 0].mean()


def test_air_data_as_the_goal_make_the_flight_state_more_certain(study: Study) -> None:
    """Lower variance of Mach number, incidences and pressure than the placement for loads."""
    state = aimed(study, Aim(goal="air-data"))
    np.testing.assert_allclose(np.sqrt(state.weight @ state.goal_variance(list(study.layout_sites))), 1.0)
    limits = Limits(gauges=8)
    found = place(study, limits, Aim(goal="air-data", starts=2), Silent())
    loads = place(study, limits, Aim(starts=2), Silent())
    assert found.value == pytest.approx(state.value(list(found.sites)))
    assert found.value < state.value(list(loads.sites))
    assert 0.0 <= found.gap_percent < 15.0


def test_air_data_need_the_nonlinear_estimator(
    vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> None:
    linear = placement_study(vehicle, snapshots, structure, replace(GRID, stations=(1.2,)), "linear")
    with pytest.raises(InputError, match=r"^--goal: air-data needs the nonlinear estimator"):
        aimed(linear, Aim(goal="air-data"))
