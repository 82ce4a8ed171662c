"""The report of the reproduction: a page of HTML, its tables as CSV, all numbers as JSON, figures as PNG.

From top to bottom: the tables, of raw numbers with units; which figures are drawn of which numbers, in the order
of the source; the page and its files.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from builder.figures import source_figures as figures
from builder.figures.drawing import save
from builder.figures.source_figures import SIDES
from builder.reports.page.html import Block, Items, Page, Paragraph, Picture, Section, write_page
from builder.reports.page.page_tables import (
    Column,
    Table,
    by_name,
    make_table,
    records_table,
    tables_json,
    write_csv,
)
from builder.reproduce.case_2 import COEFFICIENTS, load_readings
from builder.reproduce.parity import ParityRow, Verdict, parity_rows, verdicts
from builder.reproduce.protocol import DRAWN_MODES, EXAMPLES, PUBLISHED_GAMMA, Sizes
from builder.reproduce.published import PUBLISHED
from builder.reproduce.setups import INDEPENDENT, PAPER_LIKE, SAME_MESH, TITLES
from builder.reproduce.studies import FIELDS, Studies
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.files import write_bytes_atomically

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Columns = tuple[tuple[str | Callable[[Any], Any], Column], ...]


class _Of(NamedTuple):
    """One row of a table with a row per set-up, or several: title of the set-up, what varies, what is shown."""

    title: str
    name: object
    study: Any


def parity_table(rows: list[ParityRow]) -> Table:
    """Return the published numbers and ours, with the reasons for differences."""
    columns: Columns = (
        ("published.quantity", Column("quantity")),
        ("published.value", Column("published")),
        ("published.location", Column("location")),
        *((partial(_shown, setup), Column(title)) for setup, title in TITLES.items()),
        ("why", Column("reason for the difference")),
    )
    return records_table("parity", "Every published number next to ours, in three set-ups", rows, columns)


def _shown(setup: str, row: ParityRow) -> str:
    return row.shown(setup)


def parity_numbers(rows: list[ParityRow]) -> Table:
    """Return the same as raw numbers, one row per number and set-up."""
    columns = (
        ("title", Column("key")),
        ("study.published.quantity", Column("quantity")),
        ("study.published.unit", Column("unit")),
        ("study.published.low", Column("published low")),
        ("study.published.high", Column("published high")),
        ("name", Column("set-up")),
        (lambda entry: entry.study.ours[entry.name].low, Column("our low")),
        (lambda entry: entry.study.ours[entry.name].high, Column("our high")),
    )
    cells = [_Of(row.published.key, setup, row) for row in rows for setup in TITLES]
    return records_table("parity_numbers", "Published numbers and ours, both ends of every range", cells, columns)


def verdict_table(verdicts: list[Verdict]) -> Table:
    """Return the criteria with our numbers and whether each holds."""
    columns: list[tuple[str | Callable[[Any], Any], Column]] = [("text", Column("criterion"))]
    for setup, title in TITLES.items():
        columns += [
            (partial(_entry, "ours", setup), Column(title)),
            (partial(_entry, "holds", setup), Column("holds")),
        ]
    return records_table("criteria", "Criteria of parity, the source's protocol", verdicts, columns)


def _entry(attribute: str, key: object, record: Any) -> Any:
    """Return one entry of a mapping or array that a record holds."""
    return attrgetter(attribute)(record)[key]


def reading_table(studies: Studies) -> Table:
    """Return K and Case 1's medians per reading of the gauges' rows."""
    columns = (
        ("model", Column("model")),
        ("reading", Column("reading")),
        ("k_1", Column("K1", "1", ".1f")),
        ("k_2", Column("K2", "1", ".1f")),
        ("ratio", Column("K1/K2", "1", ".2f")),
        ("area_ratio", Column("K1/K2, area-weighted POD", "1", ".2f")),
        ("median_1", Column("median field error, Configuration 1", "%", ".1f")),
        ("median_2", Column("median field error, Configuration 2", "%", ".1f")),
    )
    rows = [*studies.measured.readings, *studies.measured.spans]
    caption = "The readings of the gauges' rows (published: K1 89.61, K2 47.96, ratio 1.87; medians 7.5 and 5.5 %)"
    return records_table("readings", caption, rows, columns)


def hoop_table(studies: Studies) -> Table:
    """Return hoop and axial strain of each model."""
    columns = (
        ("model", Column("model")),
        ("hoop_gain", Column("hoop strain returned", "%", ".1f")),
        ("axial_gain", Column("axial strain returned", "%", ".2f")),
        ("hoop_error", Column("rms difference, hoop", "sigma", ".3g")),
        ("axial_error", Column("rms difference, axial", "sigma", ".3g")),
    )
    caption = (
        "Strain of Configuration 2 over P1 against the Fourier model; data of the map's own mesh hide all of it"
    )
    return records_table("hoop_strain", caption, studies.measured.hoop, columns)


def crime_table(studies: Studies) -> Table:
    """Return the noise-free example for pairs of models."""
    columns = (
        ("inversion", Column("map")),
        ("data", Column("data")),
        ("field_error", Column("field error", "%")),
        ("odd_error", Column("its part odd in y and z", "%")),
        ("odd_strain", Column("strain of the doubly odd prior", "of all", ".2e")),
    )
    caption = (
        "M5 a6 b6 without noise, gamma 1e-6 (published: 2.8 %); the condition is in the prior, as in the source"
    )
    return records_table("noise_free", caption, studies.measured.crime, columns)


def class_table(studies: Studies) -> Table:
    """Return the response of the layouts to each symmetry class."""
    columns = (
        ("model", Column("model")),
        ("layout", Column("layout")),
        ("symmetry", Column("pressure")),
        ("response", Column("maximum response", "1/Pa", ".2e")),
        ("rank", Column("rank")),
        ("prior_fraction", Column("fraction of the prior's variance", "%", ".2f")),
    )
    caption = "Response of the layouts to smooth pressures, by symmetry; rank 0: blind"
    return records_table("symmetry_classes", caption, studies.measured.classes, columns)


def layout_table(studies: Studies) -> Table:
    """Return the field errors of the published layout and of "45"."""
    columns = [
        Column("set-up"),
        Column("condition"),
        Column("published layout: minimum", "%", ".1f"),
        Column("median", "%", ".1f"),
        Column("maximum", "%", ".1f"),
        Column("layout '45': minimum", "%", ".1f"),
        Column("median", "%", ".1f"),
        Column("maximum", "%", ".1f"),
    ]
    cells = []
    for key, title in TITLES.items():
        for what, condition in (
            ("noise_free", "M5 a6 b6, no noise, gamma 1e-6"),
            ("noisy", "M5 a6 b6, 100 draws"),
            ("off_set", "M6 a0 b5, 100 draws"),
        ):
            ours = [100.0 * studies.fields[f"{key}-{name}"].errors for name in (what, f"{what}_45")]
            cells.append([title, condition, *(f(e) for e in ours for f in (np.min, np.median, np.max))])
    return make_table(
        "layout_45",
        "Relative error of the field with the published layout and with the layout '45'",
        columns,
        cells,
    )


def load_table(studies: Studies, moment_station: float) -> Table:
    """Return errors of the coefficients at M5 a6 b6 by each reading of the loads."""
    columns = [Column("set-up"), Column("loads")]
    columns += [Column(f"{name} {end}", "%", ".2f") for name in COEFFICIENTS for end in ("mean", "largest")]
    cells = []
    for key, title in TITLES.items():
        error = 100.0 * studies.fields[f"{key}-noisy"].load_error
        for i, reading in enumerate(load_readings(moment_station)):
            numbers = [f(error[:, k, i]) for k in range(len(COEFFICIENTS)) for f in (np.mean, np.max)]
            cells.append([title, reading.name, *numbers])
    caption = (
        "Relative errors of the coefficients at M5 a6 b6, 100 draws, by reading of what the source leaves open"
    )
    return make_table("loads", caption, columns, cells)


def gamma_table(studies: Studies) -> Table:
    """Return gamma by each rule."""
    rules = list(next(iter(studies.gamma.values())).by_rule)
    columns: Columns = (
        ("title", Column("set-up")),
        ("name", Column("layout")),
        *((partial(_entry, "study.by_rule", rule), Column(rule, "1", ".3g")) for rule in rules),
    )
    cells = [
        _Of(title, layout, studies.gamma[f"{key}{suffix}"])
        for key, title in TITLES.items()
        for suffix, layout in (("", "published"), ("-45", "'45'"))
    ]
    return records_table("gamma", "gamma by rule (published: 3.16 by the Morozov-like rule)", cells, columns)


def coverage_table(studies: Studies) -> Table:
    """Return the coverage of Case 1's 3 sigma of the noise alone."""
    columns: Columns = (
        ("title", Column("set-up")),
        ("name", Column("configuration")),
        ("study.relative_condition", Column("K", "1", ".2f")),
        *((partial(_entry, "study.covered", i), Column(f"q_{i + 1} covered", "%", ".1f")) for i in range(5)),
        ("study.scaling", Column("scaling of K")),
    )
    cells = [_Of(title, n, studies.case_1[f"{key}-{n}"]) for key, title in TITLES.items() for n in (1, 2)]
    caption = "Case 1: samples within the 3 sigma of the noise alone (99.73 % if noise were the only error)"
    return records_table("coverage", caption, cells, columns)


