"""The flights of scored vehicles together: errors over the errors of the exactly known vehicle, coverage."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from builder.trial.score import score_of
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

EXACT, BEFORE = "exact", "before"
"""States of what is known of a vehicle, in addition to the tests'."""

EQUATIONS = "load equations"
"""Stands for a map where loads are sums of readings; its errors are over the errors of the first map scored."""


def errors_of(error: FloatArray, sigma: FloatArray, health: IntArray | None = None) -> dict[str, Any]:
    """Return mean squares, coverage and sigma of errors (n, 5) of the coefficients in one vehicle's flights.

    ``health`` (n,) adds how many samples raise an alarm, and how many are not OK.
    """
    score = score_of(COEFFICIENT_NAMES, error, sigma, health=health)
    states = {"alarm_percent": 100.0 * score.alarms, "not_ok_percent": 100.0 * score.detected}
    return {
        **(states if health is not None else {}),
        "mean_square": score.mean_square.tolist(),
        "coverage_percent": (100.0 * score.coverage_3).tolist(),
        "sigma": score.mean_std.tolist(),
    }


def summary(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return pooled rms errors over the errors of the exactly known vehicle, and coverage, by map and state.

    ``rows`` are as from :meth:`builder.calibration.score.vehicles.Score.of_vehicle`. Coverage of the worst
    vehicle is over all coefficients; the worst of single coefficients is next to it.
    """
    kinds = dict.fromkeys(row["map"] for row in rows)
    found = []
    for kind in kinds:
        of_kind = [row for row in rows if row["map"] == kind]
        exact = _exact_square(rows, kind)
        for state in dict.fromkeys(row["state"] for row in of_kind):
            of_state = [row for row in of_kind if row["state"] == state]
            coverage = np.array([row["coverage_percent"] for row in of_state])
            square = np.mean([row["mean_square"] for row in of_state], axis=0)
            chi = [row["chi_square_per_reading"] for row in of_state if "chi_square_per_reading" in row]
            found.append(
                {
                    "map": kind,
                    "state": state,
                    "vehicles": len(of_state),
                    "rms": dict(zip(COEFFICIENT_NAMES, np.sqrt(square).tolist(), strict=True)),
                    "ratio": None if exact is None else np.sqrt(square / exact).round(3).tolist(),
                    "coverage_percent": coverage.mean(axis=0).round(2).tolist(),
                    "pooled_coverage_percent": float(coverage.mean().round(2)),
                    "worst_vehicle_percent": float(coverage.mean(axis=1).min().round(1)),
                    "worst_vehicle_one_coefficient_percent": float(coverage.min().round(1)),
                    "chi_square_per_reading": None if not chi else [min(chi), float(np.mean(chi)), max(chi)],
                    "faults": sum(row.get("faults", 0) for row in of_state),
                    "alarm_percent": _mean(of_state, "alarm_percent"),
                    "not_ok_percent": _mean(of_state, "not_ok_percent"),
                }
            )
    return found


def _mean(rows: Sequence[dict[str, Any]], name: str) -> float | None:
    values = [row[name] for row in rows if name in row]
    return float(np.mean(values)) if values else None


def _exact_square(rows: Sequence[dict[str, Any]], kind: str) -> FloatArray | None:
    """Return mean squares (5,) of the exactly known vehicles; None where none were scored."""
    of = rows[0]["map"] if kind == EQUATIONS else kind
    squares = [row["mean_square"] for row in rows if row["map"] == of and row["state"] == EXACT]
    return np.mean(squares, axis=0) if squares else None


def table(lines: Sequence[dict[str, Any]]) -> str:
    """Return the summary as a table for a terminal."""
    head = f"{'map':15s}{'state':28s}{'rms over exact: ' + ' '.join(COEFFICIENT_NAMES):34s}"
    text = [head + f"{'3 sigma %':>10s}{'worst':>7s}{'one':>6s}  chi-square/n      faults  alarm %"]
    for line in lines:
        ratio = " ".join(f"{value:6.2f}" for value in line["ratio"] or [])
        chi = line["chi_square_per_reading"]
        fit = "" if chi is None else f"{chi[1]:.2f} ({chi[0]:.2f}-{chi[2]:.2f})"
        text.append(
            f"{line['map']:15s}{line['state']:28s}{ratio:34s}{line['pooled_coverage_percent']:10.2f}"
            f"{line['worst_vehicle_percent']:7.1f}{line['worst_vehicle_one_coefficient_percent']:6.1f}  "
            f"{fit:19s}{line['faults'] if chi else '':>5}"
            + ("" if line["alarm_percent"] is None else f"{line['alarm_percent']:9.3f}")
        )
    return "\n".join(text)
