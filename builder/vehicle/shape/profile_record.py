"""Record of a body's meridian in files made for it, and what differs when the body is another."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, isclose
from typing import Any

import numpy as np

from builder.vehicle.shape.geometry import BodyOfRevolution, Segment
from builder.workspace import Misfit

SAME = 1e-9  # relative, and in metres and degrees
RADII = 16  # of a curve that is neither cone nor arc


def profile_record(body: BodyOfRevolution) -> list[dict[str, float]]:
    """Return the pieces of the meridian as numbers that JSON can hold; of curves other than arcs, radii too."""
    return [_piece_record(piece) for piece in body.segments]


def _piece_record(piece: Segment) -> dict[str, float]:
    record = {
        "end_x_m": float(piece.end_x),
        "start_half_angle_deg": degrees(piece.start_angle),
        "end_half_angle_deg": degrees(piece.end_angle),
    }
    if type(piece) is Segment:
        return record
    share = np.arange(1, RADII + 1) / RADII
    radius = piece.radius(piece.start_x + share * (piece.end_x - piece.start_x)).tolist()
    return {**record, **{f"radius_{number}_m": one for number, one in enumerate(radius, start=1)}}


def profile_misfits(record: Sequence[dict[str, Any]], body: BodyOfRevolution) -> list[Misfit]:
    """Return in what the recorded meridian differs from ``body``; entries count pieces from 1."""
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
