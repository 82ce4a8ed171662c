"""Look-ups in a DBC file and the mapping next to it; every error names the entry of the mapping."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from strainfmu.can.settings import checked_cycle_time
from strainfmu.can.wire.crc import Protection
from strainfmu.can.wire.dbc_signals import period
from strainfmu.can.wire.frame_layout import FLOW_QUANTITIES, MAPPED_QUANTITIES, InputFrame
from strainfmu.can.wire.libraries import error_line
from strainfmu.errors import InputError
from strainfmu.estimator.signal_names import STRAIN, TEMPERATURE, THRUST

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
    "slow_strains",
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

    def period(self, message: Any, where: str) -> float | None:
        """Return the period of a frame [s] by the mapping, otherwise by the DBC file; None if neither has it."""
        stated = self.milliseconds("period_ms", message.name)
        if stated is None:
            return period(message, where)
        return checked_cycle_time(stated, f"{self._name}: period_ms.{message.name}")

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
