"""Surface pressure as a user makes it: by each engine, out to other programs and back, and looked at."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from changed_vehicle import change
from ogive import copied_ogive
from state_estimates import state_gain

from builder.campaign.snapshots import Snapshots, load_snapshots
from builder.pipeline.map_files import make_map
from builder.pipeline.pipeline import FilesGiven, open_pipeline
from builder.reporting import Silent
from builder.vehicle.file import load_vehicle
from strainfmu.estimator.map.inverse_map import load_inverse_map

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def vehicle(tmp_path: Path) -> Path:
    """Return a copy of the coarse vehicle that a test may change."""
    return copied_ogive(tmp_path / "vehicle")


def choose_engine(vehicle: Path, entries: str) -> None:
    """Add the section that names the source of pressure."""
    vehicle.write_text(vehicle.read_text(encoding="utf-8") + f"\n[aerodynamics]\n{entries}\n", encoding="utf-8")


def solved(run: Run, vehicle: Path, output: Path) -> Snapshots:
    code, printed, message = run("snapshots", vehicle, "-o", output)
    assert (code, message) == (0, "")
    assert "18 conditions" in printed
    return load_snapshots(output)


@pytest.mark.slow
def test_out_to_another_program_and_back_to_a_map(
    run: Run, vehicle: Path, ogive_demo: Path, tmp_path: Path
) -> None:
    """Exported, imported as another solver's results, built into a map: the same loads per strain within 1 %.

    Angles as listed: an imported flow is one of its own even where another one is the same at another roll angle,
    and would count beside it at every roll angle.
    """
    change(vehicle, ("[map]", '[map]\nsymmetry = "listed"\nalarm_levels = "nominal"'))
    given = ogive_demo / "snapshots.h5"
    make_map(open_pipeline(load_vehicle(vehicle), tmp_path / "own", Silent(), FilesGiven(snapshots=given))[0])
    code, printed, _ = run("convert", given, "-o", vehicle.parent / "cfd", "--format", "triq")
    assert code == 0
    assert "manifest.toml: written, with 18 files" in printed
    choose_engine(vehicle, 'engine = "table"\nmanifest = "cfd/manifest.toml"')
    assert run("build", vehicle, "-o", tmp_path / "map")[0] == 0
    ours, imported = (load_snapshots(path) for path in (given, tmp_path / "map" / "snapshots.h5"))
    assert imported.engine == "table"
    assert imported.solved.all()
    np.testing.assert_allclose(imported.coefficients(), ours.coefficients(), rtol=2e-3, atol=1e-5)
    first, second = (load_inverse_map(tmp_path / name / "map.h5") for name in ("own", "map"))
    gain = [found.load_per_state @ state_gain(found) for found in (first, second)]
    np.testing.assert_allclose(gain[1], gain[0], rtol=0.0, atol=0.01 * np.abs(gain[0]).max())


def test_newtonian_pressure_on_a_surface_from_a_file(run: Run, vehicle: Path, tmp_path: Path) -> None:
    """The vehicle's own surface, written as STL and read back, against the engine on the surface itself: 1 %."""
    choose_engine(vehicle, 'engine = "newtonian"\nleeward = "prandtl_meyer"')
    own = solved(run, vehicle, tmp_path / "own.h5")
    assert run("surface", vehicle, "-o", vehicle.parent / "body.stl", "--closed")[0] == 0
    choose = vehicle.read_text(encoding="utf-8") + 'surface = "body.stl"\n'
    vehicle.write_text(choose, encoding="utf-8")
    from_file = solved(run, vehicle, tmp_path / "file.h5")
    assert from_file.grid is None
    assert own.grid is not None
    scale = np.abs(own.coefficients()).max(axis=0)
    np.testing.assert_allclose(from_file.coefficients()[:, 1:3], own.coefficients()[:, 1:3], atol=0.01 * scale[1])


def test_snapshots_are_shown_and_drawn(run: Run, ogive_demo: Path, tmp_path: Path) -> None:
    code, printed, message = run("inspect", ogive_demo / "snapshots.h5", "-o", tmp_path / "figures")
    assert (code, message) == (0, "")
    snapshots = load_snapshots(ogive_demo / "snapshots.h5")
    count = int(snapshots.solved.sum())
    assert f"18: {count} solved, {18 - count} rolled from them" in printed
    drawn = sorted(path.name for path in (tmp_path / "figures").iterdir())
    assert drawn == ["centre_lines.png", "force_curves.png", "surface_maps.png"]


def test_a_map_is_shown(run: Run, ogive_demo: Path) -> None:
    code, printed, message = run("inspect", ogive_demo / "map.h5")
    assert (code, message) == (0, "")
    assert "gauges, states" in printed
    assert "M_Y" in printed


def test_what_cannot_be_shown_is_refused(run: Run, ogive_demo: Path, tmp_path: Path) -> None:
    (tmp_path / "text.h5").write_text("no artefact")
    for path, words in (
        (ogive_demo / "flight.h5", "an inverse map or snapshots can be inspected"),
        (tmp_path / "text.h5", "damaged, or not an HDF5 file written by strainfmu"),
        (tmp_path / "none.h5", "no such file"),
    ):
        code, _, message = run("inspect", path)
        assert code == 2
        assert message.count("\n") == 1
        assert words in message


def test_several_altitudes_are_no_input_of_a_map_in_absolute_form(
    run: Run, vehicle: Path, ogive_demo: Path, tmp_path: Path
) -> None:
    """Vented, the pressure inside follows the altitude; a map in Pa has one."""
    text = vehicle.read_text(encoding="utf-8").replace("= 3000.0", '= "ambient"')
    vehicle.write_text(text.replace("[map]", '[map]\nform = "absolute"', 1), encoding="utf-8")
    run("convert", ogive_demo / "snapshots.h5", "-o", vehicle.parent / "cfd", "--format", "csv")
    manifest = vehicle.parent / "cfd" / "manifest.toml"
    manifest.write_text(
        manifest.read_text(encoding="utf-8").replace("altitude_km = 22.0", "altitude_km = 21.0", 1)
    )
    choose_engine(vehicle, 'engine = "table"\nmanifest = "cfd/manifest.toml"')
    code, _, message = run("build", vehicle, "-o", tmp_path / "map")
    assert code == 2
    assert "one altitude" in message
    assert not (tmp_path / "map" / "map.h5").exists()
