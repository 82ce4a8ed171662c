"""Case 1 and Case 2 studies on a small model, against what must hold for any."""

import numpy as np
import pytest

from builder.aero.load_operator import load_operator
from builder.reproduce.case_1 import case_1_map, field_example, pod_of, study_case_1
from builder.reproduce.case_2 import case_2_map, load_readings, odd_part, study_field, study_gamma
from builder.reproduce.measurements import class_rows, crime_rows, hoop_rows, reading_rows, scatter_rows
from builder.reproduce.paper_readings import SHIPPED, gauges_of_45, with_all_gauges
from builder.reproduce.protocol import P1, QUICK, sized
from builder.reproduce.setups import SAME_MESH, Pressures, SetUp, noise_sigma
from builder.reproduce.strain_models import StrainModel, fourier_model
from builder.vehicle.file import IC3X, Vehicle, load_vehicle
from builder.vehicle.shape.geometry import SurfaceGrid, surface_grid
from strainfmu.linear.pressure_modes import prior_of_snapshots

INSIDE = 5474.9


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return with_all_gauges(sized(load_vehicle(IC3X), QUICK))


@pytest.fixture(scope="module")
def grid(vehicle: Vehicle) -> SurfaceGrid:
    return surface_grid(vehicle.body(), QUICK.surface_stations, QUICK.surface_roll_angles)


@pytest.fixture(scope="module")
def model(vehicle: Vehicle) -> StrainModel:
    return fourier_model(vehicle)


def smooth_fields(grid: SurfaceGrid, alpha_beta: list[tuple[float, float]], mach: list[float]) -> np.ndarray:
    """Return pressures [Pa] that rise with incidence towards the wind, with waves up to four round the body."""
    fields = []
    for (alpha, beta), m in zip(alpha_beta, mach, strict=True):
        total, to_wind = np.hypot(alpha, beta), np.arctan2(beta, -alpha)
        away = grid.roll_angle - to_wind
        along = 1.0 - 0.4 * (grid.x > 1.75) - 0.1 * grid.x / 3.6
        wave = 1.0 + 0.06 * total * np.cos(away) + 0.005 * total**2 * np.cos(2 * away)
        wave = wave + 0.002 * total**1.5 * np.cos(4 * away)
        fields.append(INSIDE * (0.3 + 0.04 * m**2 * np.outer(along, wave)).ravel())
    return np.array(fields)


@pytest.fixture(scope="module")
def pressures(vehicle: Vehicle, grid: SurfaceGrid) -> Pressures:
    p1 = [np.degrees([c.angle_of_attack, c.sideslip_angle]) for c in P1.conditions]
    p2 = [(a, b) for _ in range(3) for a in range(-8, 9, 2) for b in range(-8, 9, 2)]
    reference = vehicle.reference_quantities()
    of_p2 = smooth_fields(grid, p2, [5.0] * 81 + [6.0] * 81 + [7.0] * 81)
    examples = smooth_fields(grid, [(6, 5), (2, 8), (6, 6), (0, 5)], [5, 7, 5, 6])
    return Pressures(
        p1=smooth_fields(grid, [tuple(one) for one in p1], [c.mach_number for c in P1.conditions]),
        p2=of_p2,
        held_out=of_p2[:40],
        examples=examples,
        fine_examples=examples,
        internal=INSIDE,
        loads=load_operator(grid, reference.moment_station),
        weights=np.ones(grid.n_nodes),
        reference=reference,
    )


@pytest.fixture(scope="module")
def setup(model: StrainModel, pressures: Pressures) -> SetUp:
    return SetUp(key=SAME_MESH, inversion=model, data=model, sigma=noise_sigma(model, pressures.p1 - INSIDE))


def test_field_errors_without_fields_are_those_of_the_fields(setup: SetUp, pressures: Pressures) -> None:
    modes = pod_of(pressures.p1, None)
    of = case_1_map(modes, setup, SHIPPED.configuration(2), INSIDE)
    example = field_example(of, pressures.examples[0], INSIDE)
    written_out = np.linalg.norm(example.estimate - example.reference) / np.linalg.norm(example.reference)
    assert example.shown == pytest.approx(written_out, rel=1e-9)
    assert example.errors.min() <= example.shown <= example.errors.max()


def test_noise_bound_covers_where_the_modes_hold_the_field(setup: SetUp, pressures: Pressures) -> None:
    modes = pod_of(pressures.p1, None)
    of = case_1_map(modes, setup, SHIPPED.configuration(2), INSIDE)
    within = modes.mean + modes.coefficients(pressures.p1)[:, :5] @ of.basis.T
    study = study_case_1(of, pressures, within, P1.conditions)
    # 22,500 differences, 99.73 % of them: 0.0027 +- 3 sqrt(0.0027 / 22500).
    assert study.covered.mean() == pytest.approx(0.9973, abs=0.0011)
    assert np.abs(study.truncation).max() < 1e-12
    # The same gauges with a truncated part of the field: the bound of the noise alone no longer covers.
    assert study_case_1(of, pressures, pressures.p1, P1.conditions).covered.min() < 0.99


