"""The terms of the noise covariance: each by the book, together, and in what they do to an estimate."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from inverse_case import Case, cross_covariance, noise_model
from state_estimates import load_gain_of

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.noise.hardware_errors import strain_derivatives
from builder.inverse.noise.model import (
    NoiseModel,
    NoiseTerm,
    gauge_errors,
    gauge_noise,
    nuisance_modes,
    truncated_modes,
)
from builder.inverse.problem import (
    check_noise,
    gauge_covariance,
    gauge_noise_covariance,
    inverse_problem,
    nuisance_terms,
)
from builder.reports.findings.coefficient_sources import load_covariance_by_terms
from builder.structure.fourier.fourier_model import StructuralModel
from builder.structure.fourier.inner_surface import place_gauges
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.fourier.strain_operator import harmonic_response, strain_operator
from builder.structure.wall import wall_of
from builder.vehicle.file import Vehicle
from builder.vehicle.map_options import Noise
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.reference.gain import load_covariance
from strainfmu.linear.state_map import least_squares_map

pytestmark = pytest.mark.fast

N_MODES = 5


def test_truncated_modes_have_the_strain_and_load_of_their_snapshots(case: Case, snapshots: Snapshots) -> None:
    """Their joint covariance is that of the snapshots less what the kept modes explain: 1e-10."""
    centred = snapshots.pressure - case.modes.mean
    kept = case.modes.modes[:, :N_MODES]
    rest = centred - centred @ kept @ kept.T
    strain, load = rest @ case.strain_operator.T, rest @ case.loads.T
    operators = (case.strain_operator @ case.modes.modes, case.loads @ case.modes.modes)
    term = truncated_modes(*operators, case.modes, N_MODES)
    assert term.load is not None
    for found, expected in (
        (term.covariance, strain.T @ strain),
        (term.strain @ term.load.T, strain.T @ load),
        (term.load @ term.load.T, load.T @ load),
    ):
        size = np.abs(expected).max() / (len(rest) - 1)
        np.testing.assert_allclose(found, expected / (len(rest) - 1), rtol=0.0, atol=1e-10 * size)


def test_shares_add_up_and_name_every_term(case: Case) -> None:
    """Whitened fractions sum to 1; the mean square strains to the trace of Gamma; of gauge noise alone it is 1."""
    model = noise_model(case, N_MODES)
    model = NoiseModel((*model.terms, nuisance_modes("heat", np.ones((54, 1)), np.array([1e-6]))))
    rows = model.fractions()
    assert [row["name"] for row in rows] == ["gauge noise", "truncated modes", "heat"]
    assert sum(row["share"] for row in rows) == pytest.approx(1.0, rel=1e-10)
    assert sum(row["rms_strain"] ** 2 for row in rows) == pytest.approx(np.trace(model.covariance) / 54, rel=1e-10)
    assert rows[2]["rms_strain"] == pytest.approx(1e-6, rel=1e-12)
    alone = noise_model(case, N_MODES, with_truncated=False).fractions()
    assert alone[0]["share"] == pytest.approx(1.0, rel=1e-12)


def test_full_covariance_is_kept_as_given() -> None:
    root = np.random.default_rng(1).normal(size=(6, 6))
    term = gauge_noise(root @ root.T)
    np.testing.assert_allclose(term.covariance, root @ root.T, rtol=1e-12)
    with pytest.raises(InputError, match="symmetric and positive definite"):
        gauge_noise(root)


def test_errors_of_each_gauge_are_columns_of_a_diagonal() -> None:
    """In every use: covariance, gain, whitening, draws, rows beside, strain and load."""
    random = np.random.default_rng(6)
    own = gauge_errors("gain", 1e-4 * random.normal(size=(20, 4)), 0.01)
    columns = replace(own, strain=np.diag(own.strain))
    gain = random.normal(size=(3, 4))
    assert own.is_own
    assert not columns.is_own
    for a, b in (
        (own.covariance, columns.covariance),
        (own.columns, columns.columns),
        (own.by_gain(gain), columns.by_gain(gain)),
        (own.whitened(gain.T), columns.whitened(gain.T)),
        (own.padded(1, 2).covariance, columns.padded(1, 2).covariance),
        (own.strain_and_load(5), columns.strain_and_load(5)),
        (own.draw(np.random.default_rng(1), 3), columns.draw(np.random.default_rng(1), 3)),
    ):
        np.testing.assert_allclose(a, b, rtol=1e-12)


def test_marginalised_nuisance_is_that_estimated_along_and_dropped(case: Case) -> None:
    """States from Gamma + N N' equal those of least squares over states and nuisance with its prior: 1e-8."""
    z, std = case.strain_operator @ case.modes.modes[:, :N_MODES], case.noise_std
    random = np.random.default_rng(3)
    columns, spread = random.normal(size=(54, 3)), np.array([1e-6, 3e-6, 1e-5])
    covariance = NoiseModel((gauge_noise(np.diag(std**2)), nuisance_modes("heat", columns, spread))).covariance
    scale = case.modes.coefficient_std[:N_MODES]
    marginal = least_squares_map(z, np.zeros(54), covariance, scale)
    joint = np.block(
        [[z * scale / std[:, None], columns * spread / std[:, None]], [np.zeros((3, N_MODES)), np.eye(3)]]
    )
    strain = 1e-5 * random.normal(size=54)
    solution = np.linalg.lstsq(joint, np.concatenate([strain / std, np.zeros(3)]), rcond=None)[0]
    np.testing.assert_allclose(marginal.strain_gain @ strain, scale * solution[:N_MODES], rtol=1e-8)


