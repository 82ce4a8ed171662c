"""Pressure fields of recorded strains as VTKHDF, read back by VTK itself."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from field_maps import N_D, exact_pressure, field_map
from flight_maps import exact_response

from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.flight_condition import FlightCondition
from strainfmu.recorded.run import estimate_file

pytestmark = pytest.mark.fast
Run = Callable[..., tuple[int, str, str]]
K = 7


def flights() -> list[FlightCondition]:
    return [FlightCondition(6.0, np.radians(1.0 + 0.9 * i), np.radians(2.0), 20e3) for i in range(K)]


def states() -> list[tuple[float, float, float, float]]:
    return [
        (
            one.mach_number,
            float(one.total_incidence * np.cos(one.leeward_roll_angle)),
            float(one.total_incidence * np.sin(one.leeward_roll_angle)),
            one.ambient_pressure,
        )
        for one in flights()
    ]


@pytest.fixture
def data(tmp_path: Path) -> Path:
    header = ["time [s]", "dynamic_pressure [Pa]", "mach_number [1]", "altitude [m]", "q_source"]
    lines = [",".join(header + [f"g{i} [m/m]" for i in range(N_D)])]
    for i, (one, state) in enumerate(zip(flights(), states(), strict=True)):
        row = [0.01 * i, one.dynamic_pressure, one.mach_number, one.altitude, 1.0, *exact_response(*state)[:N_D]]
        lines.append(",".join(f"{value:.12g}" for value in row))
    (tmp_path / "flight.csv").write_text("\n".join(lines), encoding="utf-8")
    return tmp_path / "flight.csv"


@pytest.fixture
def map_path(tmp_path: Path) -> Path:
    save_inverse_map(field_map(), tmp_path / "map.h5")
    return tmp_path / "map.h5"


def read_by_vtk(path: Path, name: str) -> tuple[list[float], list[np.ndarray], int]:
    """Return the times, the array ``name`` of every step, and the number of triangles."""
    pytest.importorskip("vtkmodules")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
    from vtkmodules.vtkIOHDF import vtkHDFReader

    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    key = vtkStreamingDemandDrivenPipeline.TIME_STEPS()
    times = [reader.GetOutputInformation(0).Get(key, i) for i in range(reader.GetNumberOfSteps())]
    found, cells = [], 0
    for time in times:
        reader.UpdateTimeStep(time)
        grid = reader.GetOutputDataObject(0)
        cells = grid.GetNumberOfCells()
        found.append(vtk_to_numpy(grid.GetPointData().GetArray(name)).copy())
    return times, found, cells


def test_series_opens_in_vtk(run: Run, map_path: Path, data: Path, tmp_path: Path) -> None:
    series = tmp_path / "pressure.vtkhdf"
    options = ["-o", tmp_path / "out.h5", "--field", series, "--field-every", 3, "--accept-strain-level"]
    code, printed, error = run("estimate", map_path, data, *options)
    assert (code, error) == (0, "")
    assert "pressure.vtkhdf: written, 3 fields" in printed
    times, pressure, cells = read_by_vtk(series, "pressure")
    _, sigma, _ = read_by_vtk(series, "sigma_pressure")
    np.testing.assert_allclose(times, [0.0, 0.03, 0.06])
    assert cells == 48
    for row, one, std in zip((0, 3, 6), pressure, sigma, strict=True):
        truth = exact_pressure(*states()[row])
        assert np.all(np.abs(one - truth) < 3.0 * std)
        assert np.all(std < 0.02 * np.max(truth))


def test_steps_are_counted_across_blocks(map_path: Path, data: Path, tmp_path: Path) -> None:
    from strainfmu.estimator.estimator import Estimator
    from strainfmu.recorded.outputs import field_series_writer

    held = field_map()
    strain = np.array([exact_response(*state)[:N_D] for state in states()])
    found = Estimator(held).estimate(strain, mach_number=6.0, altitude=20e3)
    with field_series_writer(tmp_path / "a.vtkhdf", held, every=3) as writer:
        for rows in (slice(0, 2), slice(2, 3), slice(3, 7)):
            writer.write((np.arange(7.0)[rows], [found[i] for i in range(7)[rows]]))
    with h5py.File(tmp_path / "a.vtkhdf") as file:
        assert file["VTKHDF/Steps/Values"][()].tolist() == [0.0, 3.0, 6.0]
        assert file["VTKHDF/Steps"].attrs["NSteps"] == 3
        assert file["VTKHDF/PointData/pressure"].attrs["unit"] == "Pa"


def test_linear_map_writes_net_pressure(data: Path, tmp_path: Path) -> None:
    held = field_map(linear=True)
    save_inverse_map(held, tmp_path / "linear.h5")
    summary = estimate_file(
        tmp_path / "linear.h5",
        data,
        tmp_path / "out.csv",
        accept_strain_level=True,
        field=tmp_path / "deep" / "net.vtkhdf",
    )
    assert summary.fields == K
    _, net, _ = read_by_vtk(tmp_path / "deep" / "net.vtkhdf", "net_pressure")
    assert all(np.all(np.isfinite(one)) for one in net)


def test_refusals_are_one_line(run: Run, map_path: Path, data: Path, tmp_path: Path) -> None:
    output = tmp_path / "out.csv"
    held = field_map()
    assert held.manifold is not None
    bare = replace(held, manifold=replace(held.manifold, pressure_field=None))
    save_inverse_map(bare, tmp_path / "bare.h5")
    series = tmp_path / "a.vtkhdf"
    with pytest.raises(InputError, match="holds no pressure field, expected one built with keep_field = true"):
        estimate_file(tmp_path / "bare.h5", data, output, field=series)
    with pytest.raises(InputError, match=r"a.vtu: expected .vtkhdf, got '.vtu'"):
        estimate_file(map_path, data, output, field=tmp_path / "a.vtu")
    code, _, error = run("estimate", map_path, data, "-o", output, "--field-every", 2)
    assert code != 0
    assert "--field-every: expected with --field, got it alone" in error
    code, _, error = run("estimate", map_path, data, "-o", output, "--field", series, "--field-every", 0)
    assert code != 0
    assert "--field-every: expected 1 .. 1000000, got 0" in error
    assert not output.exists()
    assert not series.exists()