def test_gauge_readings_without_noise_give_the_prior_sample_back(
    setup: SetUp, pressures: Pressures, grid: SurfaceGrid
) -> None:
    # On the exactly symmetric model the doubly odd part stays hidden, whatever gamma is; the rest comes back.
    prior = prior_of_snapshots(pressures.p2)
    of = case_2_map(prior, setup, SHIPPED.configuration(2), INSIDE)
    found = study_field(of, pressures.examples[2], 1e-6, False, grid, load_readings(2.0))
    assert found.shown == pytest.approx(found.odd_fraction[1], rel=0.05)
    # Round-off of the hidden eigenvalues, over gamma, is 0.3 % here.
    assert found.odd_fraction[1] == pytest.approx(found.odd_fraction[0], rel=0.02)
    without = study_field(of, pressures.examples[3], 1e-6, False, grid, load_readings(2.0))
    assert without.odd_fraction[0] < 1e-12
    assert without.shown < 0.1 * found.shown
    # C_N and M_P are 0 at zero incidence: no relative error there.
    assert np.isnan(without.load_error[:, [1, 3], 0]).all()
    assert np.isfinite(without.load_error[:, [0, 2, 4], 0]).all()


def test_gamma_over_the_snapshots_is_the_expected_one(setup: SetUp, pressures: Pressures) -> None:
    prior = prior_of_snapshots(pressures.p2)
    of = case_2_map(prior, setup, SHIPPED.configuration(2), INSIDE)
    strain = (pressures.p2 - INSIDE) @ of.data_operator.T
    rules = study_gamma(of, strain, strain[0]).by_rule
    # The snapshots are the prior but for (N - 1)/N; 12,150 draws settle the misfit of 54 to 0.1 %.
    assert rules["morozov"] == pytest.approx(rules["morozov, expected"], rel=0.1)
    assert rules["morozov"] > rules["corrected_discrepancy"]


def test_odd_part_is_a_projection_onto_sines_of_even_harmonics(grid: SurfaceGrid) -> None:
    phi = grid.roll_angle

    def field(values: np.ndarray) -> np.ndarray:
        return np.outer(1.0 + grid.x, values).ravel()

    for hidden in (np.sin(2 * phi), np.sin(4 * phi)):
        np.testing.assert_allclose(odd_part(field(hidden), grid), field(hidden), atol=1e-12)
    for observable in (np.ones_like(phi), np.cos(phi), np.sin(phi), np.cos(2 * phi), np.sin(3 * phi)):
        np.testing.assert_allclose(odd_part(field(observable), grid), 0.0, atol=1e-12)
    random = np.random.default_rng(2).normal(size=grid.n_nodes)
    np.testing.assert_allclose(odd_part(odd_part(random, grid), grid), odd_part(random, grid), atol=1e-13)


def test_published_layout_is_blind_and_45_is_not(
    model: StrainModel, vehicle: Vehicle, pressures: Pressures, grid: SurfaceGrid
) -> None:
    prior = prior_of_snapshots(pressures.p2)
    layouts = {"published": SHIPPED.configuration(2), "45": gauges_of_45(load_vehicle(IC3X))}
    area = np.repeat(grid.radius, grid.n_roll)
    rows = {(row.layout, row.symmetry): row for row in class_rows(model, layouts, prior, grid, area)}
    hidden = "odd in y, odd in z"
    assert rows["published", hidden].rank == 0
    assert rows["published", hidden].response < 1e-9 * rows["published", "even in y, odd in z"].response
    assert rows["45", hidden].rank > 0
    assert sum(row.prior_fraction for row in rows.values()) == pytest.approx(2.0, rel=1e-9)


def test_measurements_of_a_model_against_itself(
    model: StrainModel, pressures: Pressures, grid: SurfaceGrid
) -> None:
    row = hoop_rows({"itself": model}, model, pressures)[0]
    assert (row.hoop_gain, row.axial_gain) == pytest.approx((1.0, 1.0), rel=1e-12)
    assert row.hoop_error == pytest.approx(0.0, abs=1e-12)
    crime = crime_rows(
        [(model, model)], SHIPPED.configuration(2), prior_of_snapshots(pressures.p2), pressures, grid
    )[0]
    assert crime.odd_strain < 1e-12


def test_second_row_of_gauges_never_makes_the_condition_worse_than_its_root(
    model: StrainModel, pressures: Pressures
) -> None:
    # sigma_min of more rows is no smaller, |d| grows by sqrt(2): K2 <= sqrt(2) K1.
    rows = reading_rows({"fourier": model}, pressures)
    assert len(rows) == 8
    assert all(row.k_2 <= np.sqrt(2.0) * row.k_1 * (1.0 + 1e-12) for row in rows)
    # Readings with the hoop gauges on the same axis have one and the same Configuration 2.
    assert np.ptp([row.k_2 for row in rows[:4]]) < 1e-6 * rows[0].k_2


def test_scatter_of_the_snapshots_lifts_the_smallest_eigenvalues(model: StrainModel, pressures: Pressures) -> None:
    plain, scattered = scatter_rows(model, SHIPPED.configuration(2), pressures, [0.0, 1e-2])
    assert plain.above < scattered.above
    assert plain.smallest < scattered.smallest
