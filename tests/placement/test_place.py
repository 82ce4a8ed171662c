"""Placement on the shipped vehicle at a coarse resolution: its models against the estimators, and its choices."""

from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from changed_vehicle import write_changed
from sweeps import sweep

from builder.aero.load_operator import coefficient_scale
from builder.campaign.snapshots import Snapshots, save_snapshots
from builder.figures.placement_figures import placement_figure
from builder.inverse.build import build_inverse_map
from builder.inverse.ensemble import rolled_modes
from builder.inverse.problem import inverse_problem
from builder.inverse.solution import Problem
from builder.manifold.nonlinear_build import with_manifold
from builder.pipeline.place_and_review import review_layout, write_layout
from builder.placement import curves, design, lost_gauge
from builder.placement.candidates import CandidateGrid
from builder.placement.curves import accuracy_curves, even_sites, qr_sites
from builder.placement.design import Aim, Study, aimed, place, placement_study
from builder.placement.flight_models import Kind, flight_states
from builder.placement.gaussian_model import GaussianModel
from builder.placement.limits import Limits, Rules, Zone, rules_of
from builder.placement.review import Review, review_of
from builder.reporting import Silent
from builder.reports.build_report.build_sections import layout_section
from builder.reports.page.html import Page, page_html
from builder.structure.fourier.fourier_model import StructuralModel, structural_model_on
from builder.structure.gauge_checks import check_gauges
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.gauge_entries import GaugeLayoutEntry
from builder.vehicle.gauges.layout import GaugeLayout, read_layout
from builder.vehicle.gauges.sensor_entries import InertialUnit, Ports, Sensors
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, save_inverse_map
from strainfmu.estimator.reference.air import AirInputs
from strainfmu.estimator.reference.gain import load_covariance
from strainfmu.estimator.reference.nonlinear import NonlinearReference, Sample, flight_loads
from strainfmu.version import __version__

GRID = CandidateGrid(stations=(0.35, 0.8, 1.3, 1.7, 2.2, 2.7, 3.3), roll_angles=tuple(30.0 * k for k in range(12)))
COARSE_ENTRIES = (
    ("surface_stations = 120", "surface_stations = 40"),
    ("surface_roll_angles = 72", "surface_roll_angles = 24"),
    ("harmonics = 16", "harmonics = 10"),
    ("element_length_mm = 10.0", "element_length_mm = 40.0"),
)
COUNTED = Limits(gauges=18, spacing=0.02)


@pytest.fixture(scope="module")
def nonlinear_vehicle(vehicle: Vehicle) -> Vehicle:
    entry = vehicle.map.model_copy(update={"estimator": "nonlinear"})
    return vehicle.model_copy(update={"map": entry})


@pytest.fixture(scope="module")
def nonlinear(nonlinear_vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel) -> Study:
    return placement_study(nonlinear_vehicle, snapshots, structure, GRID)


@pytest.fixture(scope="module")
def linear(vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel) -> Study:
    return placement_study(vehicle, snapshots, structure, GRID)