def test_thermal_strain_is_covered_with_its_term_and_not_without(case: Case) -> None:
    """10 um/m rms of apparent strain common to all gauges (4,000 draws): 3 sigma 99.73 % (-0.4) against < 95 %."""
    per_state = case.loads @ case.modes.modes[:, :N_MODES]
    z = case.strain_operator @ case.modes.modes[:, :N_MODES]
    random = np.random.default_rng(4)
    heat = nuisance_modes("heat", np.ones((54, 1)), np.array([1e-5]))
    default = noise_model(case, N_MODES)
    states = random.normal(size=(4000, case.modes.modes.shape[1])) * case.modes.coefficient_std
    strain = states @ (case.strain_operator @ case.modes.modes).T
    strain += random.normal(size=strain.shape) * case.noise_std + 1e-5 * random.normal(size=(4000, 1))
    truth = states @ (case.loads @ case.modes.modes).T
    coverage = []
    for model in (NoiseModel((*default.terms, heat)), default):
        solved = least_squares_map(z, np.zeros(54), model.covariance, case.modes.coefficient_std[:N_MODES])
        std = np.sqrt(np.diag(load_covariance_by_terms(solved, per_state, model)))
        error = np.abs(strain @ solved.strain_gain.T @ per_state.T - truth)
        coverage.append((error < 3.0 * std).mean(axis=0))
    assert np.all(coverage[0] > 0.9973 - 0.004)
    assert coverage[1].min() < 0.95


def test_gain_errors_have_the_variance_of_draws() -> None:
    """d -> (1 + g) d over 20 flights, 20,000 draws of 1 %: covariance diagonal, variances within 5 %."""
    random = np.random.default_rng(5)
    strain = 1e-4 * random.normal(size=(20, 4))
    term = gauge_errors("gauge gain", strain, 0.01)
    gains = 0.01 * random.normal(size=(20_000, 1, 4))
    drawn = (gains * strain).reshape(-1, 4)
    expected = drawn.T @ drawn / len(drawn)
    found = term.covariance
    size = np.sqrt(np.outer(*2 * [np.diag(found)]))
    np.testing.assert_allclose(found / size, expected / size, rtol=0.0, atol=0.05)


@pytest.fixture(scope="module")
def derivatives(vehicle: Vehicle, structure: StructuralModel) -> dict[str, FloatArray]:
    names = {"axial": "axial_shift", "circumferential": "circumferential_shift", "orientation": "orientation"}
    found = strain_derivatives(vehicle, structure, vehicle.gauges.layout, [(one, 0) for one in names.values()])
    return {name: found[kind, 0] for name, kind in names.items()}


