"""Look-ups in a DBC file and the mapping next to it: signals, units, periods; every error names its entry."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from strainfmu.can.frame import Protection, error_line
from strainfmu.can.frame_layout import (
    BIG,
    FLOAT,
    FLOW_QUANTITIES,
    LITTLE,
    MAPPED_QUANTITIES,
    SIGNED,
    UNSIGNED,
    InputFrame,
    SignalLayout,
    is_parameter,
    is_parameter_std,
    is_temperature,
)
from strainfmu.can.options import checked_cycle_time
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import SAMPLE_INPUTS
from strainfmu.estimator.signal_names import STRAIN, TEMPERATURE, THRUST
from strainfmu.units import READING_UNITS, STRAIN_UNITS, TEMPERATURE_UNITS, UNITS_OF

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
_UNITS_OF = {one.name: _OF_STRAIN if one.shown in STRAIN_UNITS else _OF_UNIT[one.unit] for one in SAMPLE_INPUTS}
"""Units of a quantity of the flow, what they are, and the unit of a signal without one."""


def to_si(
    file: MappedDatabase, message: Any, signal: Any, quantity: str, readings: Mapping[str, str]
) -> tuple[float, float]:
    """Return factor and offset of a signal that holds ``quantity`` of the flow.

    ``readings`` are the units of auxiliary sensors and of thrust by name of the estimator's input.

    Raises
    ------
    InputError
        Its unit is none of the quantity.
    """
    if is_temperature(quantity):
        return TEMPERATURE_UNITS[file.unit(message, signal, tuple(TEMPERATURE_UNITS), "a unit of temperature")]
    if is_parameter(quantity) or is_parameter_std(quantity):
        return 1.0, 0.0  # the vehicle file has their unit; no mapping states it
    if quantity in readings:
        unit = readings[quantity]
        return file.factor(message, signal, READING_UNITS.get(unit, {unit: 1.0}), f"a unit of {quantity}"), 0.0
    units, what, unless_stated = _UNITS_OF[quantity]
    return file.factor(message, signal, units=units, what=what, unless_stated=unless_stated), 0.0


_NO_VALUE = re.compile(
    r"(?<![a-z])sna(?![a-z])|fail|(?<![a-z])fault|error|invalid|undefined|unavailable"
    r"|not[ _-]?(available|valid|defined)|no[ _-]?(data|value|signal)",
    re.IGNORECASE,
)
"""These words, anywhere in the name of a value, mark it as "no value"."""

_ALL_WELL = re.compile(r"(?<![a-z])no[ _-]?(fail(ure)?|fault|error)", re.IGNORECASE)


def period(message: Any, where: str) -> float | None:
    """Return the cycle time of a frame [s], None if the DBC file does not state it."""
    stated = message.cycle_time
    if not stated:
        return None
    if not isinstance(stated, int | float) or not 0.0 < stated < 1e6:
        raise InputError(f"{where}: cycle time: expected a positive number of ms, got {stated!r}")
    return float(stated) / 1e3


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


def selector_value(signal: Any, name: str) -> int | None:
    """Return the multiplexer's value with which ``signal`` is sent, None if it is always sent."""
    identifiers = signal.multiplexer_ids
    if not identifiers:
        return None
    if len(identifiers) != 1:
        raise InputError(f"{name}: signal '{signal.name}': {len(identifiers)} multiplexer values found, 1 allowed")
    return int(identifiers[0])


E2E_PROFILE, E2E_DATA_ID = "E2EProfile", "E2EDataID"
"""Message attributes of a DBC file that state the end-to-end protection; 0: none."""

SECOC_DATA_ID = "SecOCDataID"
"""Message attribute of a DBC file whose frames are authenticated; -1: not."""

START_VALUE = "GenSigStartValue"
"""Signal attribute of a DBC file: the raw number that a sender starts with."""

_TABLES = {
    STRAIN,
    *FLOW_QUANTITIES,
    *MAPPED_QUANTITIES,
    TEMPERATURE,
    "sensors",
    THRUST,
    "parameter",
    "units",
    "end_to_end",
    "sample_time",
    "status",
    "configuration",
    "cycle_time_ms",
    "period_ms",
    "timeout_ms",
}


