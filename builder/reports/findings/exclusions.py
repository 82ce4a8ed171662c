"""Errors that the stated uncertainties of one vehicle file do not include, in words."""

from __future__ import annotations

from builder.inverse.noise.inertia import inertia_in_words
from builder.vehicle.file import Vehicle
from builder.vehicle.map.options import Noise

OPTIONAL_ERRORS = (
    ("apparent_strain_um_per_m", "apparent strain, such as from an uncompensated temperature"),
    ("gauge_gain_percent", "errors of gauge factor and amplifier gain"),
    ("common_gain_percent", "errors common to all gains, such as an error of Young's modulus"),
    ("gauge_position_mm", "errors of the gauges' positions"),
    ("gauge_orientation_deg", "errors of the gauges' directions"),
    ("layout_roll_deg", "an error of the whole layout's roll angle"),
    ("wall_thickness_percent", "an error of the wall's thickness"),
    ("internal_pressure_percent", "errors of the internal pressure"),
)
"""Entries of the section [noise], and the error that is left out where one is 0."""

OF_STRUCTURE = {
    "distribution of stiffness": ("region_modulus_percent",),
    "distribution of thickness": ("wall_harmonic_percent", "wall_second_harmonic_percent", "wall_taper_percent"),
    "joints": ("joint_softness_mm",),
    "support": ("clamp_compliance_mm",),
}
"""Errors of the structural model that are left out where none of their entries is stated."""


def exclusions(vehicle: Vehicle, engine: str) -> tuple[str, ...]:
    """Return what no sigma of the map includes, one sentence each; ``engine`` is the one of the snapshots."""
    model = "Fourier" if vehicle.structure.model == "fourier" else "three-dimensional"
    return (
        "Base pressure: C_A is the fore-body's.",
        "Flight conditions that differ from the snapshots', inside or outside the ranges of this page.",
        f"Errors of the flow solution ({engine}): modes and prior come from it.",
        *_absent_structure(vehicle.noise, model),
        *_absent_noise(vehicle.noise, vehicle.map.case == 1 or vehicle.map.prior_modes is not None),
        "Errors of the dynamic pressure: an estimate adds the standard deviation that it is given, or "
        f"{vehicle.noise.dynamic_pressure_percent:g} % (noise.dynamic_pressure_percent).",
        *([] if vehicle.mass is not None else [f"Inertia: {inertia_in_words(vehicle)}."]),
        "Vibration: strain counts as the static response to the current pressure.",
    )


def _absent_structure(noise: Noise, model: str) -> list[str]:
    absent = [
        what for what, entries in OF_STRUCTURE.items() if not any(getattr(noise, entry) > 0.0 for entry in entries)
    ]
    return [f"Errors of the structural model ({model}): {', '.join(absent)}."] if absent else []


def _absent_noise(noise: Noise, truncates: bool) -> list[str]:
    # Temperature may also be given as modes in the nuisance file.
    in_file = {"apparent_strain_um_per_m"} if noise.nuisance_file is not None else set()
    absent = [
        f"{what[0].upper()}{what[1:]}: noise.{entry} is 0."
        for entry, what in OPTIONAL_ERRORS
        if getattr(noise, entry) == 0.0 and entry not in in_file
    ]
    if truncates and not noise.with_truncated_modes:
        absent.append("Truncated pressure modes: the vehicle file leaves them out of the noise.")
    return absent
