"""What a calibration says in plain words: a mass or a load cell that differs, a chi-square that does not fit."""

from __future__ import annotations

from builder.calibration.estimate.vehicle import Estimate
from builder.structure.as_built.vehicle import slices

NAMED = 3.0
"""Standard deviations after the test from which a difference is named."""

SMALLEST = 0.01
"""Relative difference from which one is named [1]."""


def remarks(found: Estimate) -> tuple[str, ...]:
    """Return a line for each thing that the user should look at, none where all is as stated."""
    lines = [_of_mass(found), *_of_load_cells(found), found.disagreement]
    return tuple(line for line in lines if line)


def _differs(size: float, std: float) -> bool:
    return abs(size) >= SMALLEST and abs(size) > NAMED * std


def _of_mass(found: Estimate) -> str:
    part = found.parameters
    at = slices(part.counts)["mass"].start
    size, std = float(found.vector[at]), float(found.std[at])
    if not _differs(size, std):
        return ""
    return (
        f"mass: the vehicle weighs {100.0 * abs(size):.2g} +- {100.0 * std:.1g} % "
        f"{'more' if size > 0.0 else 'less'} than the vehicle file states; weigh it, and check "
        "material.density_kg_per_m3 and what is mounted on the vehicle"
    )


def _of_load_cells(found: Estimate) -> list[str]:
    model, lines = found.model, []
    for k in range(len(model.cells)):
        at = model.cell_entries.start + k
        size, std = float(found.vector[at]), float(found.std[at])
        if _differs(size, std):
            lines.append(
                f"{model.names[at]}: loads are {100.0 * abs(size):.2g} +- {100.0 * std:.1g} % "
                f"{'larger' if size > 0.0 else 'smaller'} than it reads; calibrate it"
            )
    return lines
