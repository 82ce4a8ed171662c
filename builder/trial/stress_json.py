"""``stress.json`` of earlier versions from the long table, for one release."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Any

from builder.trial.cases import Case
from builder.trial.score import ALL, Row

CLASSES = {"drawn": "within", "alone": "within", "beyond": "outside", "unobservable": "unobservable"}
"""Former names of the classes."""

_SINGLE = "0 s"


def stress_entries(cases: Sequence[Case], rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return an entry for each case and estimator."""
    what, entries = {case.name: case for case in cases}, []
    for row in (one for one in rows if one["load"] == ALL):
        case = what[f"{row['error']} {row['size']}"]
        loads = [one for one in rows if one["load"] != ALL and _same(one, row)]
        words = row["health"].split()
        health = {name: round(float(share), 4) for name, share in zip(words[::2], words[1::2], strict=True)}
        entry = {
            "error": row["error"],
            "size": row["size"],
            "class": CLASSES[row["class"]],
            "detected_percent": round(100.0 - health.get("OK", 0.0), 4),
            "undetected_percent": round(row["undetected_percent"], 4),
            "samples": row["samples"],
            "what": case.what,
            "missed": row["why"].split("; ") if row["verdict"] == "missed" else [],
        }
        columns = {"rms": "rms", "coverage_percent": "covered_percent"}
        if case.motion is not None:
            kind, _, seconds = row["estimator"].partition(" ")
            entry |= {"estimator": kind, "time_constant_s": float((seconds or _SINGLE).removesuffix(" s"))}
            columns["rms_over_single"] = "over_single"
        else:
            entry |= {
                "wrong_percent": round(sum(row[f"{n}_percent"] for n in ("wrong_flagged", "undetected")), 4),
                "health": health,
                "conditions": row["flights"],
                "false_alarms_percent": round(row["right_flagged_percent"], 4)
                if row["class"] in ("drawn", "alone")
                else None,
                "flagged_percent": entry["detected_percent"],
                "silent_percent": entry["undetected_percent"],
            }
            columns |= {
                "bound": "bound",
                "bias": "bias",
                "rms_z": "rms_z",
                "coverage_1_percent": "covered_1_percent",
            }
        of_loads = {
            key: {load["load"]: _rounded(load.get(column)) for load in loads} for key, column in columns.items()
        }
        entries.append({**entry, **of_loads})
    return entries


def _same(row: Row, other: Row) -> bool:
    return all(row[name] == other[name] for name in ("error", "size", "estimator"))


def _rounded(value: float | None) -> float | None:
    return None if value is None or not isfinite(value) else float(f"{value:.5g}")
