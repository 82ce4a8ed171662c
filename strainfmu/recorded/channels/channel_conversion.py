"""The strain that a recorder's channel means: unit, bridge, gauge factor, leads, sign and zero; rosettes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.recorded.channels.bridges import bridge_strain, lead_factor
from strainfmu.recorded.channels.channel_entries import SIGNAL_UNITS, ChannelEntry, Rosette
from strainfmu.units import RATIO_UNITS, STRAIN_UNITS, VOLTAGE_UNITS


def unit_of_channel(path: Path, entry: ChannelEntry, recorded: str | None) -> str:
    """Return the unit of a channel's values: the stated one, else the recording's.

    Raises
    ------
    InputError
        Neither is there, or the recording's is unknown.
    """
    if entry.unit is not None:
        return entry.unit
    if recorded in SIGNAL_UNITS:
        return str(recorded)
    found = f"the recording says '{recorded}'" if recorded else "the recording states none"
    raise InputError(
        f"{path}: {entry.where}.unit: entry is missing for channel '{entry.name}', {found}; "
        f"expected one of {', '.join(SIGNAL_UNITS)}"
    )


def differs(unit: str, recorded: str | None) -> bool:
    """Return whether the recording states another known unit than the one that is used."""
    if recorded not in SIGNAL_UNITS:
        return False
    same_kind = any(unit in units and recorded in units for units in (STRAIN_UNITS, RATIO_UNITS, VOLTAGE_UNITS))
    return not same_kind or SIGNAL_UNITS[unit] != SIGNAL_UNITS[str(recorded)]


def channel_strain(path: Path, entry: ChannelEntry, values: FloatArray, unit: str) -> FloatArray:
    """Return (n,) strain [m/m] of the values (n,) of a channel in ``unit``.

    Raises
    ------
    InputError
        An entry is missing that the unit needs; ``path`` is the file of the entries.
    """
    change = (values - entry.zero) * SIGNAL_UNITS[unit]
    if unit in STRAIN_UNITS:
        strain = change * _gauge_factor_ratio(path, entry)
    elif unit in VOLTAGE_UNITS and entry.scale is not None:
        if entry.lead_resistance:
            raise _missing(path, entry, "lead_resistance_ohm", "expected none with scale_um_per_m_per_V")
        return entry.sign * 1e-6 * entry.scale * change
    else:
        if entry.gauge_factor is None:
            raise _missing(path, entry, "gauge_factor", f"entry is missing, unit {unit} needs it")
        ratio = change
        if unit in VOLTAGE_UNITS:
            if entry.excitation is None:
                text = f"entry is missing, unit {unit} needs it or scale_um_per_m_per_V"
                raise _missing(path, entry, "excitation_V", text)
            ratio = change / (entry.gain * entry.excitation)
        strain = bridge_strain(ratio, entry.bridge, entry.gauge_factor, entry.poisson_ratio)
    if entry.lead_resistance:
        strain = strain * lead_factor(entry.wires, entry.lead_resistance, entry.gauge_resistance)
    return np.asarray(entry.sign * strain)


def _gauge_factor_ratio(path: Path, entry: ChannelEntry) -> float:
    """Return what makes up for a recorder that was set to another gauge factor than the gauge's."""
    if entry.recorder_gauge_factor is None:
        return 1.0
    if entry.gauge_factor is None:
        raise _missing(path, entry, "gauge_factor", "entry is missing, recorder_gauge_factor needs it")
    return entry.recorder_gauge_factor / entry.gauge_factor


def _missing(path: Path, entry: ChannelEntry, key: str, text: str) -> InputError:
    return InputError(f"{path}: {entry.where}.{key}: {text}, channel '{entry.name}'")


def rosette_weights(rosette: Rosette) -> dict[str, FloatArray]:
    """Return (3,) weights of the legs' strains for each gauge of a rosette.

    Plane strain: e(t) = (e_x + e_y)/2 + (e_x - e_y)/2 cos 2t + g_xy/2 sin 2t. A gauge at
    a leg's angle is that leg.
    """
    legs = _plane(np.radians(rosette.angles))
    angles = np.radians(list(rosette.gauges.values()))
    weights = np.linalg.solve(legs.T, _plane(angles).T).T
    weights[np.abs(weights) < 1e-12] = 0.0
    return dict(zip(rosette.gauges, weights, strict=True))


def _plane(angle: FloatArray) -> FloatArray:
    """Return (n, 3) rows 1, cos 2t, sin 2t at angles (n,) [rad]."""
    return np.column_stack([np.ones(len(angle)), np.cos(2.0 * angle), np.sin(2.0 * angle)])