def scatter_table(studies: Studies) -> Table:
    """Return the eigenvalues with scattered snapshots."""
    columns = (
        ("model", Column("model")),
        ("scatter", Column("scatter of every pressure", "%")),
        ("above", Column("eigenvalues above 1e-6")),
        ("decay", Column("lambda_1 / lambda_8", "1", ".3g")),
        ("smallest", Column("smallest eigenvalue", "1", ".1e")),
    )
    caption = "Eigenvalues of Case 2 with an independent error in every pressure of every snapshot (published: 54)"
    return records_table("scatter", caption, studies.measured.scatter, columns)


DRAWS = {
    "noisy": "M5 a6 b6, published layout",
    "noisy_45": "M5 a6 b6, layout '45'",
    "off_set": "M6 a0 b5, published layout",
    "off_set_45": "M6 a0 b5, layout '45'",
}
"""Fields whose hundred draws are compared, with their labels."""


def figure_makers(studies: Studies, grid: SurfaceGrid) -> dict[str, tuple[Callable[[], Figure], str]]:
    """Return, by name, what draws each figure and its caption."""
    return {**_of_case_1(studies, grid), **_of_case_2(studies, grid)}


def _of_case_1(studies: Studies, grid: SurfaceGrid) -> dict[str, tuple[Callable[[], Figure], str]]:
    made: dict[str, tuple[Callable[[], Figure], str]] = {
        "pod_differences": (
            partial(_pod_differences, studies),
            "Source's figure of the differences in POD coefficients with 3 sigma marks.",
        ),
        "reconstruction_errors": (
            partial(_reconstruction_errors, studies),
            "Source's figure of the errors of the reconstructed field.",
        ),
    }
    for example, number in (("m5_a6_b5", 1), ("m7_a2_b8", 2)):
        for setup in (PAPER_LIKE, INDEPENDENT):
            made[f"field_{example}_{setup}"] = (
                partial(_field_of_case_1, studies, setup, example, number, grid),
                f"Source's field comparison, Configuration {number}, set-up {setup.replace('_', ' ')}.",
            )
    made["coefficient_differences"] = (
        lambda: figures.coefficient_differences(
            {title: studies.case_1[f"{key}-2"].coefficient_error for key, title in TITLES.items()}
        ),
        "Source's figure of the differences in force and moment coefficients.",
    )
    return made


