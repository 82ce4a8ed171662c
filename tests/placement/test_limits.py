"""Limits that no choice keeps end in one line that names the option."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from builder.placement.candidates import CandidateGrid, Candidates, grid_candidates, with_gauges
from builder.placement.limits import Limits, Zone, rules_of
from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

GRID = CandidateGrid(stations=(0.6, 1.2, 1.8, 2.4, 3.0), roll_angles=tuple(45.0 * k for k in range(8)))


@pytest.fixture(scope="module")
def candidates(vehicle: Vehicle) -> Candidates:
    return grid_candidates(vehicle, GRID)


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        (Limits(gauges=81), "--gauges: 81 found, the candidates and the zones leave room for 80"),
        (Limits(gauges=9, spacing=5.0), "--gauges: 9 found, --spacing of 5000 mm and the zones leave room for 2"),
        (
            Limits(gauges=1, zones=(Zone(first=0.0, last=4.0),)),
            "--forbid, --spacing: expected candidates that they allow, got none of 80",
        ),
        (Limits(budget=0.5), "--budget: 0.5 found, the cheapest candidate costs 1"),
        (Limits(budget=5.0, costs={"45": 1.0}), "--costs: expected directions of the candidates, got '45'"),
    ],
)
def test_limits_that_cannot_be_kept_are_named(candidates: Candidates, limits: Limits, words: str) -> None:
    with pytest.raises(InputError, match="^" + words):
        rules_of(candidates, limits)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"stations": (9.0,)}, "--stations: expected some within the hollow part"),
        ({"directions": ("axial", "up")}, "--directions: expected some of axial, hoop"),
        ({"directions": ("axial", "axial")}, "--directions: expected each once, got axial,axial"),
        ({"pairs": "twins"}, "--pairs: expected mirror or opposite, got 'twins'"),
        ({"pairs": "mirror", "roll_angles": (0.0, 45.0)}, "--pairs: roll angle 45 deg has no partner at 315 deg"),
        ({"pairs": "mirror", "directions": ("45",)}, "--pairs: a mirrored 45 needs 45 and -45"),
    ],
)
def test_candidates_that_cannot_be_are_named(vehicle: Vehicle, change: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match="^" + words):
        grid_candidates(vehicle, replace(GRID, **change))


def test_gauges_that_are_kept_obey_zones_and_distances(candidates: Candidates) -> None:
    own = candidates.layout([0, 2])
    everything, kept = with_gauges(candidates, own)
    zone = Zone(first=0.5, last=0.7)
    with pytest.raises(InputError, match=r"^--keep: gauge 'axial_0deg_600mm' is in a zone of --forbid"):
        rules_of(everything, Limits(gauges=4, zones=(zone,)), kept)
    with pytest.raises(InputError, match=r"^--keep: gauges '.*' and '.*' are nearer than --spacing, 100 mm"):
        rules_of(everything, Limits(gauges=4, spacing=0.1), kept)
    with pytest.raises(InputError, match=r"^--gauges: 1 found, --keep holds 2"):
        rules_of(everything, Limits(gauges=1), kept)
    left, rules = rules_of(everything, Limits(gauges=4), kept)
    twins = {left.gauges.names[left.sites[one][0]] for one in np.flatnonzero(rules.excluded_by(rules.forced))}
    assert twins == set(own.names)


def test_a_zone_of_roll_angles_goes_through_zero() -> None:
    zone = Zone(first=1.0, last=2.0, start=350.0, end=10.0)
    x, roll = np.array([1.5, 1.5, 1.5, 2.5]), np.array([355.0, 5.0, 20.0, 0.0])
    assert zone.holds(x, roll).tolist() == [True, True, False, False]


def test_pairs_and_rosettes_are_sites_of_their_gauges(vehicle: Vehicle) -> None:
    rosettes = grid_candidates(vehicle, replace(GRID, directions=("rosette",)))
    assert rosettes.sites.shape == (40, 3)
    turn = np.abs(rosettes.gauges.direction[0] @ rosettes.gauges.direction[1])
    assert turn == pytest.approx(np.sqrt(0.5), rel=1e-9)
    opposite = grid_candidates(vehicle, replace(GRID, pairs="opposite"))
    assert opposite.sites.shape == (40, 2)
    first, second = opposite.sites.T
    apart = (opposite.roll_angle[second] - opposite.roll_angle[first]) % (2.0 * np.pi)
    np.testing.assert_allclose(apart, np.pi)
