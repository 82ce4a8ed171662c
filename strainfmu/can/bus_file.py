"""A bus described in one file, bus.toml: interface, frames, clock, trust, zero offsets, tare, recording and page.

:data:`TABLES` declares every entry once: its unit, its range and the option that it sets. The reader, the
template and ``--set`` iterate over it. Entries that are not stated keep the defaults of
:class:`~strainfmu.can.options.BridgeOptions`. Paths are relative to the folder of the file.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf, isfinite
from pathlib import Path
from typing import Any

from strainfmu.can.dbc_files import MAPPING_TABLE
from strainfmu.can.options import PUBLISH_RATE, RESTARTS, RESULT_FORMS, BridgeOptions
from strainfmu.can.profiles import PROFILES, Identifiers
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.signal_names import STRAIN, TARE
from strainfmu.recorded.names import suggestion
from strainfmu.text_files import read_toml

LARGEST_STANDARD, LARGEST_EXTENDED = 0x7FF, 0x1FFF_FFFF
"""Largest identifiers of 11 and 29 bits."""


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One entry of the file.

    Attributes
    ----------
    sets : the field that it sets: of BridgeOptions, of its ``identifiers.``, or of :class:`BusDescription`.
    text : what it states, for the template.
    kind : text, label (a text or a whole number), file, number, whole, flag, or values (a table of them).
    unit : of the entry.
    scale : factor from the entry to the field's unit.
    low, high : range of numbers, in the entry's unit.
    choices : allowed texts; none: any.
    example : value in the template, as TOML.
    """

    sets: str
    text: str
    kind: str = "number"
    unit: str = ""
    scale: float = 1.0
    low: float = -inf
    high: float = inf
    choices: tuple[str, ...] = ()
    example: str = ""