def _of_case_2(studies: Studies, grid: SurfaceGrid) -> dict[str, tuple[Callable[[], Figure], str]]:
    modes = dict(zip(DRAWN_MODES, studies.modes.T, strict=True))
    made: dict[str, tuple[Callable[[], Figure], str]] = {
        "eigenvalues": (partial(_eigenvalue_decay, studies), "Source's figure of the eigenvalues."),
        "eigenvectors": (
            partial(figures.eigenvectors, modes, grid),
            "Source's figure of eigenvectors 1, 3, 6, 23 and 53.",
        ),
    }
    for what, n_modes in (("noise_free", 54), ("noisy", None), ("off_set", None)):
        for setup in (PAPER_LIKE, SAME_MESH, INDEPENDENT):
            n_kept = n_modes or int((studies.gamma[setup].eigenvalues >= PUBLISHED_GAMMA).sum())
            made[f"field_{what}_{setup}"] = (
                partial(_field_of_case_2, studies, setup, what, n_kept, grid),
                f"Source's field comparison, {what.replace('_', ' ')}, set-up {setup.replace('_', ' ')}.",
            )
    made["draw_ranges"] = (partial(_draw_ranges, studies), "Errors of the hundred draws.")
    made["noise_free_errors"] = (partial(_noise_free_errors, studies), "Where the 2.8 % come from.")
    made["reading_ratios"] = (partial(_reading_ratios, studies), "Where K1/K2 comes from.")
    return made


