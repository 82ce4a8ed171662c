"""Inspection of an artefact of any kind: ``strainfmu inspect``."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from io import StringIO
from math import degrees
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from strainfmu.errors import InputError
from strainfmu.estimator.map import inverse_map as map_file
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.files import content_hash_of, schema_of

WIDTH = 120
"""Of the text where it is not printed [characters]."""

if TYPE_CHECKING:
    from builder.campaign.snapshots import Snapshots


def inspect(
    artefact: str | PathLike[str], figures: str | PathLike[str] | None = None, *, console: Console | None = None
) -> str:
    """Show the content of a map, a structure, a file of snapshots or an FMU.

    Map: gauges, validity range, uncertainty, provenance; with ``figures``, the value of each gauge.

    Structure: gauges, what each layout observes, strain patterns.

    Snapshots: conditions, coefficients, health of the flows; figures of pressure and forces.

    FMU of any maker: kind, platforms, variables, files; for an estimator also its map and validity.

    On the command line::

        strainfmu inspect results/map.h5
        strainfmu inspect estimator.fmu
        strainfmu inspect results/snapshots.h5 -o figures

    Parameters
    ----------
    artefact : map.h5, structure.h5, snapshots.h5 or an FMU.
    figures : folder for figures. Default: the file's name with _figures; none of a map.
    console : of rich, on which the text is printed too.

    Raises
    ------
    InputError
        The file is missing, damaged, or of a kind that is not shown.
    """
    shown = console or Console(file=StringIO(), width=WIDTH)
    shown.record = True
    inspect_artefact(Path(artefact), None if figures is None else Path(figures), shown)
    return shown.export_text()


def inspect_artefact(path: Path, figures: Path | None, console: Console) -> None:
    """Show ``path``: a map, an FMU, snapshots or a structure; draw figures of the latter two into ``figures``.

    Raises
    ------
    InputError
        The file is missing, damaged, or of a kind that is not shown.
    """
    if path.suffix.lower() == ".fmu":
        from strainfmu.cli.inspection.fmu import inspect_fmu

        inspect_fmu(path, console)
        return
    schema = schema_of(path)
    if schema == map_file.SCHEMA:
        from strainfmu.cli.inspection.inverse_map import inspect_map

        inspect_map(path, figures, console)
        return

    # A map needs no builder: it is imported for its own files alone.
    from builder.campaign import snapshots as snapshots_file
    from builder.structure import structure_file
    from strainfmu.cli.inspection.structure import inspect_structure

    folder = figures or path.with_name(f"{path.stem}_figures")
    if schema == snapshots_file.SCHEMA:
        _inspect_snapshots(path, folder, console)
    elif schema == structure_file.SCHEMA:
        inspect_structure(path, folder, console)
    else:
        raise InputError(
            f"{path}: schema '{schema}' found, a structure, an inverse map or snapshots can be inspected"
        )


def _inspect_snapshots(path: Path, folder: Path, console: Console) -> None:
    from builder.campaign import snapshots as snapshots_file
    from builder.campaign.failures import failed_conditions, failure_lines
    from builder.campaign.snapshots import load_snapshots
    from builder.figures import snapshot_figures
    from builder.figures.drawing import save

    snapshots = load_snapshots(path)
    summary = Table(title=escape(f"{path}: {snapshots.vehicle}"), show_header=False)
    summary.add_row("content hash", content_hash_of(path, snapshots_file.SCHEMA, snapshots_file.SCHEMA_VERSION))
    solved = int(snapshots.solved.sum())
    count = len(snapshots.condition)
    summary.add_row("engine", escape(snapshots.engine))
    summary.add_row("conditions", f"{count}: {solved} solved, {count - solved} rolled from them")
    summary.add_row("surface", f"{len(snapshots.point)} nodes, {len(snapshots.triangle)} triangles")
    if np.isfinite(snapshots.momentum_error).any():
        summary.add_row(
            "force against momentum", f"within {100.0 * np.nanmax(snapshots.momentum_error):.2g} % of the force"
        )
    if snapshots.mass_error is not None:
        mass = 100.0 * np.nanmax(snapshots.mass_error)
        summary.add_row("mass at the base against the tip's", f"within {mass:.2g} % of the base's free stream")
    repaired = int(np.sum(snapshots.solved & (snapshots.repairs > 0)))
    summary.add_row("flows with repaired states", f"{repaired} of {solved}")
    for key, value in _flat({key: entry for key, entry in snapshots.settings.items() if key != "failed"}):
        summary.add_row(escape(key), escape(value))
    console.print(summary)
    for line in _lines_of_conditions(snapshots):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    for line in failure_lines(failed_conditions(snapshots)):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    with console.status("Figures"):
        for name in ("surface_maps", "centre_lines", "force_curves"):
            save(getattr(snapshot_figures, name)(snapshots), folder / f"{name}.png")
            console.print(f"{folder / f'{name}.png'}: written", highlight=False, markup=False, soft_wrap=True)


def _flat(settings: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, str]]:
    """Yield the entries of nested settings, each with its path."""
    for key, value in settings.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value if isinstance(value, str) else json.dumps(value)


def _lines_of_conditions(snapshots: Snapshots) -> Iterator[str]:
    """Yield a table: each condition, its coefficients, and how sound its flow is; never narrowed to a terminal."""
    from builder.figures.snapshot_figures import in_plane_forces

    yield "Conditions; angles [deg], H [km], coefficients [1] of fore-body pressure less internal, x_cp [m],"
    yield (
        "flow: solved, or rolled from the flow of the condition named; force against momentum and balance of mass "
        "[%]; repaired states"
    )
    yield (
        f"{'no.':>4} {'M':>5} {'alpha':>7} {'beta':>7} {'a_T':>7} {'H':>5}"
        + "".join(f" {name:>8}" for name in COEFFICIENT_NAMES)
        + f" {'x_cp':>7} {'flow':>7} {'momentum':>8} {'mass':>8} {'repairs':>7}"
    )
    coefficients, centre = snapshots.coefficients().round(4) + 0.0, in_plane_forces(snapshots)[2]
    for i, condition in enumerate(snapshots.conditions()):
        angles = condition.angle_of_attack, condition.sideslip_angle, condition.total_incidence
        momentum = snapshots.momentum_error[i]
        mass = float("nan") if snapshots.mass_error is None else snapshots.mass_error[i]
        yield (
            f"{i + 1:>4} {condition.mach_number:>5g}"
            + "".join(f" {degrees(angle):>7.4g}" for angle in angles)
            + f" {1e-3 * condition.altitude:>5g}"
            + "".join(f" {value:>8.4f}" for value in coefficients[i])
            + (f" {centre[i]:>7.3f}" if np.isfinite(centre[i]) else f" {'-':>7}")
            + f" {'solved' if snapshots.solved[i] else snapshots.flow[i] + 1:>7}"
            + (f" {100.0 * momentum:>8.4f}" if np.isfinite(momentum) else f" {'-':>8}")
            + (f" {100.0 * mass:>8.4f}" if np.isfinite(mass) else f" {'-':>8}")
            + f" {snapshots.repairs[i]:>7}"
        )