TABLES: Mapping[str, Mapping[str, Entry]] = {
    "bus": {
        "interface": Entry(sets="interface", kind="text", text="python-can interface", example='"socketcan"'),
        "channel": Entry(sets="channel", kind="text", text="its channel", example='"can0"'),
        "options": Entry(
            sets="bus_options", kind="values", text="options of the interface", example="{ bitrate = 500000 }"
        ),
        "log_channel": Entry(
            sets="log_channel",
            kind="label",
            text="channel of a log that is read, as the file names it",
            example="1",
        ),
    },
    "input": {
        "profile": Entry(
            sets="profile", kind="text", choices=PROFILES, text="frames that need no DBC file", example='"fd64"'
        ),
        "dbc": Entry(
            sets="dbc", kind="file", text="DBC file of the frames, instead of a profile", example='"rack.dbc"'
        ),
        "mapping": Entry(
            sets="mapping",
            kind="file",
            text="file that maps its signals, instead of the tables [input.strain] .. below",
            example='"rack.toml"',
        ),
        "cycle_time_ms": Entry(
            sets="cycle_time",
            unit="ms",
            scale=1e-3,
            low=0.1,
            high=10_000.0,
            text="period of the strain frames",
            example="10.0",
        ),
        "id_base": Entry(
            sets="identifiers.base",
            kind="whole",
            low=0,
            high=LARGEST_EXTENDED,
            text="identifier of the first input frame of a profile",
            example="0x300",
        ),
        "extended": Entry(
            sets="identifiers.is_extended", kind="flag", text="identifiers of 29 bits", example="false"
        ),
        "key": Entry(
            sets="key_file",
            kind="file",
            text="key of profile fd64-sec: 32 hexadecimal digits (AES-128)",
            example='"bus.key"',
        ),
        "freshness": Entry(
            sets="freshness_file",
            kind="file",
            text="freshness value between runs; default: next to the key",
            example='"bus.key.bridge.json"',
        ),
        "dynamic_pressure_pa": Entry(
            sets=DYNAMIC_PRESSURE,
            unit="Pa",
            low=1.0,
            high=1e8,
            text="fixed dynamic pressure, instead of its frame",
            example="95800.0",
        ),
        "gauges": Entry(
            sets="gauges",
            kind="file",
            text="map or FMU whose gauges the frames hold, for 'strainfmu send'",
            example='"map.h5"',
        ),
    },
    "results": {
        "form": Entry(
            sets="result_form",
            kind="text",
            choices=RESULT_FORMS,
            text="form of the result frames; default: as the input",
            example='"fd"',
        ),
        "id_base": Entry(
            sets="identifiers.result_base",
            kind="whole",
            low=0,
            high=LARGEST_EXTENDED,
            text="identifier of the first result frame",
            example="0x380",
        ),
    },
    "clock": {
        "tolerance_ppm": Entry(
            sets="clock_tolerance",
            unit="ppm",
            scale=1e-6,
            low=0.0,
            high=10_000.0,
            text="largest difference of the sender's clock rate from the bridge's",
            example="100.0",
        ),
        "synchronised_ms": Entry(
            sets="synchronised",
            unit="ms",
            scale=1e-3,
            low=0.0,
            high=1e6,
            text="accuracy to which the sender's clock agrees with the system time (PTP, NTP)",
            example="1.0",
        ),
    },
    "trust": {
        "max_age_cycles": Entry(
            sets="max_age",
            unit="cycles",
            low=0.01,
            high=1e6,
            text="largest age of strains that are used",
            example="5.0",
        ),
        "restart": Entry(
            sets="restart",
            kind="text",
            choices=RESTARTS,
            text="a restarted sender needs a proof (confirm) or none (accept: a recording passes for it)",
            example='"confirm"',
        ),
        "stuck_cycles": Entry(
            sets="stuck_cycles",
            kind="whole",
            unit="cycles",
            low=0,
            high=1_000_000,
            text="equal values in a row after which a gauge is left out, 0 never; default: as its noise allows",
            example="20",
        ),
    },
    "zeros": {
        "file": Entry(
            sets="zeros",
            kind="file",
            text="zero offsets of the gauges, of 'strainfmu tare'; subtracted",
            example='"zeros.toml"',
        ),
    },
    TARE: {
        "map": Entry(
            sets=TARE,
            kind="file",
            text="map of the same gauges; a tare is taken when the sender asks for it",
            example='"map.h5"',
        ),
        "cycles": Entry(
            sets="tare_cycles",
            kind="whole",
            unit="cycles",
            low=64,
            high=100_000,
            text="number of cycles of a tare",
            example="500",
        ),
        "known": Entry(
            sets="tare_known",
            kind="file",
            text="strain of own weight and air, of 'strainfmu tare --known-output'",
            example='"known.toml"',
        ),
        "output": Entry(sets="tare_output", kind="file", text="zero offsets to write", example='"zeros.toml"'),
        "at_s": Entry(
            sets="tare_at", unit="s", low=0.0, high=1e6, text="when 'strainfmu send' asks for it", example="5.0"
        ),
    },
    "record": {
        "file": Entry(
            sets="record", kind="file", text="recording of the bus: .blf, .asc or .log", example='"run.blf"'
        ),
    },
    "page": {
        "publish": Entry(
            sets="publish",
            kind="text",
            text="address to which results go as UDP-JSON, for 'strainfmu monitor'",
            example='"127.0.0.1:9870"',
        ),
        "rate_hz": Entry(
            sets="publish_rate",
            unit="Hz",
            low=0.001,
            high=10_000.0,
            text="largest number of results sent a second",
            example="20.0",
        ),
        "token": Entry(
            sets="publish_token",
            kind="text",
            text="'strainfmu monitor --bus' refuses results without it: others on this host publish none",
            example='"a long random text"',
        ),
        "field": Entry(
            sets="publish_field",
            kind="file",
            text="map with the pressure on the surface, sent too",
            example='"map.h5"',
        ),
        "http": Entry(sets="http", kind="text", text="address of the page", example='"127.0.0.1:8780"'),
    },
}
"""All entries by table and name."""

REMOVED = {
    "faults": "expected no such table: faults are injected by the project's own tests",
    "bus.context": "expected options of the interface as bus.options; python-can reads its own files",
    "clock.rate_ppm": "expected clock.tolerance_ppm, the largest rate error; no rate is stated",
    "clock.hidden_ms": "expected trust.max_age_cycles, against which age and uncertainty count together",
    "clock.learn_s": "expected no such entry: the rate of the sender's clock is not measured",
    "trust.max_uncertainty_ms": "expected trust.max_age_cycles, against which age and uncertainty count together",
    "trust.period_tolerance_percent": "expected no such entry: a period that differs by 20 % is UNCONFIRMED",
    "trust.zero_cycles": "expected no such entry: how often gauges repeat their readings is measured",
    "trust.gauge_noise_um_per_m": "expected no such entry: how often gauges repeat their readings is measured",
    "input.slow_strains": "expected no such entry: slower frames of strains are held",
    "input.profile=classic-be": "expected fd64, classic-le or fd64-sec; state its frames as input.dbc",
    "input.profile=float2": "expected fd64, classic-le or fd64-sec; state its frames as input.dbc",
    "results.form=classic-be": "expected fd or classic-le",
}
"""Tables, entries and values of earlier versions, and what a user is to know of each."""