def _pod_differences(studies: Studies) -> Figure:
    return figures.pod_differences(
        {
            title: {
                number: figures.PodDifferences(
                    studies.case_1[f"{key}-{number}"].pod_error, studies.case_1[f"{key}-{number}"].pod_bound
                )
                for number in (1, 2)
            }
            for key, title in TITLES.items()
        }
    )


def _reconstruction_errors(studies: Studies) -> Figure:
    return figures.reconstruction_errors(
        {
            title: {number: studies.case_1[f"{key}-{number}"].field_error for number in (1, 2)}
            for key, title in TITLES.items()
        },
        {number: PUBLISHED[f"field_{number}"].low for number in (1, 2)},
    )


def _field_of_case_1(studies: Studies, setup: str, example: str, number: int, grid: SurfaceGrid) -> Figure:
    field = studies.examples[f"{setup}-{example}"]
    title = f"{EXAMPLES[example]}, Configuration {number}, {TITLES[setup]}: error {100.0 * field.shown:.1f} %"
    return figures.reference_and_estimate(field.reference, field.estimate, grid, title)


def _eigenvalue_decay(studies: Studies) -> Figure:
    spectra = [
        figures.Spectrum(label, studies.gamma[f"{key}{suffix}"].eigenvalues, bool(suffix))
        for key, title in TITLES.items()
        for suffix, label in (("", title), ("-45", f"{title}, layout '45'"))
    ]
    return figures.eigenvalue_decay(spectra, PUBLISHED_GAMMA)


def _field_of_case_2(studies: Studies, setup: str, what: str, n_modes: int, grid: SurfaceGrid) -> Figure:
    field = studies.fields[f"{setup}-{what}"]
    condition = EXAMPLES[FIELDS[what][0]]
    fields = {
        "reference": field.reference,
        f"projected, r = {n_modes}": field.projection,
        "estimate": field.estimate,
    }
    side = "from leeward", condition.leeward_roll_angle % (2.0 * np.pi)
    if what.startswith("off_set"):
        side = "from port (-y)", SIDES["from port (-y)"]
    title = f"{condition}, {TITLES[setup]}: error {100.0 * field.shown:.1f} %"
    return figures.field_comparison(fields, field.estimate - field.reference, grid, side, title)


def _draw_ranges(studies: Studies) -> Figure:
    return figures.draw_ranges(
        {
            title: [
                figures.Draws(label, studies.fields[f"{key}-{what}"].errors, _published_range(what))
                for what, label in DRAWS.items()
            ]
            for key, title in TITLES.items()
        }
    )


def _published_range(what: str) -> tuple[float, float] | None:
    row = PUBLISHED.get(what)
    return None if row is None or row.low is None or row.high is None else (row.low, row.high)


def _noise_free_errors(studies: Studies) -> Figure:
    rows = studies.measured.crime
    return figures.noise_free_errors(
        [(row.inversion, row.data) for row in rows],
        np.array([row.field_error for row in rows]),
        np.array([row.odd_error for row in rows]),
        PUBLISHED["noise_free"].low or 0.0,
    )


def _reading_ratios(studies: Studies) -> Figure:
    rows = studies.measured.readings
    models, readings = (list(dict.fromkeys(getattr(row, name) for row in rows)) for name in ("model", "reading"))
    ratios = {model: [row.ratio for row in rows if row.model == model] for model in models}
    return figures.reading_ratios(ratios, readings, PUBLISHED["k_ratio"].low or 0.0)


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
        parity_table(rows),
        parity_numbers(rows),
        verdict_table(verdicts(studies)),
        reading_table(studies),
        hoop_table(studies),
        crime_table(studies),
        class_table(studies),
        layout_table(studies),
        load_table(studies, moment_station),
        gamma_table(studies),
        coverage_table(studies),
        scatter_table(studies),
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
