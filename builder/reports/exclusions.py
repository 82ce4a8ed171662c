"""What the stated uncertainties do not hold, for one vehicle file: said in words, as no number can."""

from __future__ import annotations

from builder.vehicle.file import Vehicle
from builder.vehicle.map_options import Noise

OPTIONAL_ERRORS = (
    ("apparent_strain_um_per_m", "apparent strain, as of an uncompensated temperature"),
    ("gauge_gain_percent", "errors of gauge factor and amplifier gain"),
    ("gauge_position_mm", "errors of the gauges' positions"),
    ("gauge_orientation_deg", "errors of the gauges' directions"),
)
"""Entries of the section [noise] that are 0 by default, and what then counts as none."""


def exclusions(vehicle: Vehicle, engine: str) -> tuple[str, ...]:
    """Return what no sigma of the map holds, one sentence each; ``engine`` is that of the snapshots."""
    model = "Fourier" if vehicle.structure.model == "fourier" else "three-dimensional"
    return (
        "Base pressure: C_A is that of the fore-body.",
        "Flight conditions unlike the snapshots', inside the ranges of this page or outside them.",
        f"Errors of the flow solution ({engine}): modes and prior are its own.",
        f"Errors of the structural model ({model}): stiffness, joints, wall thickness, support.",
        *_absent_noise(vehicle.noise, vehicle.map.case == 1 or vehicle.map.prior_modes is not None),
        "Errors of the dynamic pressure that turns loads into coefficients: it is taken as exact.",
        "Vibration and inertia: strain is taken as the static answer to the pressure of the moment.",
    )


def _absent_noise(noise: Noise, truncates: bool) -> list[str]:
    # Temperature may also come as modes of its own.
    held = {"apparent_strain_um_per_m"} if noise.nuisance_file is not None else set()
    absent = [
        f"{what[0].upper()}{what[1:]}: noise.{entry} is 0."
        for entry, what in OPTIONAL_ERRORS
        if getattr(noise, entry) == 0.0 and entry not in held
    ]
    if truncates and not noise.with_truncated_modes:
        absent.append("Pressure modes that were cut off: they are left out of the noise as the vehicle file asks.")
    return absent
