"""The report of the reproduction: a page of HTML, its tables as CSV, all numbers as JSON, figures as PNG."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from builder.figures.drawing.canvas import save
from builder.reports.page.html import Block, Items, Page, Paragraph, Picture, Section, write_page
from builder.reports.page.page_tables import Table, by_name, tables_json, write_csv
from builder.reproduce import paper_tables as tables
from builder.reproduce.acceptance import verdicts
from builder.reproduce.parity import parity_rows
from builder.reproduce.protocol import Sizes
from builder.reproduce.report_figures import figure_makers
from builder.reproduce.studies import Studies
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.files import write_bytes_atomically

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Keep = Callable[[str, Callable[[Path], object]], Path]

SETUP_TEXT = (
    "Paper-like: linear tetrahedra, with constant strain in each element, read from the element of the gauge. The "
    "data come from the map's own mesh and, where the source does so, from flight conditions of the snapshots.",
    "Converged, same mesh: quadratic hexahedra, gauges at their positions; otherwise the same.",
    "Independent data: the map is made from the quadratic hexahedra. The strains come from the Fourier model, a "
    "different discretisation with its own load map, under pressures of a finer flow grid, at conditions whose "
    "flows are not among the snapshots. Statistics of Case 1 are over 40 conditions between P1's. For "
    "M5 a6 b5 and M5 a6 b6 the condition and its mirror images are left out of the snapshots.",
)


def all_tables(studies: Studies, moment_station: float) -> dict[str, Table]:
    """Return all tables by name; ``moment_station`` [m] is the vehicle file's."""
    rows = parity_rows(studies)
    made = [
        tables.parity_table(rows),
        tables.parity_numbers(rows),
        tables.verdict_table(verdicts(studies)),
        tables.reading_table(studies),
        tables.hoop_table(studies),
        tables.crime_table(studies),
        tables.class_table(studies),
        tables.layout_table(studies),
        tables.load_table(studies, moment_station),
        tables.gamma_table(studies),
        tables.coverage_table(studies),
        tables.scatter_table(studies),
    ]
    return by_name(made)


def write_numbers(made: dict[str, Table], folder: Path) -> None:
    """Write each table to ``tables/NAME.csv`` and all of them to ``numbers.json``.

    Raises
    ------
    StrainfmuError
        A file could not be written.
    """
    write_csv(made, folder / "tables")
    content = json.dumps(tables_json(made), indent=1, allow_nan=False)
    write_bytes_atomically(folder / "numbers.json", content.encode())


def write_report(
    studies: Studies, grid: SurfaceGrid, sizes: Sizes, moment_station: float, folder: Path, keep: Keep
) -> None:
    """Write ``report.html``, ``numbers.json`` and ``tables/`` into ``folder``; draw the figures not up to date.

    Parameters
    ----------
    keep : called with the name of a figure's file and a function that writes it to a path; returns the path.

    Raises
    ------
    StrainfmuError
        matplotlib is not installed, or a file could not be written.
    """
    made = all_tables(studies, moment_station)
    write_numbers(made, folder)
    pictures = {}
    for name, (draw, caption) in figure_makers(studies, grid).items():
        path = keep(f"figures/{name}.png", partial(_draw, draw))
        pictures[name] = Picture(content=path.read_bytes(), kind="png", caption=caption, alternative=caption)
    write_page(_page(studies, sizes, made, pictures), folder / "report.html")


def _draw(draw: Callable[[], Figure], path: Path) -> None:
    save(draw(), path)


def _page(studies: Studies, sizes: Sizes, made: dict[str, Table], pictures: dict[str, Picture]) -> Page:
    measured = studies.measured
    opening: tuple[Block, ...] = (
        Paragraph(
            'Pham, Ghattas, Clemens and Willcox, "Real-time aerodynamic load estimation for hypersonics via '
            'strain-based inverse maps", reproduced on the IC3X surrogate: a body of our own, because the source '
            "states one number of its geometry. Agreement is therefore agreement of method and magnitude, not of "
            "digits."
        ),
        Paragraph(
            f"Sizes: '{sizes.name}', {measured.surface_nodes:,} pressure nodes; "
            + ", ".join(f"{name} {dofs:,} dofs" for name, dofs in measured.dofs.items())
            + ". sigma: "
            + ", ".join(
                f"{1e6 * sigma:.3f} um/m ({key.replace('_', ' ')})" for key, sigma in measured.sigma.items()
            )
            + "."
        ),
        Paragraph("Every accuracy is given for three set-ups:"),
        Items(SETUP_TEXT),
    )
    case_1 = ["pod_differences", "reconstruction_errors", *(n for n in pictures if n.startswith("field_m"))]
    case_2 = ["eigenvalues", "eigenvectors", *(n for n in pictures if n.startswith(("field_n", "field_o")))]
    blind = Paragraph(
        "Gauges at 0, 90, 180 and 270 deg along and across the meridian do not respond to pressure that is odd "
        "both in y and in z, on any body with both planes of symmetry. The prior of P2 correlates such pressure "
        "with nothing that they observe. No linear estimator can find it."
    )
    sections = (
        Section("Published and ours", (made["parity"], made["criteria"])),
        Section(
            "Case 1: five POD coefficients",
            (made["coverage"], *(pictures[n] for n in [*case_1, "coefficient_differences"])),
        ),
        Section(
            "Case 2: the whole field",
            (made["gamma"], made["loads"], made["scatter"], *(pictures[n] for n in [*case_2, "draw_ranges"])),
        ),
        Section("Which rows hold the hoop gauges", (made["readings"], pictures["reading_ratios"])),
        Section("What linear tetrahedra lose", (made["hoop_strain"],)),
        Section("The noise-free example", (made["noise_free"], pictures["noise_free_errors"])),
        Section(
            "What the published layout is blind to, and the layout '45'",
            (blind, made["symmetry_classes"], made["layout_45"]),
        ),
    )
    return Page("The source, side by side", opening, sections)
