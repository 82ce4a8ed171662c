"""Error of gauge strain by the mesh, as the difference of two models under loads that any surface can carry.

The loads are pressure cos(m phi) and sin(m phi), m = 0 to 4, constant along x and growing from 0 at the nose to 1
at the base: what air does to a slender body, and what bends its wall.
"""

from __future__ import annotations

import numpy as np

from builder.structure.fourier.gauges import place_gauges
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.fourier.strain_operator import harmonic_response, strain_operator
from builder.structure.solid.gauges.gauge_rows import Gauges
from builder.structure.solid.mesh.solid_mesh import INTERNAL
from builder.structure.structure_file import Structure
from builder.structure.wall import Wall
from builder.vehicle.shape.geometry import BodyOfRevolution, SurfaceGrid
from strainfmu.arrays import FloatArray

KILOPASCAL = 1e3
NO_REFERENCE = "no other mesh"
"""What the mesh error of a structure is measured against that no second mesh checks."""
HARMONICS = 5
PROFILES = 2
ROLL_ANGLES = 16  # enough for the interpolation in roll to be exact
ELEMENT_FRACTION = 1.0 / 480.0  # of the body's length, in two layers: 7.5 mm on the shipped vehicle


def reference_pressures(point: FloatArray, length: float) -> FloatArray:
    """Return pressures (n_p, 20) of amplitude 1 at points (n_p, 3) [m] of a body of a length [m].

    Column = (m * 2 + profile) * 2 + phase: profile 0 constant, 1 growing; phase 0 cosine, 1 sine.
    """
    roll = np.arctan2(point[:, 1], point[:, 2])
    harmonic = np.arange(HARMONICS) * roll[:, None]
    wave = np.stack([np.cos(harmonic), np.sin(harmonic)], axis=-1)
    profile = np.stack([np.ones(len(point)), point[:, 0] / length], axis=-1)
    return (wave[:, :, None, :] * profile[:, None, :, None]).reshape(len(point), -1)


def largest_amplitude(strain: FloatArray) -> FloatArray:
    """Return (n_d,) the largest of strains (n_d, 20) over loads, each at its worst phase, [1/Pa] per pressure."""
    phases = strain.reshape(len(strain), HARMONICS * PROFILES, 2)
    return np.asarray(np.hypot(phases[..., 0], phases[..., 1]).max(axis=1))


def fourier_can(gauges: Gauges) -> bool:
    """Return whether the Fourier model can place these gauges: points on the inner surface."""
    return bool((gauges.length == 0.0).all()) and set(gauges.surface) <= {INTERNAL}


def fourier_reference_strain(body: BodyOfRevolution, wall: Wall, gauges: Gauges) -> FloatArray:
    """Return strain (n_d, 20) [1/Pa] under :func:`reference_pressures` by the Fourier model, clamped aft.

    Raises
    ------
    InputError
        The wall does not fit the body or a gauge is not on the inner surface.
    """
    mesh = shell_mesh(body, wall, ELEMENT_FRACTION * body.length, 2)
    placed = place_gauges(mesh, gauges.position, gauges.direction, gauges.name)
    ends = np.array([0.0, body.length])  # pressure is linear in x between stations
    grid = SurfaceGrid(x=ends, radius=np.ones(2), angle=np.zeros(2), n_roll=ROLL_ANGLES)
    response = harmonic_response(mesh, wall.material, placed.x, ends, HARMONICS - 1)
    roll = np.tile(grid.roll_angle, 2)
    on_unit_radius = np.column_stack([np.repeat(ends, ROLL_ANGLES), np.sin(roll), np.cos(roll)])
    return strain_operator(response, placed, grid) @ reference_pressures(on_unit_radius, body.length)


def mesh_error_line(structure: Structure, noise_std: float | None) -> str:
    """Return one line: middle and largest mesh error per kPa of the reference loads.

    Each is also given as a fraction of the gauge's largest strain under these loads and, with the gauges' noise
    ``noise_std`` [m/m], in units of that.
    """
    if structure.is_external:
        return "mesh error: not known, the structure is another code's"
    if structure.settings["mesh_error_against"] == NO_REFERENCE:
        return "warning: mesh error: not known, structure.checked_by names no second mesh; the sigmas leave it out"
    length = float(structure.point[:, 0].max())
    strain = largest_amplitude(structure.strain_operator @ reference_pressures(structure.point, length))
    order = np.argsort(structure.mesh_error)

    def text(gauge: int) -> str:
        error = KILOPASCAL * float(structure.mesh_error[gauge])
        percent = 100.0 * float(structure.mesh_error[gauge] / strain[gauge])
        in_sigma = "" if noise_std is None else f", {error / noise_std:.2g} sigma"
        return f"{1e6 * error:.2g} um/m ({percent:.2g} % of its strain{in_sigma})"

    return (
        f"mesh error per kPa of pressure of harmonics 0 to {HARMONICS - 1}, against "
        f"{structure.settings['mesh_error_against']}: middle {text(int(order[len(order) // 2]))}, "
        f"largest {text(int(order[-1]))} at {structure.gauge_names[int(order[-1])]}"
    )
