"""The tables of the report: raw numbers with units."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from builder.reports.page.page_tables import Column, Table, make_table, records_table
from builder.reproduce.case_2 import COEFFICIENTS, load_readings
from builder.reproduce.parity import ParityRow, Verdict
from builder.reproduce.setups import TITLES
from builder.reproduce.studies import Studies

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
