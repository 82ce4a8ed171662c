"""What an artefact holds, shown on the console: ``strainfmu inspect``."""

from __future__ import annotations

from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.table import Table

from strainfmu import inverse_map as map_file
from strainfmu.errors import InputError
from strainfmu.files import content_hash_of, schema_of
from strainfmu.inverse_map import COEFFICIENT_NAMES, load_inverse_map

if TYPE_CHECKING:
    from builder.snapshots import Snapshots


def inspect_artefact(path: Path, figures: Path | None, console: Console) -> None:
    """Show ``path``, an inverse map or snapshots; draw figures of snapshots into the folder ``figures``.

    Raises
    ------
    InputError
        The file is missing, damaged, or of a kind that is not shown.
    """
    from builder import snapshots as snapshots_file

    schema = schema_of(path)
    if schema == map_file.SCHEMA:
        _inspect_map(path, console)
    elif schema == snapshots_file.SCHEMA:
        _inspect_snapshots(path, figures or path.with_name(f"{path.stem}_figures"), console)
    else:
        raise InputError(f"{path}: schema '{schema}' found, an inverse map or snapshots can be inspected")


def _inspect_map(path: Path, console: Console) -> None:
    loaded = load_inverse_map(path)
    q = loaded.nominal_dynamic_pressure
    reference = loaded.reference_area * np.array([1, 1, 1, loaded.reference_length, loaded.reference_length])
    sigma = np.sqrt(np.diag(loaded.load_covariance)) / (q * reference)
    summary = Table(title=f"{path}: {loaded.vehicle}", show_header=False)
    summary.add_row("content hash", content_hash_of(path, map_file.SCHEMA, map_file.SCHEMA_VERSION))
    summary.add_row("gauges, states", f"{loaded.n_gauges}, {len(loaded.state_offset)}")
    summary.add_row("gauge noise sigma", f"{1e6 * loaded.noise_std.mean():.4g} um/m")
    summary.add_row("reference area, length", f"{loaded.reference_area:.6g} m2, {loaded.reference_length:.6g} m")
    for key, value in loaded.provenance.items():
        summary.add_row(key, str(value))
    console.print(summary)
    table = Table(title=f"Coefficients over the snapshots, and sigma at q_inf = {1e-3 * q:.4g} kPa")
    for heading in ("coefficient [1]", "least", "greatest", "sigma"):
        table.add_column(heading, justify="right")
    for name, (low, high), one in zip(COEFFICIENT_NAMES, loaded.coefficient_range, sigma, strict=True):
        table.add_row(name, f"{low:.4f}", f"{high:.4f}", f"{one:.4f}")
    console.print(table)


def _inspect_snapshots(path: Path, folder: Path, console: Console) -> None:
    from builder import snapshot_figures
    from builder import snapshots as snapshots_file
    from builder.figures import save
    from builder.snapshots import load_snapshots

    snapshots = load_snapshots(path)
    summary = Table(title=f"{path}: {snapshots.vehicle}", show_header=False)
    summary.add_row("content hash", content_hash_of(path, snapshots_file.SCHEMA, snapshots_file.SCHEMA_VERSION))
    solved = int(snapshots.solved.sum())
    count = len(snapshots.condition)
    summary.add_row("engine", snapshots.engine)
    summary.add_row("conditions", f"{count}: {solved} solved, {count - solved} rolled from them")
    summary.add_row("surface", f"{len(snapshots.point)} nodes, {len(snapshots.triangle)} triangles")
    if np.isfinite(snapshots.momentum_error).any():
        summary.add_row(
            "force against momentum", f"within {100.0 * np.nanmax(snapshots.momentum_error):.2g} % of the force"
        )
    repaired = int(np.sum(snapshots.solved & (snapshots.repairs > 0)))
    summary.add_row("flows with repaired states", f"{repaired} of {solved}")
    for key, value in snapshots.settings.items():
        summary.add_row(key, str(value))
    console.print(summary)
    console.print(_table_of_conditions(snapshots))
    with console.status("Figures"):
        for name in ("surface_maps", "centre_lines", "force_curves"):
            save(getattr(snapshot_figures, name)(snapshots), folder / f"{name}.png")
            console.print(f"{folder / f'{name}.png'}: written", highlight=False, soft_wrap=True)


def _table_of_conditions(snapshots: Snapshots) -> Table:
    """Return one row per condition: what it is, its coefficients, and how sound its flow is."""
    from builder.snapshot_figures import in_plane_forces

    table = Table(title="Conditions; coefficients [1] of fore-body pressure less internal pressure")
    for heading in ("no.", "M", "alpha", "beta", "a_T [deg]", "H [km]", *COEFFICIENT_NAMES, "x_cp [m]"):
        table.add_column(heading, justify="right")
    table.add_column("flow")
    for heading in ("momentum [%]", "repairs"):
        table.add_column(heading, justify="right")
    coefficients, centre = snapshots.coefficients(), in_plane_forces(snapshots)[2]
    for i, condition in enumerate(snapshots.conditions()):
        angles = condition.angle_of_attack, condition.sideslip_angle, condition.total_incidence
        table.add_row(
            str(i + 1),
            f"{condition.mach_number:g}",
            *(f"{degrees(angle):.4g}" for angle in angles),
            f"{1e-3 * condition.altitude:g}",
            *(f"{value:.4f}" for value in coefficients[i]),
            f"{centre[i]:.3f}" if np.isfinite(centre[i]) else "-",
            "solved" if snapshots.solved[i] else f"rolled from {snapshots.flow[i] + 1}",
            f"{100.0 * snapshots.momentum_error[i]:.3f}" if np.isfinite(snapshots.momentum_error[i]) else "-",
            str(snapshots.repairs[i]),
        )
    return table
