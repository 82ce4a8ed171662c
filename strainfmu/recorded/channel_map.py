"""The file channels.toml: which channel of a recorder is which gauge, and how its values become strain.

Strain from the output of a Wheatstone bridge: arms of resistance R, gauges of gauge factor k, output V over
excitation V_ex, r = (V - V_0)/V_ex, positive in tension. The change x = dR/R of an active arm follows from the
divider rule, strain = x/k. With r of the other sign these are the formulas of National Instruments, NI-DAQmx,
"Strain Gage Configurations".

    quarter       r = x/(4 + 2 x)                      x = 4 r/(1 - 2 r)
    half-poisson  r = x (1 + nu)/(4 + 2 x (1 - nu))    x = 4 r/((1 + nu) - 2 r (1 - nu))
    full-poisson  r = x (1 + nu)/(2 + x (1 - nu))      x = 2 r/((1 + nu) - r (1 - nu))
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import NamedTuple, get_args

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.cosim.toml_table import TomlTable, read_table
from strainfmu.errors import InputError
from strainfmu.estimator.signal_names import ZERO
from strainfmu.interface.parameter_variables import PREFIX
from strainfmu.interface.sensor_variables import PREFIX as SENSOR_PREFIX
from strainfmu.interface.sensor_variables import THRUST
from strainfmu.recorded.names import QUANTITIES, is_temperature, plain_name, time_unit
from strainfmu.text_cells import DateOrder
from strainfmu.units import RATIO_UNITS, STRAIN_UNITS, TIME_UNITS, VOLTAGE_UNITS

_CHANGE: dict[str, Callable[[FloatArray, float], FloatArray]] = {
    "quarter": lambda r, nu: 4.0 * r / (1.0 - 2.0 * r),
    "half-poisson": lambda r, nu: 4.0 * r / ((1.0 + nu) - 2.0 * r * (1.0 - nu)),
    "full-poisson": lambda r, nu: 2.0 * r / ((1.0 + nu) - r * (1.0 - nu)),
}

_BENDING = ("half-bending", "full-bending", "full-bending-poisson")
"""Bridges whose output is half the difference of the strains at two positions, and so is no gauge of a map."""

_POISSON = ("half-poisson", "full-poisson")
"""Bridges that take the strain across for -nu times that along: true under uniaxial stress alone."""

_WIRES = {"quarter": (2, 3), "half-poisson": (3,), "full-poisson": (4, 6)}
"""Numbers of lead wires that a bridge may have."""

_LEADS = {2: 2.0, 3: 1.0, 4: 2.0, 6: 0.0}
"""Lead resistances in series with an arm, or with the whole bridge, of the resistance of a gauge each."""

COMPENSATIONS = ("none", "self", "dummy", "bridge")
"""No compensation; gauges made for the material; a second gauge on a piece without load; opposite arms."""

SIGNAL_UNITS = {**STRAIN_UNITS, **RATIO_UNITS, **VOLTAGE_UNITS}

JOINS = {"linear": "interpolated", "hold": "held", "nearest": "taken from the nearest sample"}
"""Rules by which a channel of another raster gets its values, and the word for each."""

_NUMBERS: dict[str, tuple[float | None, float, float]] = {
    "gauge_factor": (None, 0.1, 500.0),
    "recorder_gauge_factor": (None, 0.1, 500.0),  # that the recorder was set to
    "poisson_ratio": (0.0, -1.0, 0.5),
    "excitation_V": (None, 1e-3, 1e3),
    "gain": (1.0, 1e-6, 1e6),
    "scale_um_per_m_per_V": (None, -1e9, 1e9),  # instead of the bridge
    "sign": (1.0, -1.0, 1.0),
    ZERO: (0.0, -inf, inf),  # value without load, in the unit of the values
    "lead_resistance_ohm": (0.0, 0.0, 1e4),
    "gauge_resistance_ohm": (0.0, 0.0, 1e6),
}
"""Numbers of a channel: the default, None for no value, the smallest and the largest value."""

_INHERITED = ("unit", "bridge", "wires", "temperature_compensation", "uniaxial_stress", *_NUMBERS)
"""Entries that ``[defaults]`` may state for all channels."""


class Join(NamedTuple):
    """A rule of JOINS, and its limit [s].

    The limit applies to the gap between two samples ("linear"), to the time since the last sample ("hold"), or to
    the time to the sample before or behind ("nearest"); None for a number of periods of the channel.
    """

    rule: str = "linear"
    limit: float | None = None


@dataclass(frozen=True, kw_only=True)
class Channel:
    """A channel of strain, or of the flow.

    Attributes
    ----------
    where : its entry in the file, for messages.
    name : in the recording.
    quantity : gauge of the map or leg of a rosette; one of ``QUANTITIES``, ``temperature[k]``, ``sensor.NAME``,
        ``thrust`` or ``parameter.NAME``.
    unit : of the values, None for the unit of the recording.
    bridge : of strain, see above; ``wires`` is the number of its lead wires.
    compensation : of temperature, of :data:`COMPENSATIONS`, None if not stated.
    numbers : of ``_NUMBERS``, by the names in the file, as far as there are.
    """

    where: str
    name: str
    quantity: str
    unit: str | None
    bridge: str = "quarter"
    wires: int = 0
    compensation: str | None = None
    numbers: Mapping[str, float] = field(default_factory=dict)


class Rosette(NamedTuple):
    """Three legs by plain names, and their weights (3,) in the strain of each gauge of the map."""

    where: str
    legs: tuple[str, ...]
    weights: dict[str, FloatArray]


@dataclass(frozen=True, kw_only=True)
class ChannelMap:
    """All of channels.toml.

    Attributes
    ----------
    time : channel of the time, None for a time by its name or the times that a channel has itself.
    time_unit : unit of the time, None for the unit of the recording.
    rate : samples per second of a recording without times [Hz], None if it has them.
    date_order : of day and month in dates of figures, None where it is not stated.
    join : how channels of other rates are brought to one raster.
    raster : channel whose samples are used for the estimates, None for the raster of most gauges.
    strain, flow : channels.
    """

    path: Path
    time: str | None
    time_unit: str | None
    rate: float | None
    date_order: DateOrder | None
    join: Join
    raster: str | None
    strain: tuple[Channel, ...]
    rosettes: tuple[Rosette, ...]
    flow: tuple[Channel, ...]


def load_channels(path: Path) -> ChannelMap:
    """Read channels.toml.

    Raises
    ------
    InputError
        The file is missing or no TOML, or an entry is missing, unknown, out of range or against another one.
    """
    root = read_table(path)
    time, join, defaults = root.table("time"), root.table("join"), root.table("defaults")
    for key in defaults.entries:
        if key not in _INHERITED:
            raise defaults.fault(key, f"unknown entry, expected one of {', '.join(_INHERITED)}")
    items, rosettes = root.tables("channel"), root.tables("rosette")
    if not items:
        raise root.fault("channel", "expected at least one [[channel]]")
    order, unit = _option(time, "date_order", get_args(DateOrder)), time.entries.pop("unit", None)
    if unit is not None and (not isinstance(unit, str) or time_unit(unit) is None):
        raise time.fault("unit", f"expected one of {', '.join(TIME_UNITS)}, got {unit!r}")
    channel_map = ChannelMap(
        path=path,
        time=time.text("channel", "") if "channel" in time.entries else None,
        time_unit=unit,
        rate=_optional(time, "rate_hz", 1e-6, 1e9),
        date_order="day" if order == "day" else "month" if order == "month" else None,
        join=Join(_option(join, "rule", JOINS) or "linear", _optional(join, "limit_s", 0.0, 1e9)),
        raster=join.text("raster", "") if "raster" in join.entries else None,
        strain=tuple(_channel(item, defaults) for item in items),
        rosettes=tuple(_rosette(item) for item in rosettes),
        flow=tuple(_flow(item) for item in root.tables("flow")),
    )
    if channel_map.time is not None and channel_map.rate is not None:
        raise time.fault("rate_hz", "expected 'channel' or 'rate_hz', got both")
    for table in (time, join, root):
        table.finish()
    return channel_map


def _option(table: TomlTable, key: str, allowed: Collection[str]) -> str | None:
    """Take a text that must be one of ``allowed``; None where it is not stated."""
    value = table.entries.pop(key, None)
    if value is not None and value not in [*allowed]:
        raise table.fault(key, f"expected one of {', '.join(allowed)}, got {value!r}")
    return None if value is None else str(value)


def _optional(table: TomlTable, key: str, low: float, high: float) -> float | None:
    return table.number(key, None, low, high) if key in table.entries else None


def _channel(item: TomlTable, defaults: TomlTable) -> Channel:
    """Read one channel of strain; what it does not state comes from the defaults."""
    stated = set(item.entries)
    item.entries = {**defaults.entries, **item.entries}
    unit, bridge = _option(item, "unit", SIGNAL_UNITS), _option(item, "bridge", (*_CHANGE, *_BENDING)) or "quarter"
    if bridge in _BENDING:
        raise item.fault(
            "bridge",
            f"'{bridge}' gives half the difference of the strains at two positions, and gauge "
            f"'{item.text('gauge')}' of the map is at one: expected a channel for each",
        )
    numbers = {
        key: item.number(key, None if key == "poisson_ratio" and bridge in _POISSON else default, low, high)
        for key, (default, low, high) in _NUMBERS.items()
        if default is not None or key in item.entries
    }
    channel = Channel(
        where=item.name,
        name=item.text("name"),
        quantity=item.text("gauge"),
        unit=unit,
        bridge=bridge,
        wires=item.integer("wires", _WIRES[bridge][-1], 6),
        compensation=_option(item, "temperature_compensation", COMPENSATIONS),
        numbers=numbers,
    )
    is_uniaxial = item.entries.pop("uniaxial_stress", False)
    if numbers["sign"] not in (1.0, -1.0):
        raise item.fault("sign", f"expected 1 or -1, got {numbers['sign']:g}")
    if channel.wires not in _WIRES[bridge]:
        allowed = " or ".join(str(n) for n in _WIRES[bridge])
        raise item.fault("wires", f"expected {allowed} with bridge '{bridge}', got {channel.wires}")
    if numbers["lead_resistance_ohm"] and not numbers["gauge_resistance_ohm"]:
        raise item.fault("gauge_resistance_ohm", "entry is missing, lead_resistance_ohm needs it")
    if not isinstance(is_uniaxial, bool):
        raise item.fault("uniaxial_stress", f"expected true or false, got {is_uniaxial!r}")
    if bridge in _POISSON and not is_uniaxial:
        raise item.fault(
            "bridge",
            f"'{bridge}' adds the strain across: expected uniaxial_stress = true where that is -nu times the "
            "strain along, or a channel for each direction",
        )
    if channel.compensation == "bridge" and bridge == "quarter":
        raise item.fault("temperature_compensation", "'bridge': expected a half or full bridge, got 'quarter'")
    if unit in STRAIN_UNITS:
        if "gauge_factor" in stated and "recorder_gauge_factor" not in numbers:
            raise item.fault("recorder_gauge_factor", f"entry is missing, gauge_factor with {unit} needs it")
        for key in ("excitation_V", "scale_um_per_m_per_V"):
            if key in stated:
                raise item.fault(key, f"expected none with unit {unit}")
    item.finish()
    return channel


def _rosette(item: TomlTable) -> Rosette:
    """Read a rosette.

    Plane strain: e(t) = (e_x + e_y)/2 + (e_x - e_y)/2 cos 2t + g_xy/2 sin 2t. A gauge at
    a leg's angle is that leg.
    """
    legs = item.entries.pop("legs", None)
    angles = item.entries.pop("angles_deg", None)
    gauges = item.table("gauges_deg")
    if not isinstance(legs, list) or len(set(map(str, legs))) != 3 or not all(isinstance(n, str) for n in legs):
        raise item.fault("legs", f"expected three names of legs, got {legs!r}")
    is_number = isinstance(angles, list) and all(type(angle) in (int, float) for angle in angles)
    if not is_number or len({angle % 180.0 for angle in angles}) != 3 or len(angles) != 3:
        raise item.fault("angles_deg", f"expected three angles that differ modulo 180, got {angles!r}")
    stated = {gauge: gauges.number(gauge, None, -360.0, 360.0) for gauge in [*gauges.entries]}
    if not stated:
        raise item.fault("gauges_deg", "expected at least one gauge of the map and its angle")
    item.finish()
    weights = np.linalg.solve(_plane(angles).T, _plane([*stated.values()]).T).T
    weights[np.abs(weights) < 1e-12] = 0.0
    return Rosette(item.name, tuple(map(plain_name, legs)), dict(zip(stated, weights, strict=True)))


def _plane(degrees: Sequence[float]) -> FloatArray:
    """Return (n, 3) rows 1, cos 2t, sin 2t at n angles [deg]."""
    angle = np.radians(np.array(degrees, dtype=float))
    return np.column_stack([np.ones(len(angle)), np.cos(2.0 * angle), np.sin(2.0 * angle)])


def _flow(item: TomlTable) -> Channel:
    """Read a channel of the flow."""
    stated = item.entries.get("quantity")
    is_free = isinstance(stated, str) and (
        is_temperature(stated) or stated.startswith((PREFIX, SENSOR_PREFIX)) or stated == THRUST
    )
    channel = Channel(
        where=item.name,
        name=item.text("name"),
        quantity=item.text("quantity") if is_free else _option(item, "quantity", QUANTITIES) or "",
        unit=item.text("unit") if "unit" in item.entries else None,
    )
    if not channel.quantity:
        raise item.fault("quantity", "entry is missing")
    item.finish()
    return channel


def unit_of_channel(path: Path, channel: Channel, recorded: str | None) -> str:
    """Return the unit of a channel's values: the stated one, else the recording's.

    Raises
    ------
    InputError
        Neither is there, or the recording's is unknown.
    """
    unit = next((unit for unit in (recorded, (recorded or "").casefold()) if unit in SIGNAL_UNITS), None)
    if channel.unit is None and unit is None:
        says = f"the recording says '{recorded}'" if recorded else "the recording states none"
        raise InputError(
            f"{path}: {channel.where}.unit: entry is missing for channel '{channel.name}', {says}; "
            f"expected one of {', '.join(SIGNAL_UNITS)}"
        )
    return channel.unit or str(unit)


def differs(unit: str, recorded: str | None) -> bool:
    """Return whether the recording states another known unit than the one that is used."""
    if recorded not in SIGNAL_UNITS:
        return False
    same_kind = any(unit in units and recorded in units for units in (STRAIN_UNITS, RATIO_UNITS, VOLTAGE_UNITS))
    return not same_kind or SIGNAL_UNITS[unit] != SIGNAL_UNITS[str(recorded)]


def strain_conversion(path: Path, channel: Channel, unit: str) -> Callable[[FloatArray], FloatArray]:
    """Return what makes strain (n,) [m/m] of the values (n,) of a channel in ``unit``.

    Raises
    ------
    InputError
        An entry is missing that the unit needs; ``path`` is the file of the entries.
    """
    where, numbers = f"{path}: {channel.where}", channel.numbers

    def needed(key: str, by: str) -> float:
        if key not in numbers:
            raise InputError(f"{where}.{key}: entry is missing, {by}, channel '{channel.name}'")
        return numbers[key]

    factor, sign, zero = SIGNAL_UNITS[unit], numbers["sign"], numbers[ZERO]
    lead, nu = numbers["lead_resistance_ohm"], numbers["poisson_ratio"]
    leads = lead_factor(channel.wires, lead, numbers["gauge_resistance_ohm"]) if lead else 1.0
    if unit in VOLTAGE_UNITS and (scale := numbers.get("scale_um_per_m_per_V")) is not None:
        if lead:
            text = "lead_resistance_ohm: expected none with scale_um_per_m_per_V"
            raise InputError(f"{where}.{text}, channel '{channel.name}'")
        scale *= sign * 1e-6
        return lambda values: scale * ((values - zero) * factor)
    if unit in STRAIN_UNITS:
        recorder = numbers.get("recorder_gauge_factor")
        ratio = 1.0 if recorder is None else recorder / needed("gauge_factor", "recorder_gauge_factor needs it")
        return lambda values: sign * ((values - zero) * factor * ratio * leads)
    gauge_factor, excitation = needed("gauge_factor", f"unit {unit} needs it"), 1.0
    if unit in VOLTAGE_UNITS:
        excitation = needed("excitation_V", f"unit {unit} needs it or scale_um_per_m_per_V") * numbers["gain"]
    return lambda values: (
        sign * leads * bridge_strain((values - zero) * factor / excitation, channel.bridge, gauge_factor, nu)
    )


def bridge_strain(ratio: FloatArray, bridge: str, gauge_factor: float, poisson_ratio: float) -> FloatArray:
    """Return (n,) strain [m/m] of output over excitation (n,) [V/V], positive in tension."""
    return _CHANGE[bridge](ratio, poisson_ratio) / gauge_factor


def lead_factor(wires: int, lead_resistance: float, gauge_resistance: float) -> float:
    """Return the factor that makes up for the resistance of the leads [1].

    Two wires: both leads stand in the arm of the gauge, 1 + 2 R_L/R_G. Three: one does, 1 + R_L/R_G. Four of a
    full bridge: both leads of the excitation lower its voltage, 1 + 2 R_L/R_G. Six, with sense wires: 1.

    Parameters
    ----------
    lead_resistance : R_L of one lead [ohm].
    gauge_resistance : R_G [ohm].
    """
    return 1.0 + _LEADS[wires] * lead_resistance / gauge_resistance
