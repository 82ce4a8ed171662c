"""Walls and supports beyond one clamped wall: the Fourier model against three-dimensional elasticity."""

from pathlib import Path

import numpy as np
import pytest
from small_ogive import FREE_FLIGHT, PRESSURE, small, solved

from builder.aero.surface.mesh import mesh_of_grid
from builder.structure.fourier.fourier_model import structural_model
from builder.structure.solid.checks import reference_pressures
from builder.vehicle.file import load_vehicle

pytestmark = pytest.mark.slow

TAPER = (
    (
        PRESSURE,
        f"{PRESSURE}\nwall_thickness_at = "
        "[{ x_m = 0.2, thickness_mm = 7.0 }, { x_m = 0.7, thickness_mm = 4.0 }]",
    ),
)
SPRINGS = (
    (
        PRESSURE,
        f'{PRESSURE}\nsupport = "elastic_foundation"\nfoundation_normal_N_per_m3 = 2e12\n'
        "foundation_tangential_N_per_m3 = 1e12",
    ),
)


@pytest.mark.parametrize("change", [TAPER, SPRINGS, FREE_FLIGHT], ids=["taper", "springs", "free flight"])
def test_both_models_agree(tmp_path: Path, change: tuple[tuple[str, str], ...]) -> None:
    """Strain under pressures of harmonics 0 to 4 within 1 % of the largest of each, coarse hexahedra."""
    path = small(tmp_path, *change)
    vehicle = load_vehicle(path)
    solid = solved(path)
    layout = vehicle.gauges.layout
    fine = vehicle.resolution.map.model_copy(
        update={"element_length_mm": 5.0, "wall_layers": 2, "surface_stations": 160}
    )
    fourier = structural_model(vehicle, fine, [layout])
    length = vehicle.body().length
    expected = fourier.strain_operator(layout) @ reference_pressures(mesh_of_grid(fourier.surface).point, length)
    found = solid.strain_operator[solid.gauges_of(layout)] @ reference_pressures(solid.point, length)
    scale = np.abs(expected).max(axis=0)
    seen = scale > 1e-3 * scale.max()
    assert (np.abs(found - expected) < 0.01 * scale)[:, seen].all()
