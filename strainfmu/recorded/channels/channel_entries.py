"""The file channels.toml: which channel of a recorder is which gauge, and how its values become strain."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import get_args

from strainfmu.cosim.toml_table import TomlTable, read_toml
from strainfmu.estimator.signal_names import ZERO
from strainfmu.interface.parameter_variables import PREFIX
from strainfmu.interface.sensor_variables import PREFIX as SENSOR_PREFIX
from strainfmu.interface.sensor_variables import THRUST
from strainfmu.recorded.channels.bridges import BENDING, BRIDGES, POISSON, WIRES
from strainfmu.recorded.channels.rasters import JOINS, Join
from strainfmu.recorded.columns.column_names import QUANTITIES, DateOrder
from strainfmu.recorded.columns.temperature_columns import is_temperature
from strainfmu.units import RATIO_UNITS, STRAIN_UNITS, TIME_UNITS, VOLTAGE_UNITS

COMPENSATIONS = ("none", "self", "dummy", "bridge")
"""No compensation; gauges made for the material; a second gauge on a piece without load; opposite arms."""

SIGNAL_UNITS = {**STRAIN_UNITS, **RATIO_UNITS, **VOLTAGE_UNITS}

_INHERITED = (
    *("unit", "bridge", "gauge_factor", "recorder_gauge_factor", "poisson_ratio", "excitation_V", "gain"),
    *("scale_um_per_m_per_V", ZERO, "sign", "temperature_compensation", "wires", "lead_resistance_ohm"),
    *("gauge_resistance_ohm", "uniaxial_stress"),
)
"""Entries that ``[defaults]`` may state for all channels."""


@dataclass(frozen=True, kw_only=True)
class ChannelEntry:
    """One channel of strain.

    Attributes
    ----------
    where : of the file, for messages.
    name : in the recording.
    gauge : of the map, or a leg of a rosette.
    unit : of the values, None for the unit of the recording.
    bridge : of :data:`~strainfmu.recorded.channels.bridges.BRIDGES`.
    gauge_factor, recorder_gauge_factor : of the gauge, and the one that the recorder was set to; or None.
    poisson_ratio : nu of the material, for Poisson bridges.
    excitation : [V], of values in volts; with ``gain`` of the amplifier.
    scale : [(m/m)/V], of values in volts; None for by the bridge.
    sign : 1 or -1.
    zero : value without load, in the unit of the values.
    compensation : of temperature, of :data:`COMPENSATIONS`, None if not stated.
    wires, lead_resistance, gauge_resistance : lead wires and the resistance of one, and of a gauge [ohm].
    """

    where: str
    name: str
    gauge: str
    unit: str | None
    bridge: str
    gauge_factor: float | None
    recorder_gauge_factor: float | None
    poisson_ratio: float
    excitation: float | None
    gain: float
    scale: float | None
    sign: float
    zero: float
    compensation: str | None
    wires: int
    lead_resistance: float
    gauge_resistance: float


@dataclass(frozen=True, kw_only=True)
class FlowEntry:
    """One channel of the flow: one of ``QUANTITIES``, ``temperature[k]`` or
    ``parameter.NAME``; its unit."""

    where: str
    name: str
    quantity: str
    unit: str | None


@dataclass(frozen=True, kw_only=True)
class Rosette:
    """Three legs, by the names of their channels, at angles [deg], and the angle of each gauge of the map."""

    where: str
    legs: tuple[str, str, str]
    angles: tuple[float, float, float]
    gauges: dict[str, float]


@dataclass(frozen=True, kw_only=True)
class ChannelMap:
    """All of channels.toml.

    Attributes
    ----------
    time : channel of the time, None for 'time', 't' or the times that a channel has itself.
    time_unit : unit of the time, None for the unit of the recording.
    rate : samples per second of a recording without times [Hz], None if it has them.
    date_order : of day and month in dates of figures, None where it is not stated.
    join : how channels of other rates are brought to one raster.
    raster : channel whose samples are used for the estimates, None for the raster of most gauges.
    """

    path: Path
    time: str | None = None
    time_unit: str | None = None
    rate: float | None = None
    date_order: DateOrder | None = None
    join: Join = field(default_factory=Join)
    raster: str | None = None
    channels: tuple[ChannelEntry, ...] = ()
    rosettes: tuple[Rosette, ...] = ()
    flow: tuple[FlowEntry, ...] = ()


def load_channels(path: Path) -> ChannelMap:
    """Read channels.toml.

    Raises
    ------
    InputError
        The file is missing or no TOML, or an entry is missing, unknown, out of range or against another one.
    """
    root = TomlTable(path, "", dict(read_toml(path)))
    time, join = root.table("time"), root.table("join")
    defaults = root.table("defaults")
    for key in defaults.entries:
        if key not in _INHERITED:
            raise defaults.fault(key, f"unknown entry, expected one of {', '.join(_INHERITED)}")
    items, rosettes = root.tables("channel"), root.tables("rosette")
    if not items:
        raise root.fault("channel", "expected at least one [[channel]]")
    order = _one_of(time, "date_order", get_args(DateOrder), None)
    found = ChannelMap(
        path=path,
        time=time.text("channel", "") if "channel" in time.entries else None,
        time_unit=_one_of(time, "unit", TIME_UNITS, None),
        rate=time.number("rate_hz", None, 1e-6, 1e9) if "rate_hz" in time.entries else None,
        date_order="day" if order == "day" else "month" if order == "month" else None,
        join=Join(
            rule=_one_of(join, "rule", JOINS, "linear") or "linear",
            limit=join.number("limit_s", None, 0.0, 1e9) if "limit_s" in join.entries else None,
        ),
        raster=join.text("raster", "") if "raster" in join.entries else None,
        channels=tuple(_channel(item, defaults) for item in items),
        rosettes=tuple(_rosette(item) for item in rosettes),
        flow=tuple(_flow(item) for item in root.tables("flow")),
    )
    if found.time is not None and found.rate is not None:
        raise time.fault("rate_hz", "expected 'channel' or 'rate_hz', got both")
    for table in (time, join, root):
        table.finish()
    return found


def _one_of(table: TomlTable, key: str, allowed: Collection[str], default: str | None) -> str | None:
    """Take a text that must be one of ``allowed``."""
    if key not in table.entries:
        return default
    value = table.entries.pop(key)
    if value not in [*allowed]:
        raise table.fault(key, f"expected one of {', '.join(allowed)}, got {value!r}")
    return str(value)


def _optional(table: TomlTable, key: str, low: float, high: float) -> float | None:
    return table.number(key, None, low, high) if key in table.entries else None


def _channel(item: TomlTable, defaults: TomlTable) -> ChannelEntry:
    """Read one channel; what it does not state comes from the defaults."""
    stated = set(item.entries)
    item.entries = {**defaults.entries, **item.entries}
    unit = _one_of(item, "unit", SIGNAL_UNITS, None)
    bridge = _one_of(item, "bridge", BRIDGES, "quarter") or "quarter"
    wires = item.whole("wires", WIRES[bridge][-1], 6)
    entry = ChannelEntry(
        where=item.name,
        name=item.text("name"),
        gauge=item.text("gauge"),
        unit=unit,
        bridge=bridge,
        gauge_factor=_optional(item, "gauge_factor", 0.1, 500.0),
        recorder_gauge_factor=_optional(item, "recorder_gauge_factor", 0.1, 500.0),
        poisson_ratio=item.number("poisson_ratio", 0.0 if bridge not in POISSON else None, -1.0, 0.5),
        excitation=_optional(item, "excitation_V", 1e-3, 1e3),
        gain=item.number("gain", 1.0, 1e-6, 1e6),
        scale=_optional(item, "scale_um_per_m_per_V", -1e9, 1e9),
        sign=item.number("sign", 1.0, -1.0, 1.0),
        zero=item.number(ZERO, 0.0, -inf, inf),
        compensation=_one_of(item, "temperature_compensation", COMPENSATIONS, None),
        wires=wires,
        lead_resistance=item.number("lead_resistance_ohm", 0.0, 0.0, 1e4),
        gauge_resistance=item.number("gauge_resistance_ohm", 0.0, 0.0, 1e6),
    )
    is_uniaxial = item.entries.pop("uniaxial_stress", False)
    _check(item, entry, stated=stated, is_uniaxial=is_uniaxial)
    item.finish()
    return entry


def _check(item: TomlTable, entry: ChannelEntry, stated: Collection[str], is_uniaxial: object) -> None:
    """Refuse entries that are against each other."""
    if entry.sign not in (1.0, -1.0):
        raise item.fault("sign", f"expected 1 or -1, got {entry.sign:g}")
    if entry.wires not in WIRES[entry.bridge]:
        allowed = " or ".join(str(n) for n in WIRES[entry.bridge])
        raise item.fault("wires", f"expected {allowed} with bridge '{entry.bridge}', got {entry.wires}")
    if entry.lead_resistance > 0.0 and entry.gauge_resistance == 0.0:
        raise item.fault("gauge_resistance_ohm", "entry is missing, lead_resistance_ohm needs it")
    if not isinstance(is_uniaxial, bool):
        raise item.fault("uniaxial_stress", f"expected true or false, got {is_uniaxial!r}")
    if entry.bridge in POISSON and entry.bridge not in BENDING and not is_uniaxial:
        raise item.fault(
            "bridge",
            f"'{entry.bridge}' adds the strain across: expected uniaxial_stress = true where that is -nu times "
            "the strain along, or a channel for each direction",
        )
    if entry.compensation == "bridge" and entry.bridge == "quarter":
        raise item.fault("temperature_compensation", "'bridge': expected a half or full bridge, got 'quarter'")
    if entry.unit in STRAIN_UNITS:
        if "gauge_factor" in stated and entry.recorder_gauge_factor is None:
            raise item.fault("recorder_gauge_factor", f"entry is missing, gauge_factor with {entry.unit} needs it")
        for key in ("excitation_V", "scale_um_per_m_per_V"):
            if key in stated:
                raise item.fault(key, f"expected none with unit {entry.unit}")


def _rosette(item: TomlTable) -> Rosette:
    """Read a rosette."""
    legs = item.entries.pop("legs", None)
    angles = item.entries.pop("angles_deg", None)
    gauges = item.table("gauges_deg")
    if not isinstance(legs, list) or len(set(map(str, legs))) != 3 or not all(isinstance(n, str) for n in legs):
        raise item.fault("legs", f"expected three names of legs, got {legs!r}")
    is_number = isinstance(angles, list) and all(type(one) in (int, float) for one in angles)
    if not is_number or len({one % 180.0 for one in angles}) != 3 or len(angles) != 3:
        raise item.fault("angles_deg", f"expected three angles that differ modulo 180, got {angles!r}")
    held = {gauge: gauges.number(gauge, None, -360.0, 360.0) for gauge in [*gauges.entries]}
    if not held:
        raise item.fault("gauges_deg", "expected at least one gauge of the map and its angle")
    item.finish()
    return Rosette(
        where=item.name,
        legs=(legs[0], legs[1], legs[2]),
        angles=(float(angles[0]), float(angles[1]), float(angles[2])),
        gauges=held,
    )


def _quantity(item: TomlTable) -> str:
    stated = item.entries.get("quantity")
    if isinstance(stated, str) and (
        is_temperature(stated) or stated.startswith((PREFIX, SENSOR_PREFIX)) or stated == THRUST
    ):
        return str(item.entries.pop("quantity"))
    return _one_of(item, "quantity", QUANTITIES, None) or ""


def _flow(item: TomlTable) -> FlowEntry:
    """Read a channel of the flow."""
    entry = FlowEntry(
        where=item.name,
        name=item.text("name"),
        quantity=_quantity(item),
        unit=item.text("unit") if "unit" in item.entries else None,
    )
    if not entry.quantity:
        raise item.fault("quantity", "entry is missing")
    item.finish()
    return entry
