"""The public names of strainfmu: there, lazy, and enough for the first lines that a user writes."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from random_map import random_map
from synthetic_vehicle import SyntheticFiles

import strainfmu
from strainfmu.cosim.models.flight_model import load_flight_model
from strainfmu.cosim.models.trajectory import load_trajectory
from strainfmu.cosim.systems.master import matching_connections
from strainfmu.cosim.systems.recording import load_recording, save_csv, save_hdf5

pytestmark = pytest.mark.fast


def test_every_public_name_is_there() -> None:
    for name in strainfmu.__all__:
        assert getattr(strainfmu, name) is not None
    assert set(strainfmu.__all__) <= set(dir(strainfmu))
    # What the estimator returns is on the page of the Python interface, which lists these names.
    assert {"Estimator", "Estimate", "AirData"} <= set(strainfmu.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'none_such'"):
        _ = strainfmu.none_such


def test_import_is_lazy() -> None:
    """Plain ``import strainfmu`` imports neither numpy nor h5py; the estimator needs no optional package."""
    program = (
        "import sys, strainfmu\n"
        "assert not {'numpy', 'h5py', 'fmpy', 'can'} & set(sys.modules)\n"
        "strainfmu.Estimator\n"
        "assert not {'scipy', 'fmpy', 'can', 'pandas', 'pydantic', 'typer'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)


@pytest.mark.parametrize("kind", [str, Path])
def test_first_lines_of_a_user(kind: type, tmp_path: Path) -> None:
    inverse_map = random_map()
    path = kind(tmp_path / "map.h5")
    strainfmu.save_inverse_map(inverse_map, path)
    estimator = strainfmu.load(path)
    result = estimator.estimate(inverse_map.mean_strain, dynamic_pressure=95.8e3)
    assert result.health is strainfmu.HealthState.OK
    assert float(result.sigma.C_N) == float(result.coefficients_std[1])
    series = estimator.estimate(np.tile(inverse_map.mean_strain, (3, 1)), dynamic_pressure=np.full(3, 95.8e3))
    np.testing.assert_allclose(series.C_N, result.C_N, rtol=1e-12)


def test_wrong_file_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(strainfmu.InputError, match="no such file"):
        strainfmu.load(tmp_path / "none.h5")


@pytest.mark.parametrize("kind", [str, Path])
def test_paths_are_text_or_paths(kind: type, tmp_path: Path) -> None:
    inverse_map = random_map()
    source, fmu, data, loads = (kind(tmp_path / name) for name in ("map.h5", "a.fmu", "run.csv", "loads.csv"))
    strainfmu.save_inverse_map(inverse_map, source)
    strainfmu.export_estimator(source, fmu)
    row = ",".join(repr(value) for value in inverse_map.mean_strain.tolist())
    table = [",".join(("time", *inverse_map.gauge_names)), f"0,{row}", f"1,{row}"]
    Path(data).write_text("\n".join(table) + "\n", encoding="utf-8")
    assert strainfmu.estimate_file(source, data, loads, dynamic_pressure=95.8e3).samples == 2
    assert Path(fmu).exists()


@pytest.mark.parametrize("kind", [str, Path])
def test_simulations_take_text_or_paths(kind: type, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    """The FMUs of a system, and the files of what was flown."""
    fmus = {"plant": kind(synthetic.plant), "estimator": kind(synthetic.estimator_1)}
    system = strainfmu.System(fmus, matching_connections("plant", "estimator", fmus))
    flown = strainfmu.simulate(system, 0.1, 0.01, record=["estimator.C_N"])
    save_hdf5(flown, kind(tmp_path / "a.h5"))
    save_csv(flown, kind(tmp_path / "a.csv"))
    np.testing.assert_array_equal(load_recording(kind(tmp_path / "a.h5")).values, flown.values)
    assert load_flight_model(kind(synthetic.flight_model)).vehicle
    assert load_trajectory(kind(synthetic.trajectory)).stop_time > 0.0


@pytest.mark.parametrize("value", [None, "high", [1.0, 2.0], {}])
def test_dynamic_pressure_that_is_no_number(value: Any) -> None:
    inverse_map = random_map()
    estimator = strainfmu.Estimator(inverse_map)
    strain = inverse_map.mean_strain
    for strains in (strain, np.tile(strain, (3, 1))):
        with pytest.raises(strainfmu.InputError, match=r"^dynamic_pressure: expected a number.*, got "):
            estimator.estimate(strains, dynamic_pressure=value)