def test_the_nonlinear_model_states_the_uncertainty_of_the_estimator(
    nonlinear: Study, nonlinear_vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> None:
    """Its own posterior at the same states, with hardware errors as the map's tables hold them: within 8 %."""
    problem = inverse_problem(nonlinear_vehicle, snapshots, structure)
    built = with_manifold(
        build_inverse_map(nonlinear_vehicle, snapshots, structure, problem=problem),
        nonlinear_vehicle,
        snapshots,
        structure,
        problem=problem,
    )
    manifold = built.manifold
    assert manifold is not None
    reference = NonlinearReference(built, manifold, manifold.gauge_covariance)
    states = flight_states(nonlinear.parts)
    found = nonlinear.own_sigma * np.sqrt(nonlinear.model.goal_variance(nonlinear.layout_sites))
    for number in (3, 12, 20):
        state, n_d = states[number], manifold.n_gauges
        pressure = float(np.exp(state[3]))
        value = np.array([state[0], pressure, 0.7 * state[0] ** 2 * pressure])
        relative = [manifold.static_pressure_error, manifold.dynamic_pressure_error]
        std = np.array([manifold.mach_number_error, *(relative * value[1:])])
        sample = Sample(rows=np.zeros(n_d), used=np.ones(n_d, dtype=bool), air=AirInputs(value=value, std=std))
        covariance = reference.strain_covariance(state, considered=True)
        joint = reference.posterior(state, sample, covariance, considered=True).covariance[0]
        loads = np.asarray(reference.model(state, sample.air, covariance, considered=True).output_fixed)[4:]
        expected = flight_loads(state, loads, joint, reference.references)
        sigma = np.sqrt(np.diag(expected.coefficient_covariance))[:5]
        np.testing.assert_allclose(found[number], sigma, rtol=0.08)


def sigma_by_bayes(problem: Problem) -> np.ndarray:
    """(5,) sigma of the coefficients by Bayes' rule with the covariance of the problem's own terms, no basis."""
    modes = rolled_modes(problem.ensemble, None)
    factor = modes.modes * modes.coefficient_std
    strain = problem.strain_operator @ factor
    loads = problem.load_operator[:5] @ factor * problem.ensemble.scale[:1].T
    covariance = np.sum([term.covariance for term in problem.noise], axis=0) + strain @ strain.T
    after = loads @ loads.T - loads @ strain.T @ np.linalg.solve(covariance, strain @ loads.T)
    return np.asarray(np.sqrt(np.diag(after)))


def test_the_linear_model_states_the_uncertainty_of_case_2(
    vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> None:
    """Bayes' rule with the covariance of the problem's own terms, without any basis: within 3 %."""
    bayes = vehicle.model_copy(update={"map": vehicle.map.model_copy(update={"case": 2})})
    study = placement_study(bayes, snapshots, structure, replace(GRID, stations=(1.0, 2.0)))
    expected = sigma_by_bayes(inverse_problem(bayes, snapshots, structure))
    np.testing.assert_allclose(study.own_sigma, expected, rtol=0.03)


def test_flush_ports_and_an_inertial_unit_count(
    vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> None:
    """Bayes' rule as above with the rows of the sensors, their errors and the inside pressure: within 3 %."""
    ports = Ports(x_m=0.3, roll_deg=[0.0, 90.0, 180.0, 270.0], std_Pa=50.0, range_Pa=1e6, gain_percent=1.0)
    unit = InertialUnit(x_m=1.5, mass_kg=150.0, center_x_m=2.0, inertia_kg_m2=120.0)
    # Base pressure and friction have no part in the coefficients; a placement leaves them out.
    sensors = Sensors(ports=ports, imu=unit, base_pressure_percent=0.0, friction_C_A_std=0.0)
    bayes = vehicle.model_copy(
        update={"map": vehicle.map.model_copy(update={"case": 2}), "sensors": sensors},
    )
    study = placement_study(bayes, snapshots, structure, replace(GRID, stations=(1.0, 2.0)))
    expected = sigma_by_bayes(inverse_problem(bayes, snapshots, structure))
    np.testing.assert_allclose(study.own_sigma, expected, rtol=0.03)


def test_the_goal_of_the_field_is_the_posterior_of_pressure(
    vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> None:
    """What all gauges and the first 20 take off the area-weighted variance, by Bayes' rule without any basis."""
    bayes = vehicle.model_copy(update={"map": vehicle.map.model_copy(update={"case": 2})})
    study = placement_study(bayes, snapshots, structure, replace(GRID, stations=(1.0, 2.0)))
    problem, own = inverse_problem(bayes, snapshots, structure), list(study.layout_sites)
    modes = rolled_modes(problem.ensemble, None)
    factor = modes.modes * modes.coefficient_std
    strain = problem.strain_operator @ factor
    noise = np.sum([term.covariance for term in problem.noise], axis=0)
    weighted = np.sqrt(problem.node_area)[:, None] * factor

    def taken(count: int) -> float:
        rows = strain[:count]
        gain = weighted @ rows.T
        covariance = noise[:count, :count] + rows @ rows.T
        return float(np.sum(gain * np.linalg.solve(covariance, gain.T).T))

    model = aimed(study, Aim(goal="field"))
    none = model.value([])
    found = (none - model.value(own[:6])) / (none - model.value(own))
    assert found == pytest.approx(taken(6) / taken(len(own)), rel=0.02)
    assert taken(6) < 0.99 * taken(len(own))


def test_case_1_observes_what_its_map_does(
    linear: Study, snapshots: Snapshots, structure: StructuralModel
) -> None:
    """The map's own covariance of the loads with the layout in use: within 15 %."""
    vehicle = linear.parts.vehicle
    assert vehicle.map.case == 1
    built = build_inverse_map(vehicle, snapshots, structure)
    references = vehicle.reference_quantities()
    scale = coefficient_scale(linear.parts.ensemble.nominal_dynamic_pressure, references)
    sigma = scale * np.sqrt(np.diag(load_covariance(built))[:5])
    np.testing.assert_allclose(linear.own_sigma, sigma, rtol=0.15)


def test_a_loss_that_cannot_be_borne_is_named(linear: Study, monkeypatch: pytest.MonkeyPatch) -> None:
    limit = 1.05
    for module in (design, lost_gauge):
        monkeypatch.setattr(module, "LARGEST_RATIO", limit)
    found = place(linear, replace(COUNTED, gauges=4), Aim(starts=1, robust=True), Silent())
    worst = found.lost.ratio.max(axis=1)
    assert worst.max() > limit
    assert len(found.remarks) == int(np.sum(worst > limit))
    names = linear.candidates.gauges.names
    for line in found.remarks:
        gauge, _, rest = line.removeprefix("loss of ").partition(": sigma of ")
        number = found.lost.gauges.tolist().index(names.index(gauge))
        coefficient = COEFFICIENT_NAMES[int(np.argmax(found.lost.ratio[number]))]
        assert rest.startswith(f"{coefficient} rises to {worst[number]:.2f} times, more than {limit:g}")


def best_of_random(model: GaussianModel, rules: Rules, draws: int, seed: int = 0) -> list[int]:
    """Return the best of ``draws`` choices at random that keep the rules."""
    random, best, value = np.random.default_rng(seed), list[int](), np.inf
    for _ in range(draws):
        chosen = list(rules.forced)
        blocked, remaining = rules.excluded_by(chosen), rules.remaining_budget(chosen)
        for site in random.permutation(model.n_sites).tolist():
            if not blocked[site] and rules.cost[site] <= remaining + 1e-9:
                chosen.append(site)
                remaining -= float(rules.cost[site])
                blocked |= rules.excluded_by([site])
            if remaining < rules.cost.min():
                break
        reached = model.value(chosen)
        if reached < value:
            best, value = chosen, reached
    return best


@pytest.mark.parametrize("kind", sweep(["linear", "nonlinear"], ["linear"]))
def test_placed_gauges_are_never_worse_than_those_of_others(kind: str, request: pytest.FixtureRequest) -> None:
    """Pivoted QR of the strain modes, which PySensors has; D-optimal; even rows; the best of 1000 at random."""
    study: Study = request.getfixturevalue(kind)
    found = place(study, COUNTED, Aim(starts=4), Silent())
    model = aimed(study, Aim())
    left, rules = rules_of(replace(study.candidates, sites=study.candidates.sites[: study.offered]), COUNTED)
    assert len(left.sites) == study.offered
    optimal = place(study, COUNTED, Aim(goal="d-optimal", starts=2), Silent())
    others = {
        "QR": qr_sites(study, 18),
        "D-optimal": optimal.sites,
        "rows": even_sites(study, 18),
        "random": best_of_random(model.of_sites(np.arange(study.offered)), rules, 1000),
    }
    for name, sites in others.items():
        assert len(set(sites)) == 18, name
        assert found.value <= model.value(list(sites)) * (1.0 + 1e-9), name
    assert 0.0 <= found.gap_percent < 15.0
    assert 0.0 <= optimal.gap_percent < 15.0
    assert len(found.layout.names) == 18


@pytest.mark.parametrize("kind", sweep(["linear", "nonlinear"], ["linear"]))
def test_many_gauges_are_within_a_tenth_of_the_bound_and_better_than_the_published_ones(
    kind: str, request: pytest.FixtureRequest
) -> None:
    study: Study = request.getfixturevalue(kind)
    found = place(study, replace(COUNTED, gauges=36), Aim(starts=3), Silent())
    assert 0.0 <= found.gap_percent < 10.0
    model = aimed(study, Aim())
    own, placed = (model.weight @ model.goal_variance(list(sites)) for sites in (study.layout_sites, found.sites))
    assert (placed < own).all()
    again = place(study, replace(COUNTED, gauges=36), Aim(starts=3), Silent())
    assert again.layout.names == found.layout.names


def test_the_layout_is_one_that_the_vehicle_file_takes(
    linear: Study, vehicle: Vehicle, snapshots: Snapshots, tmp_path: Path
) -> None:
    found = place(linear, COUNTED, Aim(starts=2), Silent())
    write_layout(found.layout, tmp_path / "layout.csv")
    read = read_layout(tmp_path / "layout.csv")
    assert read.names == found.layout.names
    layouts = {**vehicle.gauges.layouts, "placed": GaugeLayoutEntry(file=str(tmp_path / "layout.csv"))}
    gauges = vehicle.gauges.model_copy(update={"layout": "placed", "layouts": layouts})
    placed = vehicle.model_copy(update={"gauges": gauges})
    assert check_gauges(placed)["placed"] == 18
    used = structural_model_on(
        placed, linear.parts.structure.surface, vehicle.resolution.map, ["placed", "configuration_2"]
    )
    assert build_inverse_map(placed, snapshots, used).n_gauges == 18


def test_limits_are_kept(linear: Study) -> None:
    """Gauges kept, zones, distances, and mirrored pairs, whose 45 is a -45 on the other side."""
    own = linear.parts.structure.layouts["configuration_2"]
    keep = GaugeLayout(own.names[:2], own.position[:2], own.direction[:2])
    grid = replace(GRID, pairs="mirror", directions=("axial", "hoop", "45", "-45"))
    parts = linear.parts
    study = placement_study(parts.vehicle, parts.flows.snapshots, parts.structure, grid, keep=keep)
    zones = (Zone(first=1.2, last=1.75), Zone(first=0.0, last=4.0, start=350.0, end=10.0))
    found = place(study, Limits(gauges=16, spacing=0.1, zones=zones), Aim(starts=2), Silent()).layout
    assert len(found.names) == 16
    assert set(keep.names) < set(found.names)
    fresh = np.array([name not in keep.names for name in found.names])
    x, (y, z) = found.position[:, 0], found.position[:, 1:].T
    roll = np.degrees(np.arctan2(y, z)) % 360.0
    assert not np.any(fresh & (x >= 1.2) & (x <= 1.75))
    assert not np.any(fresh & ((roll > 349.0) | (roll < 11.0)))
    apart = np.linalg.norm(found.position[:, None] - found.position, axis=2)
    assert not np.any((apart > 1e-4) & (apart < 0.1 - 1e-9))
    mirror = np.array([1.0, -1.0, 1.0])
    both = np.round(np.hstack([found.position, found.direction]), 6)[fresh]
    for row in both:
        other = row * np.tile(mirror, 2)
        same = np.abs(both[:, :3] - other[:3]).max(axis=1) < 1e-5
        along = np.abs(both[:, 3:] @ other[3:]) > 1.0 - 1e-5
        assert np.any(same & along)


def test_a_budget_is_spent_on_what_is_worth_its_cost(linear: Study) -> None:
    limits = Limits(budget=12.0, costs={"axial": 1.0, "hoop": 4.0})
    found = place(linear, limits, Aim(starts=2), Silent())
    hoop = sum(name.startswith("hoop") for name in found.layout.names)
    assert len(found.layout.names) - hoop + 4 * hoop <= 12
    cheap = place(linear, replace(limits, costs={"axial": 4.0, "hoop": 1.0}), Aim(starts=2), Silent())
    assert sum(name.startswith("hoop") for name in cheap.layout.names) > hoop


def test_curves_fall_with_gauges_and_ports_and_rise_with_errors(
    linear: Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(curves, "COUNTS", (12, 36))
    sites = place(linear, COUNTED, Aim(starts=1), Silent()).sites
    found = accuracy_curves(linear, COUNTED, Aim(), sites)
    assert found.counts == (12, 36)
    mean = np.mean(found.placed**2, axis=1)
    assert mean[1] < mean[0]
    assert (mean <= np.mean(found.qr**2, axis=1)).all()
    assert (mean <= np.mean(found.even**2, axis=1)).all()
    assert (found.lost >= found.placed).all()
    noise, position, ports = found.sweeps
    assert set(noise.sigmas) == {"placed", "configuration_2", "pivoted QR", "evenly spread rows"}
    np.testing.assert_allclose(noise.sigmas["configuration_2"][noise.values.index(1.0)], 1.0, rtol=1e-9)
    for name in noise.sigmas:
        # What counts as noise of a gauge follows from the noise, so that one coefficient alone may fall a little.
        assert (np.diff(np.mean(noise.sigmas[name] ** 2, axis=1)) > 0.0).all(), name
        assert (np.diff(position.sigmas[name], axis=0) > 0.0).all(), name
        assert (np.diff(np.mean(ports.sigmas[name] ** 2, axis=1)) < 0.0).all(), name
    np.testing.assert_allclose(ports.sigmas["configuration_2"][0], 1.0, rtol=1e-9)
    axes = placement_figure(found, "ic3x").axes
    assert len(axes) == 4 * len(COEFFICIENT_NAMES)
    assert [one.get_xlabel() for one in axes[::5]] == [
        "gauges [1]",
        "gauge noise over the stated one [1]",
        "error of position [mm]",
        "flush ports [1]",
    ]


def test_the_command_writes_a_layout_and_a_figure(
    run: Callable[..., tuple[int, str, str]], snapshots: Snapshots, tmp_path: Path
) -> None:
    coarse_file = write_changed(tmp_path, ('estimator = "nonlinear"', 'estimator = "linear"'), *COARSE_ENTRIES)
    save_snapshots(snapshots, tmp_path / "snapshots.h5")
    arguments = ("--snapshots", tmp_path / "snapshots.h5", "--stations", "0.6:3:0.6", "--roll-angles", "0:315:45")
    code, out, err = run(
        "place", coarse_file, "--gauges", 12, "-o", tmp_path / "layout.csv", *arguments, "--starts", 1, "--robust"
    )
    assert (code, err) == (0, "")
    assert "bound gap: " in out
    assert len(read_layout(tmp_path / "layout.csv").names) == 12
    for wrong, words in (
        (("--forbid", "1"), "--forbid: expected x1:x2 in m"),
        (("--goal", "best"), "'--goal': 'best' is not one of 'loads', 'field', 'air-data', 'd-optimal'"),
        (("--loads", "C_L=1"), "--loads: expected weights from 0 of C_A"),
        (("--costs", "axial=2"), "--costs: expected --budget with it"),
        (("--cable", "1@2"), "--cable: expected --budget with it"),
        (("--cable", "1,2", "--budget", 9), "--cable: expected COST@X with a cost from 0 per metre, got '1,2'"),
        (("--losses", 2), "--losses: 2 needs --robust"),
        (("--goal", "air-data"), "--goal: air-data needs the nonlinear estimator, got the linear one"),
    ):
        code, _, err = run("place", coarse_file, "-o", tmp_path / "none.csv", *arguments, *wrong)
        assert code == 2
        assert words in err
        assert err.count("\n") == 1
    assert not (tmp_path / "none.csv").exists()


@pytest.mark.usefixtures("undrawn")
def test_a_review_names_what_a_layout_lacks(linear: Study) -> None:
    """Its numbers are those of the layout computed again with one gauge less, or one more."""
    found, own = review_of(linear), list(linear.layout_sites)
    value = linear.model.value(own)
    k = int(np.argmax(found.worth))
    without = linear.model.value(own[:k] + own[k + 1 :])
    assert found.worth[k] == pytest.approx(without / value - 1.0, rel=1e-6)
    best = linear.candidates.gauges.names.index(found.best[0])
    more = min(linear.model.value([*own, one]) for one in range(linear.offered))
    assert found.best[1] == pytest.approx(1.0 - more / value, rel=1e-6)
    assert linear.model.value([*own, best]) == pytest.approx(more, rel=1e-9)
    gone = [found.names.index(name) for name in found.spare]
    left = [one for number, one in enumerate(own) if number not in gone]
    assert value <= linear.model.value(left) <= 1.01 * value
    assert ((found.unobserved >= 0.0) & (found.unobserved + found.off <= 1.0 + 1e-9)).all()
    page = page_html(Page("gauges", (), (layout_section(found),)))
    assert all(name in page for name in found.names)
    assert f"Would help most: {found.best[0]}" in page
    assert "alike all round (axial load)" in found.hidden[0]
    assert found.hidden[0].startswith(f"C_A: {100.0 * found.unobserved[0]:.0f} % of its variance is not observed")
    assert all(line in page for line in found.hidden)


def test_pressure_behind_a_normal_force_is_never_alike_all_round(nonlinear: Study) -> None:
    """Pressure alike all round makes no normal force; it goes with errors of the flight state, which are named."""
    hidden = dict(zip(COEFFICIENT_NAMES, review_of(nonlinear).hidden, strict=True))
    for name in ("C_N", "C_Y", "M_P", "M_Y"):
        assert "(axial load)" not in hidden[name], hidden[name]
    assert "the flight state within the air data" in hidden["C_N"]


@pytest.mark.slow
def test_a_review_follows_the_map_next_to_the_snapshots(
    nonlinear_vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel, tmp_path: Path
) -> None:
    """Whatever the vehicle file says; the page names estimator, version, and the files that it judged by hash."""
    file = write_changed(tmp_path, ('estimator = "nonlinear"', 'estimator = "auto"'), *COARSE_ENTRIES)
    save_snapshots(snapshots, tmp_path / "snapshots.h5")
    problem = inverse_problem(nonlinear_vehicle, snapshots, structure)
    built = build_inverse_map(nonlinear_vehicle, snapshots, structure, problem=problem)
    with_tables = with_manifold(built, nonlinear_vehicle, snapshots, structure, problem=problem)
    files = (file.name, "snapshots.h5", "map.h5")

    def reviewed(kind: Kind | None = None) -> tuple[Review, str]:
        page, grid = tmp_path / "review.html", replace(GRID, stations=(1.0, 2.0))
        arguments = {"grid": grid, "kind": kind, "reporter": Silent(), "snapshots_path": tmp_path / "snapshots.h5"}
        return review_layout(file, None, page, **arguments), page.read_text(encoding="utf-8")

    for of_map, kind in ((with_tables, "nonlinear"), (with_tables.without_tables(), "linear")):
        save_inverse_map(of_map, tmp_path / "map.h5")
        found, page = reviewed()
        assert found.kind == kind
        assert f"estimator: {kind}, " in page
        assert f"{len(found.names)} gauges, {kind} estimator, at flight states" in page
        assert f"Made by strainfmu {__version__} on " in page
        for name in files:
            assert sha256((tmp_path / name).read_bytes()).hexdigest() in page
    found, page = reviewed("nonlinear")
    assert found.kind == "nonlinear"
    assert "map.h5" not in page
    (tmp_path / "map.h5").unlink()
    found, page = reviewed()
    assert found.kind == "nonlinear"


def test_auto_is_linear_where_the_flows_allow_no_tables(
    vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> None:
    auto = vehicle.model_copy(update={"map": vehicle.map.model_copy(update={"estimator": "auto"})})
    grid, few = replace(GRID, stations=(1.0,)), snapshots.chosen(np.arange(8))
    assert placement_study(auto, snapshots, structure, grid).kind == "nonlinear"
    assert placement_study(auto, few, structure, grid).kind == "linear"
    with pytest.raises(InputError):
        placement_study(auto, few, structure, grid, "nonlinear")