NEEDS = {
    "input.mapping": "input.dbc",
    "tare.cycles": "tare.map",
    "tare.known": "tare.map",
    "tare.output": "tare.map",
    "page.rate_hz": "page.publish",
    "page.field": "page.publish",
}
"""Entries that are refused without another one."""


@dataclass(frozen=True, kw_only=True)
class BusDescription:
    """What a bus file and the command line state of a bus.

    Attributes
    ----------
    stated : fields of BridgeOptions that are stated, SI; ``identifiers`` holds the fields of Identifiers.
    gauges : map or FMU whose gauges the frames hold.
    tare_at : when a sender asks for a tare [s]; None: never.
    record : recording of the bus.
    publish, http : addresses of the datagrams and of the page.
    publish_rate : largest number of results sent a second [Hz].
    publish_token : what the datagrams state, and the page requires.
    publish_field : map with the pressure field.
    """

    stated: Mapping[str, Any] = field(default_factory=dict)
    gauges: Path | None = None
    tare_at: float | None = None
    record: Path | None = None
    publish: str | None = None
    publish_rate: float = PUBLISH_RATE
    publish_token: str | None = None
    publish_field: Path | None = None
    http: str | None = None

    def options(self, before: BridgeOptions | None = None) -> BridgeOptions:
        """Return the options of a bridge: those stated, and others of ``before`` or the defaults.

        Raises
        ------
        InputError
            Interface or channel is not stated.
        """
        stated = dict(self.stated)
        for name in ("interface", "channel"):
            if before is None and name not in stated:
                raise InputError(f"bus.{name}: expected in the bus file, or by --{name}, got none")
        identifiers = replace(
            Identifiers() if before is None else before.identifiers, **stated.pop("identifiers", {})
        )
        if before is None:
            return BridgeOptions(identifiers=identifiers, **stated)
        return replace(before, identifiers=identifiers, **stated)


def read_bus(
    path: Path | None, settings: Sequence[str] = (), given: Mapping[str, Any] | None = None
) -> BusDescription:
    """Return the bus that a file, ``--set`` and other options of the command line describe, the last one first.

    Parameters
    ----------
    path : the file, None for none.
    settings : texts of ``--set``, "table.entry=value" with a value of TOML, or a text without quotes.
    given : values of other options by "table.entry", None where they were not given.

    Raises
    ------
    InputError
        The file is missing or no TOML, an entry is unknown or not within its range, or entries exclude each other.
    """
    checked: dict[str, Any] = {}
    maps_signals = False
    if path is not None:
        content = read_toml(path)
        maps_signals = STRAIN in content.get("input", {})
        for name, value in _entries(content, str(path), has_mapping=True):
            checked[name] = _checked(name, value, f"{path}: {name}", path.parent)
    for text in settings:
        name, value = _setting(text)
        checked[name] = _checked(name, value, f"--set {name}", Path())
    for name, value in (given or {}).items():
        if value is not None:
            checked[name] = value
    where = "--set" if path is None else str(path)
    _check_together(checked, where, maps_signals)
    if maps_signals and "mapping" not in checked:
        checked["input.mapping"] = path
    return _description(checked)


def _entries(content: Mapping[str, Any], where: str, has_mapping: bool) -> Iterator[tuple[str, Any]]:
    """Yield "table.entry" and value of a file's entries but for those that map signals; refuse unknown ones."""
    for table, entries in content.items():
        _refuse_removed(table, where)
        if table not in TABLES:
            raise InputError(f"{where}: {table}: unknown table, {suggestion(table, list(TABLES))}")
        if not isinstance(entries, dict):
            raise InputError(f"{where}: {table}: expected a table, got {str(entries)[:40]!r}")
        for entry, value in entries.items():
            _refuse_removed(f"{table}.{entry}", where)
            if entry in TABLES[table]:
                yield f"{table}.{entry}", value
            elif table != MAPPING_TABLE or not has_mapping or "dbc" not in entries:
                raise InputError(
                    f"{where}: {table}.{entry}: unknown entry, {suggestion(entry, list(TABLES[table]))}"
                )


def _refuse_removed(name: str, where: str) -> None:
    """Refuse a table, an entry or a value of an earlier version, with what takes its place."""
    if name in REMOVED:
        raise InputError(f"{where}: {name}: {REMOVED[name]}")


def _setting(text: str) -> tuple[str, Any]:
    """Return name and value of "table.entry=value"."""
    name, equals, value = (part.strip() for part in text.partition("="))
    table, _, entry = name.partition(".")
    if not equals or not entry:
        raise InputError(f"--set: expected TABLE.ENTRY=VALUE such as trust.max_age_cycles=10, got '{text}'")
    try:
        read = tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        read = value
    for known, _ in _entries({table: {entry: read}}, "--set", has_mapping=False):
        name = known
    return name, read


