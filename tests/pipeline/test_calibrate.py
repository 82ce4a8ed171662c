"""From a map and the files of a simulated ground test to the calibrated map, by the command."""

import re
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from builder.calibration.ground_test.load_test import LoadErrors
from builder.calibration.score.simulated_test import simulate_ground_test, standard_load_cases, write_ground_test
from builder.campaign.snapshots import save_snapshots
from builder.pipeline.calibrate import calibrate
from builder.pipeline.stages import build_map, take_snapshots
from builder.structure.as_built.as_built_structure import as_built_structure
from builder.structure.as_built.as_built_vehicle import as_built_std, draw_as_built
from builder.vehicle.file import IC3X, load_vehicle
from strainfmu.cosim.estimators.zeros_file import load_zeros
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.map.inverse_map import load_inverse_map, save_inverse_map
from strainfmu.estimator.reference.gain import load_covariance

pytestmark = pytest.mark.slow

COARSE = """[resolution.map]
radial_cells = 12
circumferential_cells = 16
surface_stations = 40
surface_roll_angles = 24
harmonics = 10
element_length_mm = 40.0
wall_layers = 1

"""


def coarse_vehicle_file(folder: Path) -> Path:
    text = IC3X.read_text(encoding="utf-8")
    text = re.sub(r"\[resolution\.map\].*?(?=\[resolution\.truth\])", COARSE, text, flags=re.DOTALL)
    text = text.replace('engine = "euler"', 'engine = "newtonian"')
    text = text.replace('estimator = "nonlinear"', 'estimator = "linear"')
    text = text.replace('manoeuvre = "ic3x', f'manoeuvre = "{IC3X.parent.as_posix()}/ic3x')
    path = folder / "vehicle.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_ground_test_calibrates_a_map(tmp_path: Path) -> None:
    file = coarse_vehicle_file(tmp_path)
    vehicle = load_vehicle(file)
    snapshots = take_snapshots(vehicle)
    save_snapshots(snapshots, tmp_path / "snapshots.h5")
    before = build_map(vehicle, snapshots=snapshots)
    save_inverse_map(before, tmp_path / "map.h5")
    structure = as_built_structure(vehicle, vehicle.gauges.layout)
    random = np.random.default_rng(3)
    std = as_built_std(vehicle.calibration, structure.counts)
    built, errors = draw_as_built(std, random), LoadErrors(common=0.002)
    cases = standard_load_cases(10, vehicle.body().length)
    test = simulate_ground_test(
        structure,
        built,
        cases,
        errors,
        np.full(structure.n_gauges, 0.25e-6),
        random=random,
    )
    test.strain[..., 7] *= -1.0
    written = write_ground_test(test, tmp_path, "simulated")
    output = tmp_path / "calibrated.h5"
    result = calibrate(tmp_path / "map.h5", written, output, vehicle=file)
    assert [(fault.where, fault.kind) for fault in result.faults] == [(structure.gauges.names[7], "sign")]
    assert result.estimate.per_reading == pytest.approx(1.0, abs=0.15)  # one standard deviation is 0.07
    found = load_inverse_map(output)
    zeros = load_zeros(tmp_path / "calibrated_zeros.toml", found.gauge_names)
    np.testing.assert_allclose(zeros.value, result.estimate.parameters.zero, atol=1e-15)
    assert any("calibrated_zeros.toml has them for other maps (--zeros)" in line for line in result.notes)
    truth = structure.strain_operator(built)
    after = structure.strain_operator(result.estimate.parameters)
    drawing = structure.strain_operator(structure.exactly_built())
    assert np.abs(after - truth).max() < 0.4 * np.abs(drawing - truth).max()
    assert found.provenance["calibration"]["faults"] == [result.faults[0].line]
    names = {one["name"] for one in found.provenance["noise_terms"]}
    assert names >= {"ground test, of each gauge", "ground test, in common"}
    assert "gauge gain" not in names
    assert np.trace(load_covariance(found)) < np.trace(load_covariance(before))
    page = output.with_suffix(".html").read_text(encoding="utf-8")
    assert result.verdict is not None
    assert result.verdict.title in page
    held = found.provenance["calibration"]["verdict"]
    assert held == result.verdict.facts
    assert held["accepted"] == all(one["holds"] for one in held["criteria"])
    for path in (written, tmp_path / "loadtest.csv", tmp_path / "channels.toml", file, tmp_path / "map.h5"):
        assert sha256(path.read_bytes()).hexdigest() in page
    assert output.with_suffix(".pdf").read_bytes().startswith(b"%PDF")
    equations = (tmp_path / "calibrated_load_equations.csv").read_text(encoding="utf-8").splitlines()
    assert equations[0].startswith("load,unit,gauge,coefficient [unit per um/m],standard error")
    assert any(line.startswith("normal force,N,") for line in equations)
    assert "wrong sign" in page
    assert all(f">{kind}<" in page for kind in ("mass", "clamp axial", "clamp transverse", "load cell"))
    larger = replace(test, strain=1.5 * test.strain)  # the gauge of the wrong sign is not named then
    (tmp_path / "larger").mkdir()
    wrong, refused = write_ground_test(larger, tmp_path / "larger", "all times 1.5"), tmp_path / "refused.h5"
    line = r"loadtest.toml: load test: .* 1\.[345]\d* times the drawing's .*; no map written, --accept writes it$"
    with pytest.raises(StrainfmuError, match=line) as caught:
        calibrate(tmp_path / "map.h5", wrong, refused, vehicle=file)
    assert caught.value.exit_code == 1
    assert not refused.exists()
    taken = calibrate(tmp_path / "map.h5", wrong, refused, vehicle=file, accept=True)
    assert taken.notes[-1].startswith("accepted: no vehicle near the drawing")
    assert "standard deviations" in load_inverse_map(refused).provenance["calibration"]["accepted"]
    with pytest.raises(InputError, match="already calibrated"):
        calibrate(output, written, tmp_path / "twice.h5", vehicle=file)
    with pytest.raises(InputError, match=r"vehicle: entry is missing"):
        calibrate(tmp_path / "map.h5", written, output)
