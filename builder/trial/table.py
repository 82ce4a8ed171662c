"""The one long table of a trial: a row per case, estimator and load; written as CSV, Parquet and JSON, and
printed."""

import csv
import io
import json
from collections.abc import Iterable, Sequence
from itertools import takewhile
from math import isfinite, log
from pathlib import Path
from typing import Any

from builder.trial.cases import ALL_STATED, Case
from builder.trial.score import ALL, MISSED, NONE, OK, OPEN, PARTS, Row, by_load
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
    loads: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if "rms_z" in row:
            loads.setdefault((row["case"], row["estimator"]), []).append(row)
    return loads


HEADINGS = (
    *("case", "estimator", "samples", "right OK", "right flagged", "wrong flagged", "undetected", "no estimate"),
    *("covered", "rms z", "rms over", "verdict"),
)
"""Of the table for a terminal; shares in % of the samples. Of coverage, rms over sigma and rms over :data:`OVER`
the load that is furthest off."""

OVER = ("over_bound", "over_single", "over_exact")
"""Rms errors over the bound, over single samples, over the exactly known vehicle: what a trial has of these."""


def cells_of(row: Row, loads: Sequence[Row]) -> list[str]:
    """Return the cells under :data:`HEADINGS` of the ``row`` of all loads and the rows of single ``loads``."""
    parts = [row[f"{part}_percent"] for part in PARTS]
    undetected = f"{parts[3]:.2f} +- {row['undetected_percent_error']:.2f}"
    shares = [f"{part:.2f}" for part in parts[:3]] + [undetected, f"{parts[4]:.2f}"]
    z = _furthest(loads, "rms_z", lambda value: abs(log(max(value, 1e-9) / LOAD_WANTED)))
    covered = _furthest(loads, "covered_percent", lambda value: -value)
    over = next((_furthest(loads, name, float) for name in OVER if any(name in load for load in loads)), "-")
    return [row["case"], row["estimator"], f"{row['samples']}", *shares, covered, z, over, row["verdict"]]


def _furthest(loads: Sequence[Row], column: str, off: Any) -> str:
    """Return the value in ``column`` that is furthest off, and its load; a dash where none is known."""
    known = [row for row in loads if (value := row.get(column)) is not None and value == value]
    if not known:
        return "-"
    worst = max(known, key=lambda row: float(off(row[column])))
    return f"{worst[column]:.2f} {worst['load']}"


NOT_SHOWN = ("case", "size", "class", "verdict", "why")


def line_of(row: Row) -> str:
    """Return a ``row`` of what no table shows, such as what a calibration says, without statistical errors."""
    names = (name for name in row if name not in NOT_SHOWN and not name.endswith(("_error", "_upper")))
    return ", ".join(f"{name.replace('_', ' ')} {text_of(row[name])}" for name in names)


def reasons(rows: Sequence[Row]) -> list[str]:
    """Return why cases are missed, and how many are open, a line each."""
    of_all = [row for row in rows if row["load"] == ALL]
    missed = [row for row in of_all if row["verdict"] == MISSED]
    lines = [f"missed: {row['case']} ({row['estimator']}): {row['why']}" for row in missed]
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
    for row in (entry for entry in rows if entry["load"] == ALL):
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
        for key, column in columns.items():
            values = by_load(loads[row["case"], row["estimator"]], column)
            entry[key] = {load: None if value is None else float(f"{value:.5g}") for load, value in values.items()}
        entries.append(entry)
    return entries
