"""Inspection of a structure, as tables and figures: ``strainfmu inspect structure.h5``."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from strainfmu.files import content_hash_of

if TYPE_CHECKING:
    from builder.structure.observability import SmoothResponse
    from builder.structure.structure_file import Structure

MICROSTRAIN_PER_KPA = 1e9
"""From strain per pressure [1/Pa] to um/m per kPa."""

APART = ("mesh_report", "locking", "made_from")
"""Settings that are shown in tables of their own, or of no use to a reader."""


def inspect_structure(path: Path, folder: Path, console: Console) -> None:
    """Show what ``path`` holds and what its gauge layouts can see; draw figures into ``folder``.

    Raises
    ------
    InputError
        The file is missing, damaged or of another version, or its surface has too few nodes.
    StrainfmuError
        A figure could not be written, or matplotlib is missing.
    """
    from builder.figures import structure_figures
    from builder.figures.drawing import save
    from builder.structure.observability import smooth_response
    from builder.structure.structure_file import SCHEMA, SCHEMA_VERSION, load_structure

    structure = load_structure(path)
    for table in (
        _summary(structure, f"{path}: {structure.vehicle}", content_hash_of(path, SCHEMA, SCHEMA_VERSION)),
        *((_mesh_report(structure), _locking(structure)) if "mesh_report" in structure.settings else ()),
        *(_gauges(structure, layout) for layout in structure.layouts),
    ):
        console.print(table)
    with console.status("Response of the gauges"):
        response = smooth_response(structure.strain_operator, structure.point, structure.surface.node_area)
    console.print(_singular_values(structure, response))
    console.print(_symmetries(structure, response))
    with console.status("Figures"):
        for name, figure in (
            ("mesh_and_gauges", structure_figures.mesh_and_gauges(structure)),
            ("strain_patterns", structure_figures.strain_patterns(structure, response)),
            ("waves", structure_figures.waves(structure, response)),
            ("singular_values", structure_figures.singular_values(structure, response)),
        ):
            save(figure, folder / f"{name}.png")
            console.print(f"{folder / f'{name}.png'}: written", highlight=False, markup=False, soft_wrap=True)


def _summary(structure: Structure, title: str, content_hash: str) -> Table:
    table = Table(title=escape(title), show_header=False)
    table.add_column()
    table.add_column(overflow="fold")
    table.add_row("content hash", content_hash)
    table.add_row("model", structure.model.replace("_", " "))
    for key, value in (*_plain(structure.statistics), *_plain(structure.settings)):
        table.add_row(key, escape(value))
    surface = structure.surface
    table.add_row("surface under pressure", f"{len(structure.point)} nodes, {surface.area.sum():.6g} m2")
    return table


def _plain(entries: dict[str, Any], before: str = "") -> Iterator[tuple[str, str]]:
    """Yield names and values of nested entries, names joined, underscores as spaces."""
    for key, value in entries.items():
        name = f"{before}{key.replace('_', ' ')}"
        if isinstance(value, dict) and key not in APART:
            yield from _plain(value, f"{name}, ")
        elif key not in APART and value is not None:
            yield name, f"{value:.6g}" if isinstance(value, float) else str(value)


def _mesh_report(structure: Structure) -> Table:
    """Return rows (what, value, unit) of the mesh report."""
    table = _with_columns("Mesh", ("what", "value", "unit"), "value")
    for what, value, unit in structure.settings.get("mesh_report", []):
        text = f"{value:d}" if isinstance(value, int) else f"{value:.6g}"
        table.add_row(escape(str(what)), text, str(unit))
    return table


def _locking(structure: Structure) -> Table:
    ratio = "hoop strain over closed form"
    table = _with_columns("Locking check", ("pressure on a ring", ratio), ratio)
    for harmonic, value in structure.settings.get("locking", {}).items():
        table.add_row(f"cos({harmonic} phi)", f"{value:.4f}")
    return table


def _gauges(structure: Structure, layout: str) -> Table:
    """Return one row per gauge of a layout; strain is that under the same pressure at every node."""
    from builder.structure.observability import direction_names

    numbers = ("x [m]", "roll [deg]", "length [mm]", "strain [um/m]", "error [um/m]")
    headings = ("gauge", *numbers[:2], "direction", "surface", *numbers[2:])
    gauges = structure.gauges_of(layout)
    title = f"Layout {layout}: {len(gauges)} gauges; |strain| under uniform pressure and mesh error, both per kPa"
    table = _with_columns(title, headings, *numbers)
    directions = direction_names(structure.gauge_position, structure.gauge_direction)
    uniform = MICROSTRAIN_PER_KPA * np.abs(structure.strain_operator.sum(axis=1))
    for i in gauges.tolist():
        x, y, z = structure.gauge_position[i]
        length = structure.gauge_length[i]
        table.add_row(
            escape(structure.gauge_names[i]),
            f"{x:.4g}",
            f"{degrees(np.arctan2(y, z)) % 360.0:.4g}",
            directions[i],
            structure.gauge_surface[i],
            f"{1e3 * length:.3g}" if length else "point",
            f"{uniform[i]:.3g}",
            f"{MICROSTRAIN_PER_KPA * structure.mesh_error[i]:.2g}",
        )
    return table


def _singular_values(structure: Structure, response: SmoothResponse) -> Table:
    title = (
        f"Singular values of Z_p [um/m per kPa rms] over smooth pressures (degree {response.degree.max()} in x, "
        f"{response.harmonic.max()} harmonics), weighted by area: they do not depend on the mesh"
    )
    table = _with_columns(title, ("layout", "gauges", "singular values", "condition number"), "gauges")
    for layout in structure.layouts:
        gauges = structure.gauges_of(layout)
        values = response.at_gauges(gauges).singular_values()
        condition = f"{values[0] / values[-1]:.4g}" if values[-1] > 1e-12 * values[0] else "infinite"
        text = " ".join(f"{MICROSTRAIN_PER_KPA * value:.3g}" for value in values)
        table.add_row(escape(layout), str(len(gauges)), text, condition)
    return table


def _symmetries(structure: Structure, response: SmoothResponse) -> Table:
    from builder.structure.observability import CLASS_DEGREE, THRESHOLD, symmetry_responses

    title = (
        f"Pressure by its symmetry, degree {CLASS_DEGREE} in x: largest singular value [um/m per kPa rms], and "
        f"rank above {100.0 * THRESHOLD:g} % of the layout's largest"
    )
    table = _with_columns(title, ("layout", "pressure", "largest", "rank", ""), "largest", "rank")
    for layout in structure.layouts:
        for strain in symmetry_responses(response.at_gauges(structure.gauges_of(layout))):
            norm = MICROSTRAIN_PER_KPA * strain.norm
            rank = f"{strain.rank} of {len(strain.singular_values)}"
            table.add_row(
                escape(layout), str(strain.symmetry), f"{norm:.3g}", rank, "blind" if strain.blind else ""
            )
    return table


def _with_columns(title: str, headings: tuple[str, ...], *right: str) -> Table:
    table = Table(title=escape(title), box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for heading in headings:
        justify: Literal["left", "right"] = "right" if heading in right else "left"
        words = heading in ("gauge", "direction", "surface")  # numbers' headings can be broken instead
        table.add_column(escape(heading), justify=justify, overflow="fold", no_wrap=words)
    return table
