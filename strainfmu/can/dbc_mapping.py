"""The frames that the bridge reads, from a user's DBC file and a mapping of its signals to gauges.

The mapping is TOML; docs/reference/can.md describes it. Our signal plan decodes the frames; tests compare it with
cantools. Every error names the entry of the mapping.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Any, TypeVar

from strainfmu.can.dbc_files import E2E_DATA_ID, E2E_PROFILE, SECOC_DATA_ID
from strainfmu.can.frame import FD_LENGTHS, Protection, error_line
from strainfmu.can.frame_layout import (
    ALTITUDE,
    BIG,
    FLOAT,
    FLOW_QUANTITIES,
    FLOW_STDS,
    LARGEST_PARAMETER,
    LITTLE,
    MAPPED_QUANTITIES,
    SIGNED,
    UNSIGNED,
    FlowSignal,
    FrameLayout,
    InputFrame,
    InputLayout,
    SignalLayout,
    is_parameter,
    is_parameter_std,
    is_temperature,
    temperature_name,
)
from strainfmu.can.options import checked_cycle_time
from strainfmu.can.profiles import signal_names
from strainfmu.can.signals import checked_signal
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import Q_SOURCE, SAMPLE_INPUTS, QSource
from strainfmu.estimator.signal_names import STRAIN, TEMPERATURE
from strainfmu.interface.sensor_variables import PREFIX as SENSOR_PREFIX
from strainfmu.interface.sensor_variables import THRUST, identifier
from strainfmu.units import READING_UNITS, STRAIN_UNITS, TEMPERATURE_UNITS, TIME_UNITS, UNITS_OF

_OF_UNIT = {
    "Pa": (UNITS_OF["Pa"], "a unit of pressure", ""),
    "1": (UNITS_OF["1"] | {"Mach": 1.0, "Ma": 1.0}, "a number", "1"),
    "m": (UNITS_OF["m"], "a unit of length", ""),
    "K": (UNITS_OF["K"], "K", ""),
    "rad": (UNITS_OF["rad"], "a unit of angle", ""),
    "m/s2": (UNITS_OF["m/s2"], "a unit of acceleration", ""),
    "rad/s": (UNITS_OF["rad/s"], "a unit of angular rate", ""),
    "rad/s2": (UNITS_OF["rad/s2"], "a unit of angular acceleration", ""),
}
_OF_STRAIN = (STRAIN_UNITS, "a unit of strain", "1")
_UNITS_OF = {
    sample_input.name: _OF_STRAIN if sample_input.shown in STRAIN_UNITS else _OF_UNIT[sample_input.unit]
    for sample_input in SAMPLE_INPUTS
}
"""Units of a quantity of the flow, what they are, and the unit of a signal without one."""

_NO_VALUE = re.compile(
    r"(?<![a-z])sna(?![a-z])|fail|(?<![a-z])fault|error|invalid|undefined|unavailable"
    r"|not[ _-]?(available|valid|defined)|no[ _-]?(data|value|signal)",
    re.IGNORECASE,
)
"""These words, anywhere in the name of a value, mark it as "no value"."""

_ALL_WELL = re.compile(r"(?<![a-z])no[ _-]?(fail(ure)?|fault|error)", re.IGNORECASE)

_Key = TypeVar("_Key")
"""What a signal is of: the number of a gauge, or the name of a quantity."""

_ABSENT = {
    TEMPERATURE: "temperature sensors",
    "sensors": "auxiliary sensors",
    "parameter": "flow parameters",
}
"""What an estimator lacks to which a table of the mapping cannot map."""

_START_VALUE = "GenSigStartValue"
"""Signal attribute of a DBC file: the raw number that a sender starts with."""

_TABLES = {
    *(STRAIN, *FLOW_QUANTITIES, *MAPPED_QUANTITIES, TEMPERATURE, "sensors", THRUST, "parameter"),
    *("units", "end_to_end", "sample_time", "status", "configuration", "cycle_time_ms", "period_ms", "timeout_ms"),
}

_OTHERS = "*"
"""Stands for all gauges that are not listed."""

_PERIODS_HELD = 2.0
"""Own periods for which a slow signal is held where the mapping states no time-out."""

_MUCH = 1.5
"""Ratio of two periods from which on they are not the same."""


def signal_layout(signal: Any, with_names: bool = False) -> SignalLayout:
    """Return our description of cantools' ``signal``; ``with_names`` evaluates the names of its values.

    Raises
    ------
    InputError
        Its numbers cannot be used.
    """
    try:
        codes = _no_value_codes(signal) if with_names else []
        return SignalLayout(
            name=signal.name,
            start=int(signal.start),
            length=int(signal.length),
            byte_order=LITTLE if signal.byte_order == "little_endian" else BIG,
            kind=FLOAT if signal.is_float else SIGNED if signal.is_signed else UNSIGNED,
            scale=float(signal.scale),
            offset=float(signal.offset),
            unit=signal.unit or "",
            minimum=None if signal.minimum is None else float(signal.minimum),
            maximum=None if signal.maximum is None else float(signal.maximum),
            not_available=codes[0] if codes else None,
            initial=None if signal.raw_initial is None else int(signal.raw_initial),
            other_no_value=tuple(codes[1:]),
        )
    except (OverflowError, ValueError, TypeError) as error:
        raise InputError(f"signal '{signal.name}': numbers that cannot be used: {error}") from error


def _no_value_codes(signal: Any) -> list[int]:
    """Return the raw numbers, as int64, that the DBC file names "not available" or the like."""
    names = [(int(number), _ALL_WELL.sub("", str(text))) for number, text in (signal.choices or {}).items()]
    codes = [_int64(number, signal) for number, text in names if _NO_VALUE.search(text)]
    return [code for code in codes if code is not None]


def _int64(number: int, signal: Any) -> int | None:
    """Return the raw number of ``signal`` as decoding gives it, of a float its bits; None if there is none."""
    if signal.is_float:
        kind = {16: "<e", 32: "<f", 64: "<d"}.get(signal.length)
        try:
            return (
                None if kind is None else int.from_bytes(struct.pack(kind, number), "little", signed=kind == "<d")
            )
        except OverflowError:
            return None
    if signal.length == 64 and not signal.is_signed:
        number -= (number >> 63) << 64
    return number if -(2**63) <= number < 2**63 else None


def mapped_layout(
    database: Any,
    mapping: Mapping[str, Any],
    gauge_names: Sequence[str],
    name: str,
    sensor_names: Sequence[str] = (),
    parameter_names: Sequence[str] = (),
    parameter_std_names: Sequence[str] = (),
    flow_names: Sequence[str] = (),
    readings: Mapping[str, str] | None = None,
) -> InputLayout:
    """Return the frames that ``mapping`` names in ``database``.

    Parameters
    ----------
    database : cantools' database of the DBC file.
    mapping : tables of the mapping.
    gauge_names : gauges in the order of the FMU's strains; the mapping may also call them strain[1], strain[2] ...
    name : of the mapping, for messages.
    sensor_names : temperature sensors of the estimator; the mapping may also call them temperature[1] ..
    parameter_names : inputs ``parameter.NAME`` of the estimator for flow parameters.
    parameter_std_names : inputs ``parameter_std.NAME`` for their standard deviations.
    flow_names : other inputs of the estimator; p_inf and sigmas of navigation may be mapped to them.
    readings : unit of each input ``sensor.NAME`` of the estimator for an auxiliary sensor, and of ``thrust``.
    """
    readings = dict(readings or {})
    numbered = [temperature_name(k) for k in range(1, len(sensor_names) + 1)]
    by_name, std_by_name = (
        {name.partition(".")[2]: name for name in names} for names in (parameter_names, parameter_std_names)
    )
    other_tables = {
        TEMPERATURE: ("sensor", dict(zip(sensor_names, numbered, strict=True))),
        "sensors": ("sensor", {name.removeprefix(SENSOR_PREFIX): name for name in readings if name != THRUST}),
        "parameter": ("name", by_name),
    }
    stds = {by_name[name]: deviation for name, deviation in std_by_name.items() if name in by_name}
    stds |= {quantity: std for quantity, std in FLOW_STDS.items() if std in flow_names}
    mapped = tuple(name for name in MAPPED_QUANTITIES if name in flow_names)
    mapper = _Mapper(
        *(database, mapping, gauge_names, name),
        other_tables=other_tables,
        stds=stds,
        mapped=mapped,
        readings=readings,
    )
    return mapper.layout()


class _Mapper:
    """Makes the layout of one mapping.

    Parameters
    ----------
    others : by table of the mapping: what its entries are, and the estimator's inputs by the names of these.
    stds : by input: the input for the standard deviation that may be stated next to its signal.
    mapped : quantities of the flow that a mapping alone gives, and that the estimator takes.
    readings : units of auxiliary sensors and of thrust by name of the estimator's input.
    """

    def __init__(
        self,
        database: Any,
        mapping: Mapping[str, Any],
        gauge_names: Sequence[str],
        name: str,
        other_tables: Mapping[str, tuple[str, Mapping[str, str]]],
        stds: Mapping[str, str],
        mapped: Sequence[str],
        readings: Mapping[str, str],
    ) -> None:
        self._database, self._mapping, self._name = database, mapping, name
        self._names = tuple(gauge_names)
        self._gauges = {gauge: index for index, gauge in enumerate(gauge_names)}
        self._gauges |= {f"strain[{index + 1}]": index for index in range(len(gauge_names))}
        self._others = {
            table: (kind, {**inputs, **{name: name for name in inputs.values()}})
            for table, (kind, inputs) in other_tables.items()
        }
        self._stds, self._mapped, self._readings = stds, mapped, readings
        self._constants: dict[str, float] = {}
        self._frames_in_use, self._with_timeout, self._signals_with_unit = set[str](), set[str](), set[str]()
        self._checked: set[str] = set()
        unknown = sorted(set(mapping) - _TABLES)
        if "slow_strains" in unknown:
            raise self._refusal("slow_strains", "expected no such entry: slower frames of strains are held")
        if unknown:
            raise InputError(f"{name}: expected one of {', '.join(sorted(_TABLES))}, got entry '{unknown[0]}'")

    def layout(self) -> InputLayout:
        """Return the whole input."""
        by_message: dict[tuple[str, int | None], list[tuple[int, Any]]] = {}
        for gauge, path in self._strain_table().items():
            message, signal = self._signal(path, f"strain, '{gauge}'")
            by_message.setdefault((message.name, self._selector_value(signal)), []).append(
                (self._gauge(gauge), signal)
            )
        by_message = _with_every_page(by_message)
        gauges = [index for items in by_message.values() for index, _ in items]
        for index, gauge in enumerate(self._names):
            if gauges.count(index) != 1:
                number = "none" if index not in gauges else f"{gauges.count(index)}"
                raise self._refusal(STRAIN, f"expected one signal for gauge '{gauge}', got {number}")
        frames = tuple(self._strain_frame(*key, items) for key, items in sorted(by_message.items(), key=_by_name))
        timed = [frame.sample_time is not None for frame in frames]
        if any(timed) and not all(timed):
            missing = frames[timed.index(False)].layout.name
            raise self._refusal(
                "sample_time", f"expected one for every frame of strains, got none for '{missing}'"
            )
        cycle_time = self._cycle_time(frames)
        frames = self._with_rates(frames, cycle_time)
        of_flow = self._flow_frames(cycle_time)
        of_strain = {frame.layout.key for frame in frames}
        for frame in of_flow:
            if frame.layout.key in of_strain:
                text = f"expected a frame without strains, got '{frame.layout.name}', which holds some"
                raise self._refusal(frame.flow[0].quantity, text)
        for table in ("sample_time", "status", "configuration", "end_to_end", "period_ms"):
            self._check_keys(table, "frame", self._frames_in_use)
        what = "frame of q_inf, navigation, temperatures, sensors, thrust, parameters or slow strains"
        self._check_keys("timeout_ms", what, self._with_timeout)
        self._check_keys("units", "signal", self._signals_with_unit)
        return InputLayout(
            name=self._name,
            n_gauges=len(self._names),
            strain_frames=frames,
            flow_frames=of_flow,
            cycle_time=cycle_time,
            constants=tuple(self._constants.items()),
        )

    def _refusal(self, where: str, text: str) -> InputError:
        """Return the error of the entry ``where``."""
        return InputError(f"{self._name}: {where}: {text}")

    # --- frames --------------------------------------------------------------------------------------------------

    def _strain_frame(self, message_name: str, selector: int | None, items: list[tuple[int, Any]]) -> InputFrame:
        """Return one frame of strains."""
        message = self._database.get_message_by_name(message_name)
        used = [signal for _, signal in items]
        return self._frame(
            message,
            selector,
            used,
            (STRAIN, "two gauges"),
            indices=tuple(range(len(used))),
            gauges=tuple(gauge for gauge, _ in items),
            to_strain=tuple(self._factor(message, signal, STRAIN_UNITS, "a unit of strain") for signal in used),
        )

    def _flow_frames(self, cycle_time: float) -> tuple[InputFrame, ...]:
        """Return the frames of q_inf, air data and other inputs; quantities of one frame are decoded together.

        Those of a frame that is slower than the cycle [s] are held for two of its own periods.
        """
        by_frame: dict[tuple[str, int | None], list[tuple[str, Any]]] = {}
        other_paths = (pair for table in self._others for pair in self._other_paths(table))
        for quantity, path in (*self._flow_paths(), *other_paths):
            message, signal = self._signal(path, quantity)
            by_frame.setdefault((message.name, self._selector_value(signal)), []).append((quantity, signal))
        frames = [self._flow_frame(*key, items) for key, items in _with_every_page(by_frame).items()]
        timeouts = [self._timeout(frame, _PERIODS_HELD) for frame in frames]
        stated = self._table("timeout_ms", optional=True)
        return tuple(
            replace(frame, timeout=timeout)
            if frame.layout.name.partition("[")[0] in stated or (frame.layout.cycle_time or 0.0) > cycle_time
            else frame
            for frame, timeout in zip(frames, timeouts, strict=True)
        )

    def _flow_frame(self, message_name: str, selector: int | None, items: list[tuple[str, Any]]) -> InputFrame:
        """Return one frame of quantities of the flow."""
        message = self._database.get_message_by_name(message_name)
        flow = []
        for index, (quantity, signal) in enumerate(items):
            factor, offset = self._to_si(message, signal, quantity)
            flow.append(FlowSignal(quantity=quantity, index=index, to_si=factor, offset=offset))
        names = " and ".join(quantity for quantity, _ in items)
        used = [signal for _, signal in items]
        return self._frame(message, selector, used, (names, "both"), flow=tuple(flow))

    def _frame(
        self, message: Any, selector: int | None, used: list[Any], what: tuple[str, str], **measured: Any
    ) -> InputFrame:
        """Return a frame whose signals ``used`` are ``measured``; ``what`` they are of, for messages."""
        names = [signal.name for signal in used]
        if twice := [name for name in names if names.count(name) > 1]:
            where = f"{self._name}: {what[0]}: signal '{message.name}.{twice[0]}'"
            raise InputError(f"{where} found for {what[1]}")
        extra, indices = self._extras(message, selector, len(used))
        layout = self._frame_layout(message, [*used, *extra], selector=selector, measured=used, indices=indices)
        tick = self._tick(message, extra[indices["sample_time"] - len(used)]) if "sample_time" in indices else 1e-6
        return InputFrame(layout=layout, tick=tick, **(measured | indices))

    def _frame_layout(
        self,
        message: Any,
        signals: list[Any],
        selector: int | None,
        measured: list[Any],
        indices: Mapping[str, int],
    ) -> FrameLayout:
        """Return our description of ``message`` with ``signals``, those ``measured`` with their value names."""
        where = f"{self._name}: frame '{message.name}'"
        allowed = FD_LENGTHS if message.is_fd else FD_LENGTHS[:9]
        if message.length not in allowed:
            raise InputError(f"{where}: {message.length} bytes found, {', '.join(map(str, allowed))} allowed")
        multiplexer, pages = None, 1
        if selector is not None:
            switch = self._switch(message, signals, where)
            multiplexer = signal_layout(switch), selector
            pages = len({number for entry in message.signals for number in entry.multiplexer_ids or ()})
            signals = [*signals, *([] if switch in signals else [switch])]
        layouts = [signal_layout(signal, with_names=signal in measured) for signal in signals]
        if (index := indices.get("configuration")) is not None:
            layouts[index] = replace(layouts[index], initial=self._start_value(message, signals[index]))
        layout = FrameLayout(
            name=message.name if selector is None else f"{message.name}[{selector}]",
            identifier=message.frame_id,
            length=message.length,
            signals=tuple(layouts),
            is_extended=message.is_extended_frame,
            is_fd=bool(message.is_fd),
            protection=self._protection(message),
            cycle_time=self._period(message, where, pages),
            sender=message.senders[0] if message.senders else "",
            multiplexer=multiplexer,
        )
        for signal in layout.signals:
            checked_signal(signal, layout)
        return layout

    def _switch(self, message: Any, signals: list[Any], where: str) -> Any:
        """Return the multiplexer of ``signals``."""
        names = sorted({signal.multiplexer_signal for signal in signals if signal.multiplexer_ids})
        switch = message.get_signal_by_name(names[0])
        if len(names) > 1 or switch.multiplexer_ids:
            switches = ", ".join(names if len(names) > 1 else [str(switch.multiplexer_signal), switch.name])
            raise InputError(f"{where}: multiplexers {switches} found, one allowed")
        return switch

    def _extras(self, message: Any, selector: int | None, first: int) -> tuple[list[Any], dict[str, int]]:
        """Return the signals of ``message`` that are no strains, and their indices from ``first`` on."""
        self._frames_in_use.add(message.name)
        signals: list[Any] = []
        indices: dict[str, int] = {}
        for role in ("sample_time", "status", "configuration"):
            table, where = self._table(role, optional=True), f"{role}.{message.name}"
            if message.name not in table:
                continue
            entry = table[message.name]
            path = entry.get("signal") if isinstance(entry, Mapping) else entry
            owner, signal = self._signal(path, where)
            if owner.name != message.name:
                raise self._refusal(where, f"expected a signal of that frame, got '{path}'")
            if signal.is_float or signal.is_signed or (role == "sample_time" and signal.length < 8):
                raise self._refusal(where, "expected an unsigned integer of 8 to 64 bits")
            if signal.multiplexer_ids and selector not in signal.multiplexer_ids:
                place = "the frame itself" if selector is None else f"multiplexer value {selector}"
                values = ", ".join(map(str, signal.multiplexer_ids))
                text = f"expected a signal of {place}, got '{path}', which comes with multiplexer value {values}"
                raise self._refusal(where, text)
            indices[role] = first + len(signals)
            signals.append(signal)
        return signals, indices

    # --- gauges and quantities -----------------------------------------------------------------------------------

    def _strain_table(self) -> dict[str, Any]:
        """Return the path of each gauge's signal; "*" stands for all others, whose signals have their names."""
        table = dict(self._table(STRAIN))
        pattern = table.pop(_OTHERS, None)
        if pattern is None:
            return table
        stated = {self._gauge(gauge) for gauge in table}
        for index, signal_name in enumerate(signal_names(self._names)):
            if index not in stated:
                table[self._names[index]] = self._signal_of_name(signal_name, str(pattern), self._names[index])
        return table

    def _signal_of_name(self, signal_name: str, pattern: str, gauge: str) -> str:
        """Return the one "Message.Signal" of a name that fits a pattern such as "Rack*.*"."""
        paths = [f"{message.name}.{signal_name}" for message in self._database.messages]
        known = {f"{m.name}.{signal.name}" for m in self._database.messages for signal in m.signals}
        matches = [path for path in paths if path in known and fnmatchcase(path, pattern)]
        if len(matches) != 1:
            text = f"expected one signal {pattern} of the name {signal_name} for gauge '{gauge}', got "
            raise self._refusal(f"strain, '{_OTHERS}'", text + (", ".join(matches) or "none"))
        return matches[0]

    def _gauge(self, gauge: str) -> int:
        if gauge not in self._gauges:
            raise self._refusal(
                STRAIN,
                f"expected a gauge of the FMU ({', '.join(self._names[:4])} .. or "
                f"strain[1] .. strain[{len(self._names)}]), got '{gauge}'",
            )
        return self._gauges[gauge]

    def _flow_paths(self) -> list[tuple[str, Any]]:
        """Return the quantities of the flow that are mapped, and "Message.Signal" of each."""
        signals: dict[str, Any] = {}
        taken = {name: name in self._mapped for name in MAPPED_QUANTITIES} | {THRUST: THRUST in self._readings}
        for quantity in (*FLOW_QUANTITIES, *taken):
            table = self._table(quantity, optional=True)
            if not table:
                continue
            if not taken.get(quantity, True):
                raise self._refusal(quantity, "expected none, the estimator does not take it")
            if quantity == ALTITUDE and set(table) != {"signal"}:
                raise self._refusal(quantity, f"expected 'signal', got {', '.join(table)}")
            if quantity == Q_SOURCE and "value" in table:
                self._constants[quantity] = self._source(table)
                continue
            signals[quantity], deviation = self._signal_and_std(quantity, quantity, table)
            signals |= deviation
        return list(signals.items())

    def _source(self, table: Mapping[str, Any]) -> float:
        """Return the number of the source of the dynamic pressure that ``table`` names for the whole run."""
        name = table["value"]
        if name not in QSource.__members__ or len(table) > 1:
            known = ", ".join(QSource.__members__)
            raise self._refusal(Q_SOURCE, f"expected 'value' of {known}, got {str(dict(table))[:60]}")
        return float(QSource[name])

    def _other_paths(self, table: str) -> list[tuple[str, Any]]:
        """Return the inputs of the estimator that ``table`` maps, and "Message.Signal" of each."""
        signals: dict[str, Any] = {}
        kind, inputs = self._others[table]
        for stated, entry in self._table(table, optional=True).items():
            # A sensor of a map may have a name that no input of an FMU can have.
            name = identifier(stated) if table == "sensors" and stated not in inputs else stated
            if name not in inputs:
                known = ", ".join(inputs)[:200] or f"none, the estimator has no {_ABSENT[table]}"
                raise self._refusal(table, f"expected a {kind} ({known}), got '{stated}'")
            quantity = inputs[name]
            if quantity in signals:
                raise self._refusal(table, f"expected one signal for '{stated}', got 2")
            signals[quantity], deviation = self._signal_and_std(f"{table}.{stated}", quantity, entry)
            signals |= deviation
        return list(signals.items())

    def _signal_and_std(self, where: str, quantity: str, entry: Any) -> tuple[Any, dict[str, str]]:
        """Return "Message.Signal" of an entry, and its standard deviation's by input; a number is kept."""
        if not isinstance(entry, Mapping):
            return entry, {}
        if not {"signal"} <= set(entry) <= {"signal", "std"}:
            raise self._refusal(where, f"expected 'signal' and 'std', got {', '.join(entry) or 'none'}")
        if "std" not in entry:
            return entry["signal"], {}
        of_std, std = self._stds.get(quantity), entry["std"]
        if of_std is None:
            raise self._refusal(where, "std: expected none, the estimator does not take it")
        if isinstance(std, str):
            return entry["signal"], {of_std: std}
        if isinstance(std, bool) or not isinstance(std, int | float) or not 0.0 <= std < LARGEST_PARAMETER:
            text = f"std: expected 'Message.Signal' or a number from 0 on, got {str(std)[:40]}"
            raise self._refusal(where, text)
        self._constants[of_std] = float(std)
        return entry["signal"], {}

    # --- entries and what they name in the DBC file --------------------------------------------------------------

    def _table(self, name: str, optional: bool = False) -> Mapping[str, Any]:
        """Return the table ``name``, empty if it is ``optional`` and missing."""
        table = self._mapping.get(name, {} if optional else None)
        if not isinstance(table, Mapping) or (not table and not optional):
            raise InputError(f"{self._name}: expected a table [{name}]")
        return table

    def _check_keys(self, table: str, kind: str, in_use: Iterable[str]) -> None:
        """Refuse an entry for a frame or signal that is not in use: it would be ignored silently."""
        unknown = sorted(set(self._table(table, optional=True)) - set(in_use))
        if unknown:
            known = ", ".join(sorted(in_use))[:200]
            raise self._refusal(table, f"expected a {kind} in use ({known}), got '{unknown[0]}'")

    def _signal(self, path: Any, where: str) -> tuple[Any, Any]:
        """Return the message and the signal of "Message.Signal"."""
        message_name, dot, signal_name = path.partition(".") if isinstance(path, str) else ("", "", "")
        if not dot:
            raise self._refusal(where, f"expected 'Message.Signal', got {path!r}")
        message = self._message(message_name, where)
        signals = [signal for signal in message.signals if signal.name == signal_name]
        if len(signals) > 1:
            raise self._refusal(where, f"expected one signal '{path}' in the DBC file, got {len(signals)}")
        if not signals:
            known = ", ".join(signal.name for signal in message.signals)[:200]
            raise self._refusal(where, f"no signal '{signal_name}' in frame '{message_name}': {known or 'none'}")
        return message, signals[0]

    def _message(self, name: str, where: str) -> Any:
        """Return the only frame of that name; no other frame may have its identifier."""
        known = self._database.messages
        matches = [message for message in known if message.name == name]
        if not matches:
            raise self._refusal(where, f"no frame '{name}' in the DBC file")
        message = matches[0]
        if len(matches) > 1:
            raise self._refusal(where, f"expected one frame '{name}' in the DBC file, got {len(matches)}")
        for second in known:
            same = (second.frame_id, second.is_extended_frame) == (message.frame_id, message.is_extended_frame)
            if same and second is not message:
                both = f"both '{name}' and '{second.name}' in the DBC file"
                raise self._refusal(where, f"identifier 0x{message.frame_id:X} belongs to {both}")
        if name not in self._checked:
            try:
                message.refresh(strict=True)
            except Exception as error:  # cantools raises exceptions of several types
                raise self._refusal(where, f"in the DBC file: {error_line(error)[:300]}") from error
            self._checked.add(name)
        return message

    def _selector_value(self, signal: Any) -> int | None:
        """Return the multiplexer's value with which ``signal`` is sent, None if it is always sent."""
        identifiers = signal.multiplexer_ids
        if not identifiers:
            return None
        if len(identifiers) != 1:
            raise self._refusal(
                f"signal '{signal.name}'", f"{len(identifiers)} multiplexer values found, 1 allowed"
            )
        return int(identifiers[0])

    def _to_si(self, message: Any, signal: Any, quantity: str) -> tuple[float, float]:
        """Return factor and offset of a signal that holds ``quantity`` of the flow."""
        if is_temperature(quantity):
            unit = self._unit(message, signal, tuple(TEMPERATURE_UNITS), "a unit of temperature")
            return TEMPERATURE_UNITS[unit]
        if is_parameter(quantity) or is_parameter_std(quantity):
            return 1.0, 0.0  # the vehicle file has their unit; no mapping states it
        if quantity in self._readings:
            unit = self._readings[quantity]
            units = READING_UNITS.get(unit, {unit: 1.0})
            return self._factor(message, signal, units, f"a unit of {quantity}"), 0.0
        return self._factor(message, signal, *_UNITS_OF[quantity]), 0.0

    def _factor(
        self, message: Any, signal: Any, units: Mapping[str, float], what: str, unless_stated: str = ""
    ) -> float:
        """Return the factor to SI of a signal's unit, see :meth:`_unit`."""
        return units[self._unit(message, signal, tuple(units), what, unless_stated)]

    def _unit(self, message: Any, signal: Any, units: Sequence[str], what: str, unless_stated: str = "") -> str:
        """Return a signal's unit, one of ``units``; the mapping takes precedence over the DBC file.

        A signal without a unit has the unit ``unless_stated``.
        """
        path = f"{message.name}.{signal.name}"
        self._signals_with_unit.add(path)
        unit = self._table("units", optional=True).get(path, signal.unit or unless_stated)
        if not isinstance(unit, str) or unit.strip() not in units:
            text = f"unit: expected {what} ({', '.join(units)}), got {unit!r}; state it under [units]"
            raise self._refusal(f"signal '{path}'", text)
        return unit.strip()

    def _tick(self, message: Any, signal: Any) -> float:
        """Return the unit of a sample time [s]."""
        tick = self._factor(message, signal, TIME_UNITS, "a unit of time") * float(signal.scale)
        if not tick > 0.0:
            raise self._refusal(f"signal '{message.name}.{signal.name}'", f"scale {signal.scale} found")
        return tick

    def _protection(self, message: Any) -> Protection | None:
        """Return the end-to-end protection stated by the mapping, otherwise by the DBC file's attributes."""
        where, attributes = f"end_to_end.{message.name}", {} if message.dbc is None else message.dbc.attributes
        if SECOC_DATA_ID in attributes:
            raise InputError(
                f"{self._name}: frame '{message.name}' is authenticated ({SECOC_DATA_ID}), which a mapping cannot "
                "state; use --profile fd64-sec"
            )
        stated = self._table("end_to_end", optional=True).get(message.name)
        if stated is None:
            names = {"profile": E2E_PROFILE, "data_id": E2E_DATA_ID}
            stated = {entry: attributes[name].value if name in attributes else 0 for entry, name in names.items()}
        elif not isinstance(stated, Mapping) or set(stated) != {"profile", "data_id"}:
            raise self._refusal(where, "expected 'profile' and 'data_id'")
        profile, data_id = stated["profile"], stated["data_id"]
        if profile in (0, "") and profile is not False:
            return None
        min_length = {1: 2, 5: 3}.get(profile) if isinstance(profile, int) else None
        if min_length is None or isinstance(profile, bool):
            raise self._refusal(where, f"profile {profile!r} found, 1 or 5 allowed")
        if not isinstance(data_id, int) or isinstance(data_id, bool) or not 0 <= data_id <= 0xFFFF:
            raise self._refusal(where, f"data_id {data_id!r} found, 0 to 65535 allowed")
        if message.length < min_length:
            text = f"a frame of {message.length} bytes found, CRC and counter need {min_length}"
            raise self._refusal(where, text)
        return Protection(profile, data_id)

    def _start_value(self, message: Any, signal: Any) -> int:
        """Return the required number of a configuration: the signal's start value, else the file's default."""
        value = signal.raw_initial
        if value is None:
            definition = self._database.dbc.attribute_definitions.get(_START_VALUE)
            value = None if definition is None else definition.default_value
        largest = (1 << signal.length) - 1
        if not isinstance(value, int | float) or not 0 <= value <= largest or value != int(value):
            raise self._refusal(
                f"configuration.{message.name}",
                f"start value ({_START_VALUE}) of '{signal.name}': "
                f"expected a whole number of 0 to {largest}, got {'none' if value is None else value}",
            )
        return int(value)

    # --- periods -------------------------------------------------------------------------------------------------

    def _milliseconds(self, name: str, frame: str | None = None) -> float | None:
        """Return what an entry, or entry ``frame`` of the table ``name``, states in ms [s]; None without one."""
        where = name if frame is None else f"{name}.{frame}"
        stated = self._mapping.get(name) if frame is None else self._table(name, optional=True).get(frame)
        if stated is None:
            return None
        if isinstance(stated, bool) or not isinstance(stated, int | float) or not abs(stated) < 1e9:
            raise self._refusal(where, f"expected a number of ms, got {str(stated)[:40]}")
        return stated / 1e3

    def _period(self, message: Any, where: str, pages: int) -> float | None:
        """Return the period of a frame [s] by the mapping, otherwise by the DBC file; None if neither has it.

        A multiplexed message has ``pages``, one after the other, each in a period of its own.
        """
        stated = self._milliseconds("period_ms", message.name)
        if stated is not None:
            return pages * checked_cycle_time(stated, f"{self._name}: period_ms.{message.name}")
        of_file = message.cycle_time
        if not of_file:
            return None
        if not isinstance(of_file, int | float) or not 0.0 < of_file < 1e6:
            raise InputError(f"{where}: cycle time: expected a positive number of ms, got {of_file!r}")
        return pages * (float(of_file) / 1e3)

    def _timeout(self, frame: InputFrame, periods: float) -> float | None:
        """Return for how long the values of a frame are used [s], ``periods`` of its own where none is stated.

        None if neither this nor its period is stated.
        """
        message = frame.layout.name.partition("[")[0]
        self._with_timeout.add(message)
        stated, period = self._milliseconds("timeout_ms", message), frame.layout.cycle_time
        if stated is None:
            return None if period is None else periods * period
        if not stated > 0.0 or stated < (period or 0.0):
            least = "a positive number" if period is None else f"at least its period of {1e3 * period:g}"
            raise self._refusal(f"timeout_ms.{message}", f"expected {least}, got {1e3 * stated:g}")
        return stated

    def _cycle_time(self, frames: Sequence[InputFrame]) -> float:
        """Return the period of a cycle [s]: the mapping's, otherwise the period of its fastest strains."""
        stated = self._milliseconds("cycle_time_ms")
        if stated is not None:
            return checked_cycle_time(stated, f"{self._name}: cycle_time_ms")
        periods = [frame.layout.cycle_time for frame in frames]
        known = [period for period in periods if period is not None]
        if not known or len(known) < len(periods) or min(known) < max(known) <= _MUCH * min(known):
            raise InputError(
                f"{self._name}: expected cycle_time_ms: the DBC file gives the frames of strains no common one"
            )
        return checked_cycle_time(min(known), f"{self._name}: cycle time of the DBC file")

    def _with_rates(self, frames: Sequence[InputFrame], cycle_time: float) -> tuple[InputFrame, ...]:
        """Return the ``frames`` of strains; those slower than the cycle [s] are held, with their time-outs."""
        periods = [frame.layout.cycle_time or cycle_time for frame in frames]
        slow = [frame for frame, period in zip(frames, periods, strict=True) if period > _MUCH * cycle_time]
        if len(slow) == len(frames):
            raise self._refusal(
                "cycle_time_ms",
                f"expected the period of a frame of strains, got {1e3 * cycle_time:g}; "
                f"the fastest has {_ms(min(slow, key=lambda frame: frame.layout.cycle_time or 0.0))}",
            )
        fast = [frame for frame in frames if frame not in slow]
        for frame in slow:
            self._check_same_clock(frame, fast[0])
        for frame in fast:
            if frame.layout.cycle_time is not None and frame.layout.cycle_time * _MUCH < cycle_time:
                raise self._refusal(
                    f"frame '{frame.layout.name}'",
                    f"a period of {_ms(frame)} found, it would come more than once in a cycle of "
                    f"{1e3 * cycle_time:g} ms; state cycle_time_ms = {_ms(frame)[:-3]}, or its true period under "
                    "[period_ms]",
                )
        slow_names = {frame.layout.name for frame in slow}
        return tuple(
            replace(frame, hold=self._timeout(frame, _PERIODS_HELD)) if frame.layout.name in slow_names else frame
            for frame in frames
        )

    def _check_same_clock(self, slow: InputFrame, fast: InputFrame) -> None:
        """Refuse a held frame whose sample time cannot be compared with the others' sample time."""
        if slow.sample_time is None or fast.sample_time is None:
            return
        lengths = [frame.layout.signals[frame.sample_time or 0].length for frame in (slow, fast)]
        if slow.tick != fast.tick or lengths[0] != lengths[1]:
            raise self._refusal(
                f"sample_time.{slow.layout.name}",
                f"expected unit and length of '{fast.layout.name}', "
                f"{fast.tick:g} s and {lengths[1]} bits, got {slow.tick:g} s and {lengths[0]} bits",
            )


def _ms(frame: InputFrame) -> str:
    """Return the period of a frame in words."""
    return f"{1e3 * (frame.layout.cycle_time or 0.0):g} ms"


def _with_every_page(
    by_frame: Mapping[tuple[str, int | None], list[tuple[_Key, Any]]],
) -> dict[tuple[str, int | None], list[tuple[_Key, Any]]]:
    """Return signals by frame and multiplexer value, those that come with every value at the first value in use.

    They are in all of these frames; they are read from one, once a cycle.
    """
    pages: dict[str, list[int]] = {}
    for message, value in by_frame:
        if value is not None:
            pages.setdefault(message, []).append(value)
    joined: dict[tuple[str, int | None], list[tuple[_Key, Any]]] = {}
    for (message, value), items in by_frame.items():
        first = min(pages[message]) if value is None and message in pages else value
        joined.setdefault((message, first), []).extend(items)
    return joined


def _by_name(item: tuple[tuple[str, int | None], Any]) -> tuple[str, int]:
    """Sort frames by name and multiplexer value."""
    (message, selector), _ = item
    return message, -1 if selector is None else selector
