"""Many small files on one mesh: one process reads them all, and the geometry is found once."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from imported_case import CONDITION, SYMMETRIC, case_text, manifest_text, table_on

from builder.aero.cfd import surface_transfer
from builder.aero.cfd.formats.vtk_files import VtkProcess, write_vtk
from builder.aero.surface.mesh import mesh_of_grid
from builder.vehicle.file import IC3X, load_vehicle
from builder.vehicle.shape.geometry import SurfaceGrid, surface_grid
from strainfmu.errors import InputError


@pytest.fixture(scope="module")
def coarse() -> SurfaceGrid:
    return surface_grid(load_vehicle(IC3X).body(), 24, 24)


def test_one_process_reads_file_after_file(coarse: SurfaceGrid, tmp_path: Path) -> None:
    """Also a refused one between them; after one on which it ends, the next file has a new process."""
    mesh, process = mesh_of_grid(coarse), VtkProcess()
    first, second, empty = (tmp_path / name for name in ("first.vtu", "second.vtu", "empty.vtu"))
    write_vtk(first, mesh, {"p": mesh.point[:, 0]})
    write_vtk(second, mesh, {"p": mesh.point[:, 1]})
    empty.write_text("<VTKFile></VTKFile>")
    image = process.read(first)
    number = process.number
    with pytest.raises(InputError, match="no VTK header found"):
        process.read(empty)
    assert process.read(second) != image
    assert process.number == number
    with pytest.raises(InputError, match=r"VTK's reader broke down on it \(exit code 1\)"):
        process.read(tmp_path)  # a folder: the process does not survive it
    assert process.read(first) == image
    assert process.number != number
    process.end()


@pytest.mark.parametrize("file_format", ["vtu", "csv"])
def test_geometry_of_one_mesh_is_found_once(coarse: SurfaceGrid, tmp_path: Path, file_format: str) -> None:
    """Two cases of one mesh and one of another: as each alone, with as many searches as there are meshes."""
    body = load_vehicle(IC3X).body()
    fields = []
    for n_x, slope in ((30, 0.1), (30, 0.2), (26, 0.3)):
        mesh = mesh_of_grid(surface_grid(body, n_x, 24))
        fields.append((mesh, 2.0 + slope * mesh.point[:, 0] + mesh.point[:, 1]))
    conditions = [CONDITION, SYMMETRIC, replace(CONDITION, mach_number=6.0)]
    cases = []
    for number, ((mesh, ratio), condition) in enumerate(zip(fields, conditions, strict=True)):
        path = tmp_path / f"case_{number}.{file_format}"
        if file_format == "vtu":
            write_vtk(path, mesh, {"ratio": ratio})
        else:
            columns = np.column_stack([mesh.point, mesh.node_normal, ratio])
            np.savetxt(path, columns, delimiter=",", header="x,y,z,normal_x,normal_y,normal_z,ratio", comments="")
        m, a, b, h = condition.as_tuple()
        angles = {"angle_of_attack_deg": float(np.rad2deg(a)), "sideslip_angle_deg": float(np.rad2deg(b))}
        cases.append(case_text(path.name, mach_number=m, altitude_km=1e-3 * h, **angles))
    manifest = tmp_path / "manifest.toml"
    manifest.write_text(manifest_text("\n".join(cases), quantity="p/p_inf", unit=None))
    engine = table_on(manifest, coarse)
    search = surface_transfer._transfer if file_format == "vtu" else surface_transfer._cloud
    search.cache_clear()
    keys = [engine.flow_key(condition) for condition in conditions]
    together = [engine.solve(key).arrays["ratio"] for key in keys]
    assert search.cache_info().misses == 2
    search.cache_clear()
    np.testing.assert_array_equal(engine.solve(keys[1]).arrays["ratio"], together[1])
    point = engine.surface.point
    np.testing.assert_allclose(together[0], 2.0 + 0.1 * point[:, 0] + point[:, 1], atol=2e-3)
    np.testing.assert_allclose(together[1], 2.0 + 0.2 * point[:, 0] + point[:, 1], atol=2e-3)