class MappedDatabase:
    """The entries of a mapping, and what they name in a DBC file.

    Parameters
    ----------
    database : cantools' database of the DBC file.
    mapping : tables of the mapping.
    name : of the mapping, for messages.

    Raises
    ------
    InputError
        The mapping holds a table that does not exist.
    """

    def __init__(self, database: Any, mapping: Mapping[str, Any], name: str) -> None:
        self._database, self._mapping, self._name = database, mapping, name
        self.name = name
        self._with_timeout: set[str] = set()
        self._checked: set[str] = set()
        self.signals_with_unit: set[str] = set()
        unknown = sorted(set(mapping) - _TABLES)
        if "slow_strains" in unknown:
            raise InputError(f"{name}: slow_strains: expected no such entry: slower frames of strains are held")
        if unknown:
            raise InputError(f"{name}: expected one of {', '.join(sorted(_TABLES))}, got entry '{unknown[0]}'")

    def table(self, name: str, optional: bool = False) -> Mapping[str, Any]:
        """Return the table ``name``, empty if it is ``optional`` and missing."""
        table = self._mapping.get(name, {} if optional else None)
        if not isinstance(table, Mapping) or (not table and not optional):
            raise InputError(f"{self._name}: expected a table [{name}]")
        return table

    def entry(self, name: str) -> Any:
        """Return an entry of the mapping that is no table, None if it is missing."""
        return self._mapping.get(name)

    def milliseconds(self, name: str, frame: str | None = None) -> float | None:
        """Return what an entry, or entry ``frame`` of the table ``name``, states in ms [s]; None without one."""
        where = name if frame is None else f"{name}.{frame}"
        stated = self.entry(name) if frame is None else self.table(name, optional=True).get(frame)
        if stated is None:
            return None
        if isinstance(stated, bool) or not isinstance(stated, int | float) or not abs(stated) < 1e9:
            raise InputError(f"{self._name}: {where}: expected a number of ms, got {str(stated)[:40]}")
        return stated / 1e3

    def period(self, message: Any, where: str, pages: int = 1) -> float | None:
        """Return the period of a frame [s] by the mapping, otherwise by the DBC file; None if neither has it.

        A multiplexed message has ``pages``, one after the other, each in a period of its own.
        """
        stated = self.milliseconds("period_ms", message.name)
        if stated is None:
            of_file = period(message, where)
            return None if of_file is None else pages * of_file
        return pages * checked_cycle_time(stated, f"{self._name}: period_ms.{message.name}")

    def timeout(self, frame: InputFrame, periods: float) -> float | None:
        """Return for how long the values of a frame are used [s], ``periods`` of its own where none is stated.

        None if neither this nor its period is stated.
        """
        message = frame.layout.name.partition("[")[0]
        self._with_timeout.add(message)
        stated, own = self.milliseconds("timeout_ms", message), frame.layout.cycle_time
        if stated is None:
            return None if own is None else periods * own
        if not stated > 0.0 or stated < (own or 0.0):
            least = "a positive number" if own is None else f"at least its period of {1e3 * own:g}"
            raise InputError(f"{self._name}: timeout_ms.{message}: expected {least}, got {1e3 * stated:g}")
        return stated

    def check_timeouts(self) -> None:
        """Refuse a time-out of a frame that is not held."""
        held = "frame of q_inf, navigation, temperatures, sensors, thrust, parameters or slow strains"
        self.check_keys("timeout_ms", held, self._with_timeout)

    def check_keys(self, table: str, kind: str, in_use: Iterable[str]) -> None:
        """Refuse an entry for a frame or signal that is not in use: it would be ignored silently."""
        unknown = sorted(set(self.table(table, optional=True)) - set(in_use))
        if unknown:
            known = ", ".join(sorted(in_use))[:200]
            raise InputError(f"{self._name}: {table}: expected a {kind} in use ({known}), got '{unknown[0]}'")

    def signal(self, path: Any, where: str) -> tuple[Any, Any]:
        """Return the message and the signal of "Message.Signal"."""
        message_name, dot, signal_name = path.partition(".") if isinstance(path, str) else ("", "", "")
        if not dot:
            raise InputError(f"{self._name}: {where}: expected 'Message.Signal', got {path!r}")
        message = self._message(message_name, where)
        signals = [signal for signal in message.signals if signal.name == signal_name]
        if len(signals) > 1:
            raise InputError(
                f"{self._name}: {where}: expected one signal '{path}' in the DBC file, got {len(signals)}"
            )
        if not signals:
            known = ", ".join(signal.name for signal in message.signals)[:200]
            raise InputError(
                f"{self._name}: {where}: no signal '{signal_name}' in frame '{message_name}': {known or 'none'}"
            )
        return message, signals[0]

    def _message(self, name: str, where: str) -> Any:
        """Return the only frame of that name; no other frame may have its identifier."""
        known = self._database.messages
        found = [message for message in known if message.name == name]
        if not found:
            raise InputError(f"{self._name}: {where}: no frame '{name}' in the DBC file")
        message = found[0]
        if len(found) > 1:
            raise InputError(
                f"{self._name}: {where}: expected one frame '{name}' in the DBC file, got {len(found)}"
            )
        for other in known:
            same = (other.frame_id, other.is_extended_frame) == (message.frame_id, message.is_extended_frame)
            if same and other is not message:
                raise InputError(
                    f"{self._name}: {where}: identifier 0x{message.frame_id:X} belongs to both '{name}' and "
                    f"'{other.name}' in the DBC file"
                )
        if name not in self._checked:
            try:
                message.refresh(strict=True)
            except Exception as error:  # cantools raises exceptions of several types
                raise InputError(f"{self._name}: {where}: in the DBC file: {error_line(error)[:300]}") from error
            self._checked.add(name)
        return message

    def factor(
        self, message: Any, signal: Any, units: Mapping[str, float], what: str, unless_stated: str = ""
    ) -> float:
        """Return the factor to SI of a signal's unit, see :meth:`unit`."""
        return units[self.unit(message, signal, tuple(units), what, unless_stated)]

    def unit(self, message: Any, signal: Any, units: Sequence[str], what: str, unless_stated: str = "") -> str:
        """Return a signal's unit, one of ``units``; the mapping takes precedence over the DBC file.

        A signal without a unit has the unit ``unless_stated``.
        """
        path = f"{message.name}.{signal.name}"
        self.signals_with_unit.add(path)
        unit = self.table("units", optional=True).get(path, signal.unit or unless_stated)
        if not isinstance(unit, str) or unit.strip() not in units:
            raise InputError(
                f"{self._name}: signal '{path}': unit: expected {what} ({', '.join(units)}), got {unit!r}; "
                "state it under [units]"
            )
        return unit.strip()

    def protection(self, message: Any) -> Protection | None:
        """Return the end-to-end protection stated by the mapping, otherwise by the DBC file's attributes."""
        where = f"{self._name}: end_to_end.{message.name}"
        if message.dbc is not None and SECOC_DATA_ID in message.dbc.attributes:
            raise InputError(
                f"{self._name}: frame '{message.name}' is authenticated ({SECOC_DATA_ID}), which a mapping cannot "
                "state; use --profile fd64-sec"
            )
        stated = self.table("end_to_end", optional=True).get(message.name)
        if stated is None:
            attributes = message.dbc.attributes if message.dbc is not None else {}
            stated = {
                "profile": attributes[E2E_PROFILE].value if E2E_PROFILE in attributes else 0,
                "data_id": attributes[E2E_DATA_ID].value if E2E_DATA_ID in attributes else 0,
            }
        elif not isinstance(stated, Mapping) or set(stated) != {"profile", "data_id"}:
            raise InputError(f"{where}: expected 'profile' and 'data_id'")
        profile, data_id = stated["profile"], stated["data_id"]
        if profile in (0, "") and profile is not False:
            return None
        min_length = {1: 2, 5: 3}.get(profile) if isinstance(profile, int) else None
        if min_length is None or isinstance(profile, bool):
            raise InputError(f"{where}: profile {profile!r} found, 1 or 5 allowed")
        if not isinstance(data_id, int) or isinstance(data_id, bool) or not 0 <= data_id <= 0xFFFF:
            raise InputError(f"{where}: data_id {data_id!r} found, 0 to 65535 allowed")
        if message.length < min_length:
            raise InputError(
                f"{where}: a frame of {message.length} bytes found, CRC and counter need {min_length}"
            )
        return Protection(profile, data_id)

    def start_value(self, message: Any, signal: Any) -> int:
        """Return the required number of a configuration: the signal's start value, else the file's default."""
        value = signal.raw_initial
        if value is None:
            definition = self._database.dbc.attribute_definitions.get(START_VALUE)
            value = None if definition is None else definition.default_value
        largest = (1 << signal.length) - 1
        if not isinstance(value, int | float) or not 0 <= value <= largest or value != int(value):
            raise InputError(
                f"{self._name}: configuration.{message.name}: start value ({START_VALUE}) of '{signal.name}': "
                f"expected a whole number of 0 to {largest}, got {'none' if value is None else value}"
            )
        return int(value)