@pytest.mark.parametrize(
    ("error", "size"), [("axial", 2e-3), ("circumferential", 2e-3), ("orientation", np.deg2rad(0.1))]
)
def test_derivatives_predict_gauges_moved_in_body_axes(
    error: str,
    size: float,
    vehicle: Vehicle,
    structure: StructuralModel,
    snapshots: Snapshots,
    case: Case,
    derivatives: dict[str, FloatArray],
) -> None:
    """Positions and directions changed in body axes, placed and solved again: change of strain within 5 %."""
    layout, placed = structure.layouts["configuration_2"], structure.placed["configuration_2"]
    resolution, wall = vehicle.resolution.map, wall_of(vehicle)
    mesh = shell_mesh(vehicle.body(), wall, 1e-3 * resolution.element_length_mm, resolution.wall_layers)
    radial = np.stack([np.zeros(54), np.sin(placed.roll_angle), np.cos(placed.roll_angle)], axis=1)
    around = np.stack([np.zeros(54), np.cos(placed.roll_angle), -np.sin(placed.roll_angle)], axis=1)
    slope = np.tan(np.radians(np.where(placed.x < 1.75, 5.0, 1.0)))[:, None]
    aft = (np.array([1.0, 0.0, 0.0]) + slope * radial) / np.sqrt(1.0 + slope**2)
    position, direction = layout.position.copy(), layout.direction.copy()
    if error == "axial":
        position += size * aft
    elif error == "circumferential":
        position += size * around
        direction = placed.meridional[:, None] * aft + placed.circumferential[:, None] * _around(position)
    else:
        c, s = np.cos(size), np.sin(size)
        m, h = placed.meridional[:, None], placed.circumferential[:, None]
        direction = (c * m - s * h) * aft + (s * m + c * h) * around
    moved = place_gauges(mesh, position, direction)
    response = harmonic_response(mesh, wall.material, moved.x, structure.surface.x, resolution.harmonics)
    net = snapshots.pressure[::9] - case.internal_pressure
    exact = net @ (strain_operator(response, moved, structure.surface) - case.strain_operator).T
    predicted = size * net @ derivatives[error].T
    # The nearest station to the slope break, 4 mm from it, bends within the step.
    away = np.abs(placed.x - 1.75) > 0.1
    assert np.linalg.norm((predicted - exact)[:, away]) < 0.05 * np.linalg.norm(exact[:, away])


def _around(position: np.ndarray) -> np.ndarray:
    """The circumferential directions at positions."""
    roll = np.arctan2(position[:, 1], position[:, 2])
    return np.stack([np.zeros(len(roll)), np.cos(roll), -np.sin(roll)], axis=1)


@pytest.mark.parametrize(
    ("error", "size"), [("gain", 0.01), ("circumferential", 2e-3), ("orientation", np.deg2rad(1.0))]
)
def test_gauge_errors_are_covered_with_their_term_and_not_without(
    error: str,
    size: float,
    snapshots: Snapshots,
    held_out: Snapshots,
    case: Case,
    derivatives: dict[str, FloatArray],
) -> None:
    """1 %, 2 mm, 1 deg at every gauge, 200 draws of gauges, 24 flights that no snapshot holds.

    3 sigma hold 99 % of each load with the term, and less than 95 % of some load without.
    """
    sensitivity = case.strain_operator if error == "gain" else derivatives[error]
    term = gauge_errors(error, (snapshots.pressure - case.internal_pressure) @ sensitivity.T, size)
    random, net = np.random.default_rng(6), held_out.pressure - case.internal_pressure
    mean = case.modes.mean - case.internal_pressure
    strain = ((net - mean) @ case.strain_operator.T)[:, None] + case.noise_std * random.normal(size=(24, 200, 54))
    strain = strain + size * random.normal(size=(200, 54)) * (net @ sensitivity.T)[:, None]
    truth = ((net - mean) @ case.loads.T)[:, None]
    per_state = case.loads @ case.modes.modes[:, :N_MODES]
    z, default = case.strain_operator @ case.modes.modes[:, :N_MODES], noise_model(case, N_MODES)
    coverage = []
    for model in (NoiseModel((*default.terms, term)), default):
        solved = least_squares_map(z, np.zeros(54), model.covariance, case.modes.coefficient_std[:N_MODES])
        x = cross_covariance(model)
        gain = load_gain_of(solved, per_state, x)
        std = np.sqrt(np.diag(load_covariance_by_terms(solved, per_state, model, x)))
        coverage.append((np.abs(strain @ gain.T - truth) < 3.0 * std).mean(axis=(0, 1)))
    assert np.all(coverage[0] >= 0.99)
    assert coverage[1].min() < 0.95


