"""Pressure fields that every flow, and every error of a flow, is a combination of.

Strain of the candidates is solved for these fields alone: one solution of the structure per field, however many
candidates there are. On a body of revolution a field is a shape along the axis times cos m phi or sin m phi, and
the two of one shape are one solution.

Auxiliary sensors that are there whatever gauges are placed (flush ports, inertial unit, load cells) read the
pressure on the surface alone, so that their rows follow from the fields without any structure.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from builder.aero.surface.mesh import Surface, mesh_of
from builder.campaign.snapshots import Snapshots
from builder.inverse.ensemble import Ensemble
from builder.inverse.sensor_set import surface_rows
from builder.manifold.discrepancy import gaussian_process_shapes, process_on_surface
from builder.manifold.flow_amplitudes import MAX_HARMONIC, cosine_amplitudes
from builder.manifold.state_tables import with_mirror_images
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.sensor_entries import Sensors
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import BoolArray, FloatArray, IntArray

NEGLIGIBLE = 3e-4
"""Size of a field over the flows, relative to the largest that is not the same all round, below which it is left
out."""

PROCESS_SIZE = 0.02
"""Standard deviation of pressure off the tables over p_inf that its fields are weighed with, against the flows."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PressureBasis:
    """K fields on n_p nodes.

    Attributes
    ----------
    fields : (n_p, K) orthonormal columns.
    harmonic, phase : (K,) m and 0 for cos m phi, 1 for sin m phi; None of another shape than a grid of rings.
    along : per harmonic, (n_x, k_m) of the shapes along the axis; the fields of a harmonic are all cosines, then
        all sines of its shapes. Empty of another shape.
    """

    fields: FloatArray
    harmonic: IntArray | None = None
    phase: IntArray | None = None
    along: tuple[FloatArray, ...] = ()


def pressure_basis(
    vehicle: Vehicle, snapshots: Snapshots, ensemble: Ensemble, flow_errors: Sequence[FloatArray] = ()
) -> PressureBasis:
    """Return the fields of the flows of ``snapshots``, of uniform pressure and of pressure off the tables.

    ``flow_errors`` (k, n_p) are further fields, on another surface than rings.
    """
    if ensemble.grid is not None:
        return _of_revolution(vehicle, snapshots, ensemble.grid)
    both = with_mirror_images(snapshots, mesh_of(snapshots.surface))
    ambient = np.array([condition.ambient_pressure for condition in both.conditions()])
    mesh, entry = mesh_of(snapshots.surface), vehicle.map
    process = process_on_surface(mesh, entry)
    parts = [
        both.pressure / ambient[:, None] - 1.0,
        np.ones((1, snapshots.pressure.shape[1])),
        process.T,
        *flow_errors,
    ]
    columns = np.hstack([_span(part.T, NEGLIGIBLE) for part in parts if len(part)])
    return PressureBasis(fields=_span(columns, 1e-8))


def _of_revolution(vehicle: Vehicle, snapshots: Snapshots, grid: SurfaceGrid) -> PressureBasis:
    entry, n_m = vehicle.map, min(MAX_HARMONIC, (grid.n_roll - 1) // 2) + 1
    process, around = gaussian_process_shapes(grid, entry)
    spectrum = np.linalg.norm(np.fft.rfft(around, axis=0), axis=1)
    rings = np.stack(
        [
            cosine_amplitudes(
                (pressure / condition.ambient_pressure).reshape(len(grid.x), -1),
                grid.roll_angle - condition.leeward_roll_angle,
                n_m,
            )
            for condition, pressure in zip(snapshots.conditions(), snapshots.pressure, strict=True)
        ]
    )
    along, fields, harmonic, phase = [], [], [], []
    flows = [rings[..., m].T / np.sqrt(len(rings)) for m in range(n_m)]
    limit = NEGLIGIBLE * max(float(np.linalg.norm(ring, 2)) for ring in flows[1:] or flows)
    for m, of_flows in enumerate(flows):
        of_process = PROCESS_SIZE * spectrum[m] / np.linalg.norm(spectrum) * process
        parts = [of_flows, of_process, np.ones((len(grid.x), 1))] if m == 0 else [of_flows, of_process]
        vectors, size, _ = np.linalg.svd(np.hstack(parts), full_matrices=False)
        shapes = vectors[:, size > limit]
        along.append(shapes)
        angle = m * grid.roll_angle
        for kind, wave in enumerate((np.cos(angle), np.sin(angle)) if m else (np.ones(grid.n_roll),)):
            waves = np.einsum("xk,r->xrk", shapes, wave / np.linalg.norm(wave))
            fields.append(waves.reshape(grid.n_nodes, shapes.shape[1]))
            harmonic += [m] * shapes.shape[1]
            phase += [kind] * shapes.shape[1]
    return PressureBasis(
        fields=np.hstack(fields), harmonic=np.array(harmonic), phase=np.array(phase), along=tuple(along)
    )


def _span(columns: FloatArray, negligible: float) -> FloatArray:
    """Return orthonormal columns (n, k) that span ``columns``."""
    vectors, size, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(vectors[:, size > negligible * size[0]])


@dataclass(frozen=True, eq=False, kw_only=True)
class CountedSensors:
    """n sensors, their readings over the noise of each.

    Attributes
    ----------
    reading : (n, K) per field of the basis [1/Pa].
    gain : (n,) errors of each in proportion to its reading [1].
    against_inside : (n,) whether it reads against the pressure inside the body.
    common : (n_e, n, K) errors that sensors have in common, per field, one standard deviation [1/Pa].
    drift : (n, n_d) offsets that sensors have in common, one standard deviation [1].
    """

    reading: FloatArray
    gain: FloatArray
    against_inside: BoolArray
    common: FloatArray
    drift: FloatArray


def counted_sensors(entry: Sensors | None, surface: Surface, basis: PressureBasis) -> CountedSensors | None:
    """Return the sensors of ``entry`` that read the surface pressure alone; None where there is none.

    Raises
    ------
    InputError
        A port lies off the body, or the surface is none that it can be placed on.
    """
    rows = [] if entry is None else surface_rows(entry, surface)
    if not rows:
        return None
    std = np.array([row.std for row in rows])
    errors = list(dict.fromkeys(name for row in rows for name in row.errors))
    drifts = list(dict.fromkeys(name for row in rows for name in row.drift))
    nothing = np.zeros(len(basis.fields))
    common = np.zeros((len(errors), len(rows), basis.fields.shape[1]))
    for number, name in enumerate(errors):
        common[number] = np.array([row.errors.get(name, nothing) for row in rows]) @ basis.fields / std[:, None]
    return CountedSensors(
        reading=np.array([row.operator for row in rows]) @ basis.fields / std[:, None],
        gain=np.array([row.gain for row in rows]),
        against_inside=np.array([row.follows_inside for row in rows]),
        common=common,
        drift=np.array([[row.drift.get(name, 0.0) for name in drifts] for row in rows]) / std[:, None],
    )
