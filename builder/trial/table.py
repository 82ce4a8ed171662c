"""The one long table of a trial: a row per case, estimator and load; written as CSV, Parquet and JSON, and
printed."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Sequence
from itertools import takewhile
from math import isfinite, log
from pathlib import Path
from typing import Any

from builder.trial.cases import ALL_STATED, Case
from builder.trial.score import ALL, MISSED, NONE, OK, OPEN, PARTS, Row
from strainfmu.errors import library
from strainfmu.files import write_bytes_atomically

TITLES: dict[str, str] = {
    "drawn": "All that sigma includes, drawn at its stated size: sigma is as large as the errors, no alarms",
    "alone": "Stated errors, at most twice their sizes: sigma includes them",
    "beyond": "Beyond what is stated: flagged, or right all the same",
    "unobservable": "Unobservable: another flight has the same strain",
}
"""Classes in the order of the table."""

FIRST = (
    *("case", "error", "size", "class", "estimator", "load", "samples", "vehicles", "flights"),
    *("rms", "rms_error", "bias", "sigma", "rms_z", "rms_z_error"),
    *(f"{part}_percent{suffix}" for part in ("covered", *PARTS) for suffix in ("", "_error", "_upper")),
    *("over_bound", "over_single", "verdict", "why"),
)
"""Columns, as far as there are any of them; further ones stand behind."""

LOAD_WANTED = 0.9
"""Rms of the error over sigma that is aimed at: the load that is furthest off is shown."""

_ORDER = {MISSED: 0, OPEN: 1, OK: 2, NONE: 3}


def columns_of(rows: Iterable[Row]) -> list[str]:
    """Return the columns of ``rows``: what stands ahead in them, :data:`FIRST`, others."""
    names = dict.fromkeys(name for row in rows for name in row)
    ahead = list(takewhile(lambda name: name not in FIRST, names))
    known = [name for name in FIRST if name in names]
    return [*ahead, *known, *(name for name in names if name not in FIRST and name not in ahead)]


def write_table(rows: Sequence[Row], path: Path) -> None:
    """Write ``rows`` to ``path``, in the format of its suffix: ``.csv``, ``.parquet`` or ``.json``.

    Raises
    ------
    StrainfmuError
        The file could not be written, or Parquet needs pyarrow.
    """
    columns = columns_of(rows)
    known = [{name: _known(row.get(name)) for name in columns} for row in rows]
    if path.suffix == ".json":
        content = (json.dumps(known, indent=1, allow_nan=False) + "\n").encode()
    elif path.suffix == ".parquet":
        content = _parquet(known)
    else:
        stream = io.StringIO()
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows([[text_of(value) for value in row.values()] for row in known])
        content = stream.getvalue().encode()
    write_bytes_atomically(path, content)


def _known(value: Any) -> Any:
    return None if isinstance(value, float) and not isfinite(value) else value


def text_of(value: Any) -> str:
    """Return the text of a cell."""
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)


def _parquet(rows: list[Row]) -> bytes:
    parquet, arrow = (library(name, "pyarrow", "parquet") for name in ("pyarrow.parquet", "pyarrow"))
    content = io.BytesIO()
    parquet.write_table(arrow.Table.from_pylist(rows), content)
    return content.getvalue()


def in_order(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return the rows of all loads by class: all stated errors together first, then missed ones, then by
    undetected samples and by missing right ones."""

    def rank(row: Row) -> tuple[float, ...]:
        ahead = row["error"] != ALL_STATED
        return ahead, _ORDER[row["verdict"]], -round(row["undetected_percent"], 1), round(row["right_ok_percent"])

    groups = {name: [row for row in rows if row["class"] == name and row["load"] == ALL] for name in TITLES}
    return {name: sorted(of_class, key=rank) for name, of_class in groups.items() if of_class}


def loads_of(rows: Sequence[Row]) -> dict[tuple[str, str], list[Row]]:
    """Return the rows of single loads by case and estimator."""
    found: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if "rms_z" in row:
            found.setdefault((row["case"], row["estimator"]), []).append(row)
    return found


HEADINGS = (
    *("case", "estimator", "samples", "right OK", "right flagged", "wrong flagged", "undetected", "no estimate"),
    *("covered", "rms z", "/bound", "verdict"),
)
"""Of the table for a terminal; shares in % of the samples. Of coverage, rms over sigma and rms over bound the load
that is furthest off."""


def cells_of(row: Row, loads: Sequence[Row]) -> list[str]:
    """Return the cells under :data:`HEADINGS` of the ``row`` of all loads and the rows of single ``loads``."""
    parts = [row[f"{part}_percent"] for part in PARTS]
    undetected = f"{parts[3]:.2f} +- {row['undetected_percent_error']:.2f}"
    shares = [f"{part:.2f}" for part in parts[:3]] + [undetected, f"{parts[4]:.2f}"]
    z = _furthest(loads, "rms_z", lambda value: abs(log(max(value, 1e-9) / LOAD_WANTED)))
    covered = _furthest(loads, "covered_percent", lambda value: -value)
    bound = _furthest(loads, "over_bound", float)
    return [row["case"], row["estimator"], f"{row['samples']}", *shares, covered, z, bound, row["verdict"]]