def test_entries_of_the_vehicle_file_become_terms(
    paper_vehicle: Vehicle,
    snapshots: Snapshots,
    structure: StructuralModel,
    case: Case,
    derivatives: dict[str, FloatArray],
) -> None:
    """Without hardware errors gauge noise alone; every entry adds its term with its standard deviation."""

    def terms_of(entry: Noise) -> dict[str, NoiseTerm]:
        changed = paper_vehicle.model_copy(update={"noise": entry})
        return {term.name: term for term in inverse_problem(changed, snapshots, structure).noise}

    assert list(terms_of(paper_vehicle.noise)) == ["gauge noise"]
    sizes = {
        "apparent_strain_um_per_m": 10.0,
        "gauge_gain_percent": 1.0,
        "gauge_position_mm": 2.0,
        "gauge_orientation_deg": 1.0,
    }
    terms = terms_of(paper_vehicle.noise.model_copy(update=sizes))
    net = snapshots.pressure - case.internal_pressure
    expected = {
        "gauge gain": 0.01 * case.strain_operator,
        "gauge position, axial": 2e-3 * derivatives["axial"],
        "gauge position, circumferential": 2e-3 * derivatives["circumferential"],
        "gauge orientation": np.deg2rad(1.0) * derivatives["orientation"],
    }
    assert list(terms) == ["gauge noise", *expected, "apparent strain"]
    for name, operator in expected.items():
        rms = np.sqrt(np.mean((net @ operator.T) ** 2, axis=0))
        np.testing.assert_allclose(terms[name].strain, rms, rtol=1e-10)
    np.testing.assert_allclose(terms["apparent strain"].strain, np.full((54, 1), 1e-5), rtol=1e-12)


NUISANCE = "gauge, hot nose, hot wall\nG2, 3, -4\nG1, 1, 2\n\nG3, 0.5, 0\n"


def test_nuisance_file_is_a_term_per_column(tmp_path: Path) -> None:
    """Rows in any order; a column is the strain of its mode at one standard deviation."""
    (tmp_path / "heat.csv").write_text(NUISANCE)
    terms = nuisance_terms(tmp_path / "heat.csv", ("G1", "G2", "G3"))
    assert [term.name for term in terms] == ["hot nose", "hot wall"]
    np.testing.assert_allclose(terms[0].strain, [[1e-6], [3e-6], [0.5e-6]], rtol=1e-12)
    np.testing.assert_allclose(terms[1].strain, [[2e-6], [-4e-6], [0.0]], rtol=1e-12)
    assert terms[0].load is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "no such file"),
        ("", "expected the columns gauge and a name per mode, got nothing"),
        ("G1, 1, 2\n", "expected the columns gauge and a name per mode, got none of them"),
        ("gauge\nG1\n", "expected the columns gauge and a name per mode, got gauge"),
        ("gauge, a, a\nG1, 1, 2\n", "got gauge, a, a"),
        (NUISANCE.replace("G3, 0.5, 0", ""), "gauge 'G3' of the layout in use is missing"),
        (NUISANCE + "G4, 1, 1\n", "gauge 'G4' is not in the layout in use"),
        (NUISANCE + "G1, 1, 1\n", "a gauge is listed twice"),
        (NUISANCE.replace("0.5, 0", "0.5"), "gauge 'G3': 1 values found, must be 2"),
        (NUISANCE.replace("0.5", "half"), "gauge 'G3':  half,  0 found, must be numbers"),
        (NUISANCE.replace("0.5", "nan"), "gauge 'G3':  nan,  0 found, must be finite"),
    ],
)
def test_nuisance_files_that_do_not_fit_are_refused(text: str | None, message: str, tmp_path: Path) -> None:
    if text is not None:
        (tmp_path / "heat.csv").write_text(text)
    with pytest.raises(InputError, match=rf"noise.nuisance_file: .*heat.csv.*{re.escape(message)}"):
        nuisance_terms(tmp_path / "heat.csv", ("G1", "G2", "G3"))


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"nuisance_file": "none.csv"}, "noise.nuisance_file: .*none.csv: no such file"),
        ({"covariance_file": "none.csv", "percent_of_median_strain": None}, "noise.covariance_file: .*none.csv"),
        ({"std_of_gauges_um_per_m": [1.0], "percent_of_median_strain": None}, "1 values found, must be 54"),
    ],
)
@pytest.mark.parametrize("model", ["fourier", "solid"])
def test_noise_that_does_not_fit_is_refused_before_anything_is_solved(
    model: str, entries: dict[str, Any], message: str, vehicle: Vehicle
) -> None:
    entry = vehicle.noise.model_copy(update=entries)
    structure = vehicle.structure.model_copy(update={"model": model})
    check_noise(vehicle.model_copy(update={"structure": structure}))
    with pytest.raises(InputError, match=message):
        check_noise(vehicle.model_copy(update={"structure": structure, "noise": entry}))


