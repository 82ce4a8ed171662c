"""The vehicle and the gauges the structure is tested on."""

from collections.abc import Iterator

import numpy as np
import pytest
from kept_results import computed_results

from builder.structure.fourier.inner_surface import PlacedGauges
from builder.structure.fourier.meridian_mesh import MeridianMesh
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.fourier.strain_operator import HarmonicResponse, harmonic_response
from builder.structure.wall import Material, Wall
from builder.vehicle.shape.geometry import BodyOfRevolution, SurfaceGrid, chain_segments, surface_grid

GAUGE_X = np.linspace(0.35, 3.30, 9)


@pytest.fixture(scope="module", autouse=True)
def _computed() -> Iterator[None]:
    with computed_results():
        yield


@pytest.fixture(scope="session")
def body() -> BodyOfRevolution:
    five, one = np.deg2rad([5.0, 1.0])
    return chain_segments([(1.75, five, five), (3.6, one, one)])


@pytest.fixture(scope="session")
def wall() -> Wall:
    return Wall(thickness=0.004, solid_tip_length=0.10, material=Material(110e9, 0.31))


@pytest.fixture(scope="session")
def grid(body: BodyOfRevolution) -> SurfaceGrid:
    return surface_grid(body, 60, 24)


@pytest.fixture(scope="session")
def mesh(body: BodyOfRevolution, wall: Wall) -> MeridianMesh:
    return shell_mesh(body, wall, element_length=0.02)


@pytest.fixture(scope="session")
def response(mesh: MeridianMesh, wall: Wall, grid: SurfaceGrid) -> HarmonicResponse:
    return harmonic_response(mesh, wall.material, GAUGE_X, grid.x, max_harmonic=12)


@pytest.fixture(scope="session")
def ring_of_gauges() -> PlacedGauges:
    """Nine stations at 0, 90, 180, 270 deg, axial then hoop: gauge = (station * 4 + roll) * 2 + hoop."""
    shape = (len(GAUGE_X), 4, 2)
    x = np.broadcast_to(GAUGE_X[:, None, None], shape).ravel()
    roll = np.broadcast_to(0.5 * np.pi * np.arange(4)[:, None], shape).ravel()
    axial = np.broadcast_to(np.array([1.0, 0.0]), shape).ravel()
    return PlacedGauges(x=x, roll_angle=roll, meridional=axial, circumferential=1.0 - axial)
