"""The frames that the bridge reads, from a user's DBC file and a mapping of its signals to gauges.

The mapping is TOML; docs/reference/can.md describes it. Our signal plan decodes the frames; tests compare it with
cantools. ``mapping_entries`` reads the entries.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar, Unpack

from strainfmu.can.frame import FD_LENGTHS
from strainfmu.can.frame_layout import FlowSignal, FrameLayout, InputFrame, InputLayout
from strainfmu.can.mapping_entries import EstimatorInputs, MappingEntries, signal_layout
from strainfmu.can.options import checked_cycle_time
from strainfmu.can.signals import checked_signal
from strainfmu.errors import InputError
from strainfmu.estimator.signal_names import STRAIN
from strainfmu.units import STRAIN_UNITS

_Key = TypeVar("_Key")
"""What a signal is of: the number of a gauge, or the name of a quantity."""

_PERIODS_HELD = 2.0
"""Own periods for which a slow signal is held where the mapping states no time-out."""

_MUCH = 1.5
"""Ratio of two periods from which on they are not the same."""


def mapped_layout(
    database: Any,
    mapping: Mapping[str, Any],
    gauge_names: Sequence[str],
    name: str,
    **inputs: Unpack[EstimatorInputs],
) -> InputLayout:
    """Return the frames that ``mapping`` names in ``database``.

    Parameters
    ----------
    database : cantools' database of the DBC file.
    mapping : tables of the mapping.
    gauge_names : gauges in the order of the FMU's strains; the mapping may also call them strain[1], strain[2] ...
    name : of the mapping, for messages.
    inputs : of the estimator that takes them.
    """
    return _Mapper(database, mapping, gauge_names, name, inputs).layout()


class _Mapper(MappingEntries):
    """Makes the layout of one mapping."""

    def layout(self) -> InputLayout:
        """Return the whole input."""
        by_message = self._by_frame(
            (self._gauge(gauge), path, f"strain, '{gauge}'") for gauge, path in self._strain_table().items()
        )
        gauges = [index for items in by_message.values() for index, _ in items]
        for index, gauge in enumerate(self._names):
            if gauges.count(index) != 1:
                number = "none" if index not in gauges else f"{gauges.count(index)}"
                raise self._refusal(STRAIN, f"expected one signal for gauge '{gauge}', got {number}")
        places = sorted(by_message, key=lambda place: (place[0], -1 if place[1] is None else place[1]))
        frames = tuple(self._strain_frame(*place, by_message[place]) for place in places)
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

    # --- frames --------------------------------------------------------------------------------------------------

    def _by_frame(
        self, paths: Iterable[tuple[_Key, Any, str]]
    ) -> dict[tuple[str, int | None], list[tuple[_Key, Any]]]:
        """Return signals by frame and multiplexer value; ``paths`` are what each is of, its path, its entry.

        Signals that come with every value are in all frames of their message; they are read from the first in use,
        once a cycle.
        """
        by_value: dict[tuple[str, int | None], list[tuple[_Key, Any]]] = {}
        for key, path, where in paths:
            message, signal = self._signal(path, where)
            by_value.setdefault((message.name, self._selector_value(signal)), []).append((key, signal))
        by_frame: dict[tuple[str, int | None], list[tuple[_Key, Any]]] = {}
        for (name, value), items in by_value.items():
            values = [page for message, page in by_value if message == name and page is not None]
            first = min(values, default=None) if value is None else value
            by_frame.setdefault((name, first), []).extend(items)
        return by_frame

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
        other_paths = (pair for table in self._others for pair in self._other_paths(table))
        by_frame = self._by_frame((name, path, name) for name, path in (*self._flow_paths(), *other_paths))
        frames = [self._flow_frame(*key, items) for key, items in by_frame.items()]
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

    # --- periods -------------------------------------------------------------------------------------------------

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