def test_nuisance_file_of_a_vehicle_is_listed_and_widens_the_uncertainty(
    tmp_path: Path, paper_vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> None:
    """Nose hotter than base, 20 um/m at the first station: the map holds the term with its fraction."""
    layout = structure.layouts["configuration_2"]
    strain = 20.0 * (1.0 - layout.position[:, 0] / 3.6)
    rows = [f"{name},{value:.6f}" for name, value in zip(layout.names, strain, strict=True)]
    (tmp_path / "heat.csv").write_text("\n".join(["gauge,hot nose", *rows]))
    entry = paper_vehicle.noise.model_copy(update={"nuisance_file": str(tmp_path / "heat.csv")})
    plain = build_inverse_map(paper_vehicle, snapshots, structure)
    warm = build_inverse_map(paper_vehicle.model_copy(update={"noise": entry}), snapshots, structure)
    terms = {term["name"]: term for term in warm.provenance["noise_terms"]}
    assert list(terms) == ["gauge noise", "hot nose", "truncated modes"]
    assert terms["hot nose"]["rms_strain"] == pytest.approx(1e-6 * np.sqrt(np.mean(strain**2)), rel=1e-5)
    assert load_covariance(warm)[0, 0] > 1.05 * load_covariance(plain)[0, 0]
    np.testing.assert_array_equal(warm.noise_std, plain.noise_std)


def test_gauge_noise_one_number_one_per_gauge_or_a_file(
    tmp_path: Path, vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> None:
    entry = Noise(std_of_gauges_um_per_m=[0.1, 0.2, 0.3])
    np.testing.assert_allclose(
        gauge_covariance(entry, 3, 0.0, tmp_path), np.diag([1e-14, 4e-14, 9e-14]), rtol=1e-12
    )
    with pytest.raises(InputError, match=r"noise.std_of_gauges_um_per_m: 3 values found, must be 4"):
        gauge_covariance(entry, 4, 0.0, tmp_path)
    file = Noise(covariance_file="gamma.csv")
    (tmp_path / "gamma.csv").write_text("0.04, 0.01\n0.01, 0.09\n")
    expected = np.array([[4e-14, 1e-14], [1e-14, 9e-14]])
    np.testing.assert_allclose(gauge_covariance(file, 2, 0.0, tmp_path), expected, rtol=1e-12)
    relative = Noise(percent_of_median_strain=1.0)
    np.testing.assert_allclose(gauge_covariance(relative, 2, 4e-5, tmp_path), np.diag([1.6e-13] * 2), rtol=1e-12)
    with pytest.raises(InputError, match="the median strain is 0"):
        gauge_covariance(relative, 2, 0.0, tmp_path)
    # The layout that relative noise refers to need not be the one in use.
    fewer = vehicle.gauges.model_copy(update={"layout": "configuration_1"})
    small = gauge_noise_covariance(vehicle.model_copy(update={"gauges": fewer}), snapshots, structure)
    assert small.shape == (27, 27)
    assert small[0, 0] == pytest.approx(gauge_noise_covariance(vehicle, snapshots, structure)[0, 0], rel=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "no such file"),
        ("", "1 x 0 found, must be 2 x 2"),
        ("1, a\n0, 1\n", "not a table of numbers"),
        ("1, 0, 0\n0, 1, 0\n", "2 x 3 found, must be 2 x 2"),
        ("1, 2\n2, 1\n", "no covariance: must be symmetric and positive definite"),
        ("1, 0.1\n0.2, 1\n", "no covariance"),
        ("1, nan\nnan, 1\n", "no covariance"),
    ],
)
def test_covariance_files_that_are_none_are_refused(text: str | None, message: str, tmp_path: Path) -> None:
    if text is not None:
        (tmp_path / "gamma.csv").write_text(text)
    with pytest.raises(InputError, match=rf"noise.covariance_file: .*gamma.csv: .*{message}"):
        gauge_covariance(Noise(covariance_file="gamma.csv"), 2, 0.0, tmp_path)


def test_nuisance_that_is_no_numbers_is_refused() -> None:
    with pytest.raises(InputError, match="noise term 'heat': values must be finite"):
        nuisance_modes("heat", np.full((4, 1), np.nan), np.ones(1))
    with pytest.raises(InputError, match="standard deviations at least 0"):
        nuisance_modes("heat", np.ones((4, 1)), -np.ones(1))
    with pytest.raises(InputError, match=r"strain \(4, 1\), std \(2,\) found"):
        nuisance_modes("heat", np.ones((4, 1)), np.ones(2))


def test_a_model_without_gauge_noise_has_no_shares() -> None:
    model = NoiseModel((nuisance_modes("heat", np.ones((4, 1)), np.ones(1)),))
    with pytest.raises(InputError, match="positive definite"):
        model.fractions()
