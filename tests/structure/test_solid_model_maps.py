"""Maps built on the three-dimensional model, beside those of the Fourier model."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_ogive import write_vehicle

from builder.campaign.snapshots import load_snapshots
from builder.pipeline.map_files import make_map
from builder.pipeline.pipeline import FilesGiven, open_pipeline
from builder.reporting import Silent
from builder.structure.fourier.fourier_model import StructuralModel, structural_model
from builder.structure.mapped_structure import MappedStructure, mapped_structure
from builder.structure.structure_file import load_structure
from builder.vehicle.file import load_vehicle
from builder.vehicle.map_needs import used_layouts
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import load_inverse_map
from strainfmu.estimator.reference.gain import load_gain

pytestmark = pytest.mark.slow  # two maps are built

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def both_maps(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Folders of the coarse ogive's map, built on the Fourier model and on the solid one.

    All harmonics that 36 roll angles carry, so that the two operators mean the same. Neither alarm levels, which
    need flows of a third model, nor the report is looked at.
    """
    folder = tmp_path_factory.mktemp("both")
    harmonics, levels = ("harmonics = 8", "harmonics = 17"), ("[map]", '[map]\nalarm_levels = "nominal"')
    solid = ("solid_tip_length_m = 0.1", 'solid_tip_length_m = 0.1\nmodel = "solid"\nresolution = "coarse"')
    fourier_file = write_vehicle(folder / "fourier.toml", harmonics, levels)
    solid_file = write_vehicle(folder / "solid.toml", harmonics, levels, solid)
    build_map(fourier_file, folder / "fourier")
    shutil.copytree(folder / "fourier", folder / "solid")  # the flows are the same
    build_map(solid_file, folder / "solid")
    return folder / "fourier", folder / "solid"


def build_map(vehicle: Path, folder: Path) -> None:
    make_map(open_pipeline(load_vehicle(vehicle), folder, Silent(), FilesGiven())[0])


def both_operators(folders: tuple[Path, Path]) -> tuple[StructuralModel, MappedStructure, str]:
    vehicle = load_vehicle(folders[0].parent / "fourier.toml")
    fourier = structural_model(vehicle, vehicle.resolution.map, used_layouts(vehicle))
    snapshots = load_snapshots(folders[1] / "snapshots.h5")
    return fourier, mapped_structure(load_structure(folders[1] / "structure.h5"), snapshots), vehicle.gauges.layout


def test_operators_of_both_models_agree(both_maps: tuple[Path, Path]) -> None:
    """Z on the snapshots' nodes. Found: 4.7 % in all, 1.4 % up to harmonic 8; of the snapshots' strain 0.09 %.

    High harmonics of a single node's pressure are resolved differently by elements of 20 and of 30 mm; the
    snapshots hold little of them.
    """
    fourier, solid, layout = both_operators(both_maps)
    z, other = fourier.strain_operator(layout), solid.strain_operator(layout)
    assert np.linalg.norm(other - z) < 0.08 * np.linalg.norm(z)

    def low_harmonics(operator: np.ndarray) -> np.ndarray:
        return np.fft.rfft(fourier.surface.as_map(operator), axis=-1)[..., :9]

    assert np.linalg.norm(low_harmonics(other) - low_harmonics(z)) < 0.03 * np.linalg.norm(low_harmonics(z))
    net = load_snapshots(both_maps[0] / "snapshots.h5").pressure - 3000.0
    assert np.linalg.norm(net @ (other - z).T) < 3e-3 * np.linalg.norm(net @ z.T)


def test_maps_of_both_models_agree(both_maps: tuple[Path, Path]) -> None:
    """Load per strain, row by row. Found: 2.6 to 5 %, as the noise of each map holds its own mesh error."""
    fourier, solid = (load_inverse_map(folder / "map.h5") for folder in both_maps)
    gain, other = (load_gain(one) for one in (fourier, solid))
    apart = np.linalg.norm(other - gain, axis=1) / np.linalg.norm(gain, axis=1)
    assert np.all(apart < [0.04, 0.07, 0.07, 0.05, 0.05])
    assert fourier.provenance["structural_model"] == "fourier"
    assert "swept_hexahedra" in solid.provenance["structural_model"]


@pytest.mark.slow
def test_build_folder_reuses_its_structure(both_maps: tuple[Path, Path], run: Run, tmp_path: Path) -> None:
    vehicle = both_maps[0].parent / "solid.toml"
    folder = tmp_path / "again"
    shutil.copytree(both_maps[1], folder)
    code, out, _ = run("build", vehicle, "-o", folder)
    assert code == 0
    for name in ("snapshots.h5", "structure.h5", "map.h5"):
        assert f"{name}: up to date, reused" in out
    fewer = write_vehicle(tmp_path / "changed.toml", ("modes = 4", "modes = 3"))
    text = vehicle.read_text(encoding="utf-8").replace("modes = 4", "modes = 3")
    fewer.write_text(text, encoding="utf-8")
    code, out, _ = run("build", fewer, "-o", folder)
    assert code == 0
    assert "structure.h5: up to date, reused" in out
    assert "map.h5: up to date" not in out


def test_pressure_of_another_body_is_refused(both_maps: tuple[Path, Path]) -> None:
    """Snapshots in mm, and of a body 5 % shorter: neither gives a number."""
    structure = load_structure(both_maps[1] / "structure.h5")
    snapshots = load_snapshots(both_maps[1] / "snapshots.h5")
    free = replace(snapshots, station=None, radius=None, meridian_angle=None)
    with pytest.raises(InputError, match=r"structure: mapping: .*it is in mm"):
        mapped_structure(structure, replace(free, point=1e3 * free.point))
    with pytest.raises(InputError, match=r"structure: mapping: .*shapes differ"):
        mapped_structure(structure, replace(free, point=free.point * [0.95, 1.0, 1.0]))


@pytest.mark.slow
def test_free_surface_of_snapshots(both_maps: tuple[Path, Path]) -> None:
    """Without stations and roll angles pressure is linear over triangles: the same within what 36 angles blur."""
    _, solid, layout = both_operators(both_maps)
    snapshots = load_snapshots(both_maps[1] / "snapshots.h5")
    free = replace(snapshots, station=None, radius=None, meridian_angle=None)
    mapped = mapped_structure(load_structure(both_maps[1] / "structure.h5"), free)
    net = snapshots.pressure - 3000.0
    strain = net @ solid.strain_operator(layout).T
    difference = net @ mapped.strain_operator(layout).T - strain
    assert np.linalg.norm(difference) < 0.01 * np.linalg.norm(strain)


@pytest.mark.slow
def test_demo_on_the_solid_model(both_maps: tuple[Path, Path], run: Run, tmp_path: Path) -> None:
    """The vehicle that flies stays the Fourier model: data and map come of two discretisations."""
    folder = tmp_path / "demo"
    shutil.copytree(both_maps[1], folder)
    code, out, _ = run("demo", "--vehicle", both_maps[0].parent / "solid.toml", "-o", folder, "--verbose")
    assert code == 0
    assert "structure.h5" in out
    assert "Structure: the vehicle that flies" in out
