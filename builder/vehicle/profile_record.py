"""Record of a body's meridian in files made for it, and what differs when the body is another."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, isclose
from typing import Any

from builder.vehicle.geometry import BodyOfRevolution
from builder.workspace import Misfit

SAME = 1e-9  # relative, and in metres and degrees


def profile_record(body: BodyOfRevolution) -> list[dict[str, float]]:
    """Return the pieces of the meridian in the entries of a vehicle file, as JSON can hold them."""
    return [
        {
            "end_x_m": float(piece.end_x),
            "start_half_angle_deg": degrees(piece.start_angle),
            "end_half_angle_deg": degrees(piece.end_angle),
        }
        for piece in body.segments
    ]


def profile_misfits(record: Sequence[dict[str, Any]], body: BodyOfRevolution) -> list[Misfit]:
    """Return in what the recorded meridian is not that of ``body``; entries count pieces from 1."""
    expected = profile_record(body)
    if len(record) != len(expected):
        return [Misfit(entry="profile", expected=f"{len(expected)} pieces", found=f"{len(record)}")]
    return [
        Misfit(
            entry=f"profile.{number}.{name}", expected=f"{value:.9g}", found=f"{held.get(name, float('nan')):.9g}"
        )
        for number, (held, wanted) in enumerate(zip(record, expected, strict=True), start=1)
        for name, value in wanted.items()
        if not isclose(held.get(name, float("nan")), value, rel_tol=SAME, abs_tol=SAME)
    ]
