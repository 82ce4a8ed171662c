"""A bus described in one file, bus.toml: interface, frames, clock, trust, zero offsets, tare, recording and page.

bus_entries.toml declares every entry once: its unit, its range and the option that it sets. The reader, the
template and ``--set`` iterate over it. Entries that are not stated keep the defaults of
:class:`~strainfmu.can.options.BridgeOptions`. Paths are relative to the folder of the file.
"""

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
from strainfmu.estimator.signal_names import STRAIN
from strainfmu.fmu.description.port import TX_CLOCKS
from strainfmu.recorded.names import suggestion
from strainfmu.text_files import read_toml


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One entry of the file, by the fields that bus_entries.toml describes."""

    sets: str
    text: str
    kind: str = "number"
    unit: str = ""
    scale: float = 1.0
    low: float = -inf
    high: float = inf
    choices: tuple[str, ...] = ()
    example: str = ""


_CHOICES = {"profiles": PROFILES, "restarts": RESTARTS, "result_forms": RESULT_FORMS, "tx_clocks": TX_CLOCKS}


def _tables() -> dict[str, dict[str, Entry]]:
    """Return all entries by table and name."""
    stated = tomllib.loads(Path(__file__).with_name("bus_entries.toml").read_text("utf-8"))
    return {
        table: {
            name: Entry(**{**entry, "choices": _CHOICES.get(entry.get("choices", ""), ())})
            for name, entry in entries.items()
        }
        for table, entries in stated.items()
    }


TABLES: Mapping[str, Mapping[str, Entry]] = _tables()

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
    network, tx_clock, response_time, can_rate, fd_rate : of an FMU on the bus: name of its network, kind of its
        transmit clock, time from strains to their result [s], bit rates [kbit/s].
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
    network: str = "CAN"
    tx_clock: str = "countdown"
    response_time: float = 5e-4
    can_rate: int = 500
    fd_rate: int = 2000

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
    path: Path | None, settings: Sequence[str] = (), option_values: Mapping[str, Any] | None = None
) -> BusDescription:
    """Return the bus that a file, ``--set`` and other options of the command line describe, the last one first.

    Parameters
    ----------
    path : the file, None for none.
    settings : texts of ``--set``, "table.entry=value" with a value of TOML, or a text without quotes.
    option_values : values of other options by "table.entry", None where they were not given.

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
    for name, value in (option_values or {}).items():
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
    """Return the value of an entry in the unit of its field."""
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
        return tuple(f"{key}={_plain(entry)}" for key, entry in value.items())
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
    """Refuse entries that exclude or need each other, and a DBC file of which no signal is mapped."""
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
    sections: dict[str, Any] = {}
    for name, value in checked.items():
        table, _, entry = name.partition(".")
        sets = TABLES[table][entry].sets
        if sets.startswith("identifiers."):
            identifiers[sets.partition(".")[2]] = value
        elif sets in BusDescription.__dataclass_fields__:
            sections[sets] = value
        elif not (sets == "cycle_time" and "input.dbc" in checked):  # the mapping's, which states it
            stated[sets] = value
    if identifiers:
        stated["identifiers"] = identifiers
    return BusDescription(stated=stated, **sections)


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
            signals = Path(__file__).with_name("mapped_signals.toml").read_text("utf-8")
            lines += ["", *(f"# {line}".replace("# #", "#") for line in signals.splitlines())]
    return "\n".join(lines) + "\n"
