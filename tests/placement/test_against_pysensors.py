"""Placements against PySensors (package python-sensors): QR, QR with a zone, and its two-point greedy choice."""

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from sweeps import sweep

from builder.campaign.snapshots import Snapshots
from builder.placement.candidates import CandidateGrid
from builder.placement.curves import qr_sites
from builder.placement.design import Aim, Study, aimed, place, placement_study
from builder.placement.limits import Limits, Zone
from builder.reporting import Silent
from builder.structure.fourier.fourier_model import StructuralModel
from builder.vehicle.file import Vehicle

pysensors = pytest.importorskip("pysensors", reason="needs python-sensors")
optimizers = pytest.importorskip("pysensors.optimizers")
basis = pytest.importorskip("pysensors.basis")

GRID = CandidateGrid(stations=(0.35, 0.8, 1.3, 1.7, 2.2, 2.7, 3.3), roll_angles=tuple(30.0 * k for k in range(12)))
FREE = Limits(gauges=18, spacing=0.02)
ZONE = Zone(first=1.2, last=1.75)


@pytest.fixture(scope="module", params=sweep(["linear", "nonlinear"], ["linear"]))
def study(
    request: pytest.FixtureRequest, vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> Study:
    return placement_study(vehicle, snapshots, structure, GRID, request.param)


def strains(study: Study) -> np.ndarray:
    """Return (n_flows, n_a) the strain of every offered candidate in every flow."""
    flown = study.parts.ensemble.responses(study.parts.basis.fields.T)
    return np.asarray(flown @ study.strain.strain[study.candidates.sites[: study.offered, 0]].T)


def ranked(study: Study, optimizer: Any, modes: int, **settings: Any) -> list[int]:
    """Return the candidates in the order of PySensors."""
    model = pysensors.SSPOR(
        basis=basis.SVD(n_basis_modes=modes, algorithm="arpack", random_state=0), optimizer=optimizer
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.fit(strains(study), quiet=True, seed=0, **settings)
    return [int(one) for one in model.ranked_sensors_]


@pytest.mark.parametrize("gauges", [12, 18])
def test_no_choice_of_pysensors_is_better(study: Study, gauges: int) -> None:
    found = place(study, replace(FREE, gauges=gauges), Aim(starts=3), Silent())
    greedy = optimizers.TPGR(n_sensors=gauges, noise=study.parts.noise_std)
    for name, order in (
        ("QR", ranked(study, optimizers.QR(), gauges)),
        ("QR of few modes", ranked(study, optimizers.QR(), 6)),
        ("two-point greedy", ranked(study, greedy, 30)),
    ):
        chosen = order[:gauges]
        assert len(set(chosen)) == gauges, name
        assert found.value <= aimed(study, Aim()).value(chosen), name


def test_no_constrained_choice_of_pysensors_is_better(study: Study) -> None:
    x = study.candidates.x[study.candidates.sites[: study.offered, 0]]
    inside = np.flatnonzero(ZONE.holds(x, np.zeros(len(x))))
    order = np.array(ranked(study, optimizers.QR(), 18))
    settings = {"idx_constrained": inside, "n_sensors": len(order), "n_const_sensors": 0, "all_sensors": order}
    chosen = ranked(study, optimizers.GQR(), 18, constraint_option="max_n", **settings)[:18]
    assert not set(chosen) & set(inside.tolist())
    found = place(study, replace(FREE, zones=(ZONE,)), Aim(starts=3), Silent())
    assert found.value <= aimed(study, Aim()).value(chosen)


def test_pivoted_qr_is_as_good_as_in_pysensors(study: Study) -> None:
    """Within 3 % of the criterion: modes of one size may be turned, and candidates of one worth exchanged."""
    own, theirs = qr_sites(study, 18), ranked(study, optimizers.QR(), 18)[:18]
    assert study.model.value(own) == pytest.approx(study.model.value(theirs), rel=0.03)