def _furthest(loads: Sequence[Row], column: str, off: Any) -> str:
    """Return the value in ``column`` that is furthest off, and its load; a dash where none is known."""
    known = [row for row in loads if (value := row.get(column)) is not None and value == value]
    if not known:
        return "-"
    worst = max(known, key=lambda row: float(off(row[column])))
    return f"{worst[column]:.2f} {worst['load']}"


ERROR_TITLE = "rms errors [1e-4]; of what is no load the 95th percentile of the error [1, rad]"


def error_cells(rows: Sequence[Row]) -> list[list[str]]:
    """Return headings and the errors of each case and estimator, where there are estimators of several kinds."""
    if not any("p95" in row for row in rows):
        return []
    of_each, names = dict[tuple[str, str], dict[str, str]](), dict[str, None]()
    for row in rows:
        if (value := row.get("p95", row.get("rms"))) is not None:
            names[row["load"]] = None
            text = f"{value:.3g}" if "p95" in row else f"{1e4 * value:.1f}"
            of_each.setdefault((row["case"], row["estimator"]), {})[row["load"]] = text
    return [
        ["case", "estimator", *names],
        *([*key, *(texts.get(name, "-") for name in names)] for key, texts in of_each.items()),
    ]


def reasons(rows: Sequence[Row]) -> list[str]:
    """Return the largest fractions of stated errors, why cases are missed, and how many are open, a line each."""
    of_all = [row for row in rows if row["load"] == ALL]
    stated, lines = [row for row in of_all if row["class"] == "alone"], list[str]()
    for what in ("flagged", "undetected") if stated else ():
        largest = sorted(stated, key=lambda row: -row[f"{what}_percent"])[:2]
        text = "; ".join(f"{row[f'{what}_percent']:.2f} % ({row['case']}, {row['estimator']})" for row in largest)
        lines.append(f"{what}, the largest of {len(stated)} stated errors: {text}")
    missed = [row for row in of_all if row["verdict"] == MISSED]
    lines += [f"missed: {row['case']} ({row['estimator']}): {row['why']}" for row in missed]
    n_open = sum(row["verdict"] == OPEN for row in of_all)
    return lines + ([f"open: {n_open} of {len(of_all)}, more samples decide"] if n_open else [])


CLASSES = {"drawn": "within", "alone": "within", "beyond": "outside", "unobservable": "unobservable"}
"""Former names of the classes."""

COLUMNS = {"rms": "rms", "coverage_percent": "covered_percent"}
OF_MOTION = {"rms_over_single": "over_single"}
OF_SAMPLES = {"bound": "bound", "bias": "bias", "rms_z": "rms_z", "coverage_1_percent": "covered_1_percent"}
"""Columns of the loads by their former names: of all rows, of flights in time, of others."""


def stress_entries(cases: Sequence[Case], rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return an entry for each case and estimator, as version 0.2 wrote them."""
    of_name, loads, entries = {case.name: case for case in cases}, loads_of(rows), []
    for row in (one for one in rows if one["load"] == ALL):
        case, words = of_name[f"{row['error']} {row['size']}"], row["health"].split()
        health = {name: round(float(share), 4) for name, share in zip(words[::2], words[1::2], strict=True)}
        entry = {
            "error": row["error"],
            "size": row["size"],
            "class": CLASSES[row["class"]],
            "detected_percent": round(100.0 - health.get("OK", 0.0), 4),
            "undetected_percent": round(row["undetected_percent"], 4),
            "samples": row["samples"],
            "what": case.what,
            "missed": row["why"].split("; ") if row["verdict"] == MISSED else [],
        }
        if case.motion is not None:
            kind, _, seconds = row["estimator"].partition(" ")
            entry |= {"estimator": kind, "time_constant_s": float(seconds.removesuffix(" s") or 0.0)}
        else:
            right_flagged = round(row["right_flagged_percent"], 4)
            entry |= {
                "wrong_percent": round(row["wrong_flagged_percent"] + row["undetected_percent"], 4),
                "health": health,
                "conditions": row["flights"],
                "false_alarms_percent": right_flagged if entry["class"] == "within" else None,
            }
        columns = COLUMNS | (OF_SAMPLES if case.motion is None else OF_MOTION)
        of_case = loads[row["case"], row["estimator"]]
        entries.append(entry | {key: _rounded(of_case, column) for key, column in columns.items()})
    return entries


def _rounded(loads: Sequence[Row], column: str) -> dict[str, float | None]:
    """Return a column of single loads by name, as numbers of five digits."""
    known = {load["load"]: _known(load.get(column)) for load in loads}
    return {name: None if value is None else float(f"{value:.5g}") for name, value in known.items()}
