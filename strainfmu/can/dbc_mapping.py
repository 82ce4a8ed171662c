"""The frames that the bridge reads, from a user's DBC file and a mapping of its signals to gauges.

The mapping is TOML; docs/reference/can.md describes it. Our signal plan decodes the frames; tests compare it with
cantools.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Any, TypeVar

from strainfmu.can.dbc_lookup import (
    PERIODS_HELD,
    MappedDatabase,
    cycle_time_of,
    selector_value,
    signal_layout,
    to_si,
    with_rates,
)
from strainfmu.can.frame import FD_LENGTHS
from strainfmu.can.frame_layout import (
    ALTITUDE,
    FLOW_QUANTITIES,
    FLOW_STDS,
    LARGEST_PARAMETER,
    MAPPED_QUANTITIES,
    FlowSignal,
    FrameLayout,
    InputFrame,
    InputLayout,
    temperature_name,
)
from strainfmu.can.profiles import signal_names
from strainfmu.can.signals import checked_signal
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import Q_SOURCE, QSource
from strainfmu.estimator.signal_names import STRAIN, TEMPERATURE
from strainfmu.interface.sensor_variables import PREFIX as SENSOR_PREFIX
from strainfmu.interface.sensor_variables import THRUST, identifier
from strainfmu.units import STRAIN_UNITS, TIME_UNITS

_Key = TypeVar("_Key")
"""What a signal is of: the number of a gauge, or the name of a quantity."""

_ABSENT = {
    TEMPERATURE: "temperature sensors",
    "sensors": "auxiliary sensors",
    "parameter": "flow parameters",
}
"""What an estimator lacks to which a table of the mapping cannot map."""


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
    gauge_names : gauges in the order of the FMU's strains; the mapping may also call them strain[1], strain[2] ...
    name : of the mapping, for messages.
    sensor_names : temperature sensors of the estimator; the mapping may also call them temperature[1] ..
    parameter_names : inputs ``parameter.NAME`` of the estimator for flow parameters.
    parameter_std_names : inputs ``parameter_std.NAME`` for their standard deviations.
    flow_names : other inputs of the estimator; p_inf and sigmas of navigation may be mapped to them.
    readings : unit of each input ``sensor.NAME`` of the estimator for an auxiliary sensor, and of ``thrust``.

    Raises
    ------
    InputError
        The mapping names what does not exist, leaves a gauge out, or a signal cannot be used.
    """
    mapper = _Mapper(database, mapping, gauge_names=gauge_names, name=name)
    numbered = [temperature_name(k) for k in range(1, len(sensor_names) + 1)]
    mapper.may_hold(TEMPERATURE, "sensor", dict(zip(sensor_names, numbered, strict=True)))
    mapper.readings = dict(readings or {})
    of_sensors = [one for one in mapper.readings if one != THRUST]
    mapper.may_hold("sensors", "sensor", {one.removeprefix(SENSOR_PREFIX): one for one in of_sensors})
    by_name, std_by_name = (
        {one.partition(".")[2]: one for one in names} for names in (parameter_names, parameter_std_names)
    )
    mapper.may_hold("parameter", "name", by_name)
    mapper.may_deviate({by_name[name]: one for name, one in std_by_name.items() if name in by_name})
    mapper.may_deviate({quantity: std for quantity, std in FLOW_STDS.items() if std in flow_names})
    mapper.mapped = tuple(name for name in MAPPED_QUANTITIES if name in flow_names)
    return mapper.layout()


_OTHERS = "*"
"""Stands for all gauges that are not listed."""