PERIODS_HELD = 2.0
"""Own periods for which a slow signal is held where the mapping states no time-out."""

_MUCH = 1.5
"""Ratio of two periods from which on they are not the same."""


def cycle_time_of(file: MappedDatabase, frames: Sequence[InputFrame]) -> float:
    """Return the period of a cycle [s]: the mapping's, otherwise the period of the fastest frames of strains.

    Raises
    ------
    InputError
        Neither states one.
    """
    stated = file.milliseconds("cycle_time_ms")
    if stated is not None:
        return checked_cycle_time(stated, f"{file.name}: cycle_time_ms")
    periods = [frame.layout.cycle_time for frame in frames]
    known = [period for period in periods if period is not None]
    if not known or len(known) < len(periods):
        raise InputError(
            f"{file.name}: expected cycle_time_ms: the DBC file gives the frames of strains no common one"
        )
    if len(set(known)) > 1 and max(known) <= _MUCH * min(known):
        raise InputError(
            f"{file.name}: expected cycle_time_ms: the DBC file gives the frames of strains no common one"
        )
    return checked_cycle_time(min(known), f"{file.name}: cycle time of the DBC file")


def with_rates(file: MappedDatabase, frames: Sequence[InputFrame], cycle_time: float) -> tuple[InputFrame, ...]:
    """Return the ``frames`` of strains, those held that are slower than the cycle [s], with their time-outs.

    Raises
    ------
    InputError
        A period does not fit to the cycle, or an entry of the mapping would not be used.
    """
    periods = [frame.layout.cycle_time or cycle_time for frame in frames]
    slow = [frame for frame, period in zip(frames, periods, strict=True) if period > _MUCH * cycle_time]
    if len(slow) == len(frames):
        raise InputError(
            f"{file.name}: cycle_time_ms: expected the period of a frame of strains, got {1e3 * cycle_time:g}; "
            f"the fastest has {_ms(min(slow, key=lambda frame: frame.layout.cycle_time or 0.0))}"
        )
    fast = [frame for frame in frames if frame not in slow]
    for frame in slow:
        _check_same_clock(file, frame, fast[0])
    for frame in fast:
        if frame.layout.cycle_time is not None and frame.layout.cycle_time * _MUCH < cycle_time:
            raise InputError(
                f"{file.name}: frame '{frame.layout.name}': a period of {_ms(frame)} found, it would come more "
                f"than once in a cycle of {1e3 * cycle_time:g} ms; state cycle_time_ms = {_ms(frame)[:-3]}, or "
                "its true period under [period_ms]"
            )
    held = {frame.layout.name for frame in slow}
    return tuple(
        replace(frame, hold=file.timeout(frame, PERIODS_HELD)) if frame.layout.name in held else frame
        for frame in frames
    )


def _check_same_clock(file: MappedDatabase, slow: InputFrame, fast: InputFrame) -> None:
    """Refuse a held frame whose sample time cannot be compared with the others' sample time."""
    if slow.sample_time is None or fast.sample_time is None:
        return
    lengths = [frame.layout.signals[frame.sample_time or 0].length for frame in (slow, fast)]
    if slow.tick != fast.tick or lengths[0] != lengths[1]:
        raise InputError(
            f"{file.name}: sample_time.{slow.layout.name}: expected unit and length of '{fast.layout.name}', "
            f"{fast.tick:g} s and {lengths[1]} bits, got {slow.tick:g} s and {lengths[0]} bits"
        )


def _ms(frame: InputFrame) -> str:
    """Return the period of a frame in words."""
    return f"{1e3 * (frame.layout.cycle_time or 0.0):g} ms"