def _checked(name: str, value: Any, where: str, folder: Path) -> Any:
    """Return the value of an entry in the unit of its field.

    Raises
    ------
    InputError
        It is of another kind, or not within its range.
    """
    table, _, entry_name = name.partition(".")
    entry = TABLES[table][entry_name]
    if entry.kind == "flag" and isinstance(value, bool):
        return value
    if entry.kind in ("text", "file") and isinstance(value, str) and value:
        _refuse_removed(f"{name}={value}", where)
        if entry.choices and value not in entry.choices:
            raise InputError(f"{where}: expected one of {', '.join(entry.choices)}, got '{value}'")
        return folder / value if entry.kind == "file" else value
    if entry.kind == "label" and isinstance(value, str | int) and not isinstance(value, bool):
        return str(value)
    if entry.kind == "values" and isinstance(value, dict):
        return tuple(f"{key}={_plain(one)}" for key, one in value.items())
    is_number = isinstance(value, int) or (entry.kind == "number" and isinstance(value, float))
    if entry.kind in ("number", "whole") and is_number and not isinstance(value, bool):
        if not isfinite(value) or not entry.low <= value <= entry.high:
            raise InputError(
                f"{where}: expected {entry.low:,.10g} to {entry.high:,.10g} {entry.unit}".rstrip()
                + f", got {value}"
            )
        return value if entry.kind == "whole" else entry.scale * value
    expected = {
        "whole": "a whole number",
        "file": "a path",
        "values": "a table",
        "flag": "true or false",
    }
    what = expected.get(entry.kind, f"a {entry.kind}")
    raise InputError(
        f"{where}: expected {what}{f' [{entry.unit}]' if entry.unit else ''}, got {str(value)[:40]!r}"
    )


def _plain(value: Any) -> str:
    """Return an option of an interface as a command line has it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _check_together(checked: Mapping[str, Any], where: str, maps_signals: bool) -> None:
    """Refuse entries that exclude or need each other, and a DBC file of which no signal is mapped.

    Raises
    ------
    InputError
        One of these.
    """
    has_dbc, has_mapping = "input.dbc" in checked, "input.mapping" in checked
    if has_dbc and "input.profile" in checked:
        raise InputError(f"{where}: input.profile: expected without input.dbc, got both")
    if has_dbc and not has_mapping and not maps_signals:
        raise InputError(f"{where}: input.strain: expected a signal for each gauge of input.dbc, got none")
    for name, needed in NEEDS.items():
        if name in checked and needed not in checked:
            raise InputError(f"{where}: {name}: expected with {needed}, got it alone")
    if has_mapping and maps_signals:
        raise InputError(f"{where}: input.mapping: expected without [input.strain], got both")


def _description(checked: Mapping[str, Any]) -> BusDescription:
    """Return the description of checked values by "table.entry"."""
    stated: dict[str, Any] = {}
    identifiers: dict[str, Any] = {}
    own: dict[str, Any] = {}
    for name, value in checked.items():
        table, _, entry = name.partition(".")
        sets = TABLES[table][entry].sets
        if sets.startswith("identifiers."):
            identifiers[sets.partition(".")[2]] = value
        elif sets in BusDescription.__dataclass_fields__:
            own[sets] = value
        elif not (sets == "cycle_time" and "input.dbc" in checked):  # the mapping's, which states it
            stated[sets] = value
    if identifiers:
        stated["identifiers"] = identifiers
    return BusDescription(stated=stated, **own)


def bus_template(gauge_names: Sequence[str]) -> str:
    """Return a bus file with every entry, its default or an example, and its text; optional ones as comments."""
    lines = [
        "# A bus for strainfmu: bridge, send, dbc, replay, estimate and monitor read this file (--bus bus.toml).",
        "# Remove '# ' before an entry to state it. Paths are relative to this file.",
    ]
    for table, entries in TABLES.items():
        lines += ["", f"[{table}]"]
        for name, entry in entries.items():
            mark = "" if table == "bus" and name in ("interface", "channel") else "# "
            unit = f" [{entry.unit}]" if entry.unit else ""
            allowed = f": {', '.join(entry.choices)}" if entry.choices else ""
            lines.append(f"{f'{mark}{name} = {entry.example}':<44}  # {entry.text}{unit}{allowed}")
        if table == MAPPING_TABLE:
            lines += ["", "# [input.strain]                            # with dbc: Message.Signal of each gauge;"]
            lines += [
                "#                                           # * stands for all others: the signals of their names"
            ]
            lines += [f'# "{name}" = "Message.Signal"' for name in gauge_names]
    return "\n".join(lines) + "\n"