class _Mapper:
    """Makes the layout of one mapping."""

    def __init__(
        self,
        database: Any,
        mapping: Mapping[str, Any],
        gauge_names: Sequence[str],
        name: str,
    ) -> None:
        self._file = MappedDatabase(database, mapping, name)
        self._database, self._mapping, self._name = database, mapping, name
        self._gauges = {gauge: index for index, gauge in enumerate(gauge_names)}
        self._gauges |= {f"strain[{index + 1}]": index for index in range(len(gauge_names))}
        self._names = tuple(gauge_names)
        self._others: dict[str, tuple[str, dict[str, str]]] = {}
        self._deviations: dict[str, str] = {}
        self._constants: dict[str, float] = {}
        self._frames_in_use: set[str] = set()
        self.mapped: tuple[str, ...] = ()
        """The estimator takes p_inf."""
        self.readings: dict[str, str] = {}
        """Units of auxiliary sensors and of thrust by name of the estimator's input."""

    def may_hold(self, table: str, kind: str, inputs: Mapping[str, str]) -> None:
        """Let ``table`` map signals to ``inputs`` of the estimator, by names of what they are of, a ``kind``."""
        self._others[table] = kind, {**inputs, **{one: one for one in inputs.values()}}

    def may_deviate(self, inputs: Mapping[str, str]) -> None:
        """Let a standard deviation be stated next to the signal of an input, for another of ``inputs``."""
        self._deviations |= inputs

    def layout(self) -> InputLayout:
        """Return the whole input."""
        by_message: dict[tuple[str, int | None], list[tuple[int, Any]]] = {}
        for gauge, path in self._strain_table().items():
            message, signal = self._file.signal(path, f"strain, '{gauge}'")
            by_message.setdefault((message.name, selector_value(signal, self._name)), []).append(
                (self._gauge(gauge), signal)
            )
        by_message = _with_every_page(by_message)
        gauges = [index for items in by_message.values() for index, _ in items]
        for index, gauge in enumerate(self._names):
            if gauges.count(index) != 1:
                found = "none" if index not in gauges else f"{gauges.count(index)}"
                raise InputError(f"{self._name}: strain: expected one signal for gauge '{gauge}', got {found}")
        frames = tuple(self._strain_frame(*key, items) for key, items in sorted(by_message.items(), key=_by_name))
        timed = [frame.sample_time is not None for frame in frames]
        if any(timed) and not all(timed):
            missing = frames[timed.index(False)].layout.name
            raise InputError(
                f"{self._name}: sample_time: expected one for every frame of strains, got none for '{missing}'"
            )
        cycle_time = cycle_time_of(self._file, frames)
        frames = with_rates(self._file, frames, cycle_time)
        of_flow = self._flow_frames(cycle_time)
        of_strain = {frame.layout.key for frame in frames}
        for frame in of_flow:
            if frame.layout.key in of_strain:
                raise InputError(
                    f"{self._name}: {frame.flow[0].quantity}: expected a frame without strains, "
                    f"got '{frame.layout.name}', which holds some"
                )
        for table in ("sample_time", "status", "configuration", "end_to_end", "period_ms"):
            self._file.check_keys(table, "frame", self._frames_in_use)
        self._file.check_timeouts()
        self._file.check_keys("units", "signal", self._file.signals_with_unit)
        return InputLayout(
            name=self._name,
            n_gauges=len(self._names),
            strain_frames=frames,
            flow_frames=of_flow,
            cycle_time=cycle_time,
            constants=tuple(self._constants.items()),
        )

    def _strain_frame(self, message_name: str, selector: int | None, items: list[tuple[int, Any]]) -> InputFrame:
        """Return one frame of strains."""
        message = self._database.get_message_by_name(message_name)
        used = [signal for _, signal in items]
        factors = [
            self._file.factor(message, signal, units=STRAIN_UNITS, what="a unit of strain") for signal in used
        ]
        return self._frame(
            message,
            selector,
            used,
            (STRAIN, "two gauges"),
            indices=tuple(range(len(used))),
            gauges=tuple(gauge for gauge, _ in items),
            to_strain=tuple(factors),
        )

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
        tick = self._tick(message, extra, indices=indices, first=len(used))
        return InputFrame(layout=layout, tick=tick, **(measured | indices))

    def _flow_frames(self, cycle_time: float) -> tuple[InputFrame, ...]:
        """Return the frames of q_inf, air data and other inputs; quantities of one frame are decoded together.

        Those of a frame that is slower than the cycle [s] are held for two of its own periods.
        """
        by_frame: dict[tuple[str, int | None], list[tuple[str, Any]]] = {}
        others = (pair for table in self._others for pair in self._other_paths(table))
        for quantity, path in (*self._flow_paths(), *others):
            message, signal = self._file.signal(path, quantity)
            by_frame.setdefault((message.name, selector_value(signal, self._name)), []).append((quantity, signal))
        frames = [self._flow_frame(*key, items) for key, items in _with_every_page(by_frame).items()]
        timeouts = [self._file.timeout(frame, PERIODS_HELD) for frame in frames]
        stated = self._file.table("timeout_ms", optional=True)
        return tuple(
            replace(frame, timeout=timeout)
            if frame.layout.name.partition("[")[0] in stated or (frame.layout.cycle_time or 0.0) > cycle_time
            else frame
            for frame, timeout in zip(frames, timeouts, strict=True)
        )

    def _flow_paths(self) -> list[tuple[str, Any]]:
        """Return the quantities of the flow that are mapped, and "Message.Signal" of each."""
        found: dict[str, Any] = {}
        taken = {name: name in self.mapped for name in MAPPED_QUANTITIES} | {THRUST: THRUST in self.readings}
        for quantity in (*FLOW_QUANTITIES, *taken):
            table = self._file.table(quantity, optional=True)
            if not table:
                continue
            if not taken.get(quantity, True):
                raise InputError(f"{self._name}: {quantity}: expected none, the estimator does not take it")
            if quantity == ALTITUDE and set(table) != {"signal"}:
                raise InputError(f"{self._name}: {quantity}: expected 'signal', got {', '.join(table)}")
            if quantity == Q_SOURCE and "value" in table:
                self._constants[quantity] = self._source(table)
                continue
            found[quantity], deviation = self._signal_and_std(quantity, quantity, table)
            found |= deviation
        return list(found.items())

    def _source(self, table: Mapping[str, Any]) -> float:
        """Return the number of the source of the dynamic pressure that ``table`` names for the whole run."""
        name = table["value"]
        if name not in QSource.__members__ or len(table) > 1:
            known = ", ".join(QSource.__members__)
            raise InputError(f"{self._name}: {Q_SOURCE}: expected 'value' of {known}, got {str(dict(table))[:60]}")
        return float(QSource[name])

    def _other_paths(self, table: str) -> list[tuple[str, Any]]:
        """Return the inputs of the estimator that ``table`` maps, and "Message.Signal" of each."""
        found: dict[str, Any] = {}
        kind, inputs = self._others[table]
        for stated, entry in self._file.table(table, optional=True).items():
            # A sensor of a map may have a name that no input of an FMU can have.
            name = identifier(stated) if table == "sensors" and stated not in inputs else stated
            if name not in inputs:
                known = ", ".join(inputs)[:200] or f"none, the estimator has no {_ABSENT[table]}"
                raise InputError(f"{self._name}: {table}: expected a {kind} ({known}), got '{stated}'")
            quantity = inputs[name]
            if quantity in found:
                raise InputError(f"{self._name}: {table}: expected one signal for '{stated}', got 2")
            found[quantity], deviation = self._signal_and_std(f"{table}.{stated}", quantity, entry)
            found |= deviation
        return list(found.items())

    def _signal_and_std(self, where: str, quantity: str, entry: Any) -> tuple[Any, dict[str, str]]:
        """Return "Message.Signal" of an entry, and its standard deviation's by input; a number is kept."""
        if not isinstance(entry, Mapping):
            return entry, {}
        if not {"signal"} <= set(entry) <= {"signal", "std"}:
            raise InputError(
                f"{self._name}: {where}: expected 'signal' and 'std', got {', '.join(entry) or 'none'}"
            )
        if "std" not in entry:
            return entry["signal"], {}
        of_std, std = self._deviations.get(quantity), entry["std"]
        if of_std is None:
            raise InputError(f"{self._name}: {where}: std: expected none, the estimator does not take it")
        if isinstance(std, str):
            return entry["signal"], {of_std: std}
        if isinstance(std, bool) or not isinstance(std, int | float) or not 0.0 <= std < LARGEST_PARAMETER:
            raise InputError(
                f"{self._name}: {where}: std: expected 'Message.Signal' or a number from 0 on, got {str(std)[:40]}"
            )
        self._constants[of_std] = float(std)
        return entry["signal"], {}

    def _flow_frame(self, message_name: str, selector: int | None, items: list[tuple[str, Any]]) -> InputFrame:
        """Return one frame of quantities of the flow."""
        message = self._database.get_message_by_name(message_name)
        flow = []
        for index, (quantity, signal) in enumerate(items):
            factor, offset = to_si(self._file, message, signal, quantity, self.readings)
            flow.append(FlowSignal(quantity=quantity, index=index, to_si=factor, offset=offset))
        names = " and ".join(quantity for quantity, _ in items)
        used = [signal for _, signal in items]
        return self._frame(message, selector, used, (names, "both"), flow=tuple(flow))

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
            pages = len({number for one in message.signals for number in one.multiplexer_ids or ()})
            signals = [*signals, *([] if switch in signals else [switch])]
        layouts = [signal_layout(signal, with_names=signal in measured) for signal in signals]
        if (index := indices.get("configuration")) is not None:
            layouts[index] = replace(layouts[index], initial=self._file.start_value(message, signals[index]))
        layout = FrameLayout(
            name=message.name if selector is None else f"{message.name}[{selector}]",
            identifier=message.frame_id,
            length=message.length,
            signals=tuple(layouts),
            is_extended=message.is_extended_frame,
            is_fd=bool(message.is_fd),
            protection=self._file.protection(message),
            cycle_time=self._file.period(message, where, pages),
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
            found = ", ".join(names if len(names) > 1 else [str(switch.multiplexer_signal), switch.name])
            raise InputError(f"{where}: multiplexers {found} found, one allowed")
        return switch

    def _extras(self, message: Any, selector: int | None, first: int) -> tuple[list[Any], dict[str, int]]:
        """Return the signals of ``message`` that are no strains, and their indices from ``first`` on."""
        self._frames_in_use.add(message.name)
        signals: list[Any] = []
        indices: dict[str, int] = {}
        for role in ("sample_time", "status", "configuration"):
            table = self._file.table(role, optional=True)
            if message.name not in table:
                continue
            entry = table[message.name]
            path = entry.get("signal") if isinstance(entry, Mapping) else entry
            owner, signal = self._file.signal(path, f"{role}.{message.name}")
            if owner.name != message.name:
                raise InputError(
                    f"{self._name}: {role}.{message.name}: expected a signal of that frame, got '{path}'"
                )
            if signal.is_float or signal.is_signed or (role == "sample_time" and signal.length < 8):
                raise InputError(
                    f"{self._name}: {role}.{message.name}: expected an unsigned integer of 8 to 64 bits"
                )
            if signal.multiplexer_ids and selector not in signal.multiplexer_ids:
                own = "the frame itself" if selector is None else f"multiplexer value {selector}"
                raise InputError(
                    f"{self._name}: {role}.{message.name}: expected a signal of {own}, got '{path}', which comes "
                    f"with multiplexer value {', '.join(map(str, signal.multiplexer_ids))}"
                )
            indices[role] = first + len(signals)
            signals.append(signal)
        return signals, indices

    def _strain_table(self) -> dict[str, Any]:
        """Return the path of each gauge's signal; "*" stands for all others, whose signals have their names."""
        table = dict(self._file.table(STRAIN))
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
        found = [path for path in paths if path in known and fnmatchcase(path, pattern)]
        if len(found) != 1:
            what = "none" if not found else ", ".join(found)
            raise InputError(
                f"{self._name}: strain, '{_OTHERS}': expected one signal {pattern} of the name {signal_name} "
                f"for gauge '{gauge}', got {what}"
            )
        return found[0]

    def _tick(self, message: Any, extra: list[Any], indices: dict[str, int], first: int) -> float:
        """Return the unit of the sample time [s]."""
        if "sample_time" not in indices:
            return 1e-6
        signal = extra[indices["sample_time"] - first]
        tick = self._file.factor(message, signal, units=TIME_UNITS, what="a unit of time") * float(signal.scale)
        if not tick > 0.0:
            raise InputError(f"{self._name}: signal '{message.name}.{signal.name}': scale {signal.scale} found")
        return tick

    def _gauge(self, gauge: str) -> int:
        if gauge not in self._gauges:
            raise InputError(
                f"{self._name}: strain: expected a gauge of the FMU ({', '.join(self._names[:4])} .. or "
                f"strain[1] .. strain[{len(self._names)}]), got '{gauge}'"
            )
        return self._gauges[gauge]


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
