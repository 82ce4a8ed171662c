"""What a mapping states and what its entries name in a user's DBC file: gauges, quantities, units, protection.

Every error names the entry of the mapping.
"""

import re
import struct
from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any, TypedDict

from strainfmu.can.dbc_files import E2E_DATA_ID, E2E_PROFILE, SECOC_DATA_ID
from strainfmu.can.frame import Protection, error_line
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
    SignalLayout,
    is_parameter,
    is_parameter_std,
    is_temperature,
    temperature_name,
)
from strainfmu.can.profiles import signal_names
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

_OTHER_INPUTS = {
    TEMPERATURE: ("sensor", "temperature sensors"),
    "sensors": ("sensor", "auxiliary sensors"),
    "parameter": ("name", "flow parameters"),
}
"""Of a table of the mapping: what its entries are, and what an estimator lacks to which it cannot map."""

_START_VALUE = "GenSigStartValue"
"""Signal attribute of a DBC file: the raw number that a sender starts with."""

_TABLES = {
    *(STRAIN, *FLOW_QUANTITIES, *MAPPED_QUANTITIES, TEMPERATURE, "sensors", THRUST, "parameter"),
    *("units", "end_to_end", "sample_time", "status", "configuration", "cycle_time_ms", "period_ms", "timeout_ms"),
}

_OTHERS = "*"
"""Stands for all gauges that are not listed."""


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


class EstimatorInputs(TypedDict, total=False):
    """Inputs of an estimator to which a mapping may map; those that are not stated it does not have.

    Attributes
    ----------
    sensor_names : temperature sensors of the estimator; the mapping may also call them temperature[1] ..
    parameter_names : inputs ``parameter.NAME`` of the estimator for flow parameters.
    parameter_std_names : inputs ``parameter_std.NAME`` for their standard deviations.
    flow_names : other inputs of the estimator; p_inf and sigmas of navigation may be mapped to them.
    readings : unit of each input ``sensor.NAME`` of the estimator for an auxiliary sensor, and of ``thrust``.
    """

    sensor_names: Sequence[str]
    parameter_names: Sequence[str]
    parameter_std_names: Sequence[str]
    flow_names: Sequence[str]
    readings: Mapping[str, str]


class MappingEntries:
    """The entries of one mapping, and what they name.

    Parameters
    ----------
    database .. : as of :func:`~strainfmu.can.dbc_mapping.mapped_layout`.
    """

    def __init__(
        self,
        database: Any,
        mapping: Mapping[str, Any],
        gauge_names: Sequence[str],
        name: str,
        inputs: EstimatorInputs,
    ) -> None:
        self._database, self._mapping, self._name = database, mapping, name
        self._names = tuple(gauge_names)
        self._gauges = {gauge: index for index, gauge in enumerate(gauge_names)}
        self._gauges |= {f"strain[{index + 1}]": index for index in range(len(gauge_names))}
        parameters, parameter_stds = (
            {name.partition(".")[2]: name for name in names}
            for names in (inputs.get("parameter_names", ()), inputs.get("parameter_std_names", ()))
        )
        self._readings, flow_names = inputs.get("readings") or {}, inputs.get("flow_names", ())
        inputs_by_table = {
            TEMPERATURE: {
                name: temperature_name(k) for k, name in enumerate(inputs.get("sensor_names", ()), start=1)
            },
            "sensors": {name.removeprefix(SENSOR_PREFIX): name for name in self._readings if name != THRUST},
            "parameter": parameters,
        }
        self._others = {
            table: {**names, **{name: name for name in names.values()}} for table, names in inputs_by_table.items()
        }
        """By table of the mapping: the estimator's inputs by the names of its entries."""
        self._stds = {parameters[name]: std for name, std in parameter_stds.items() if name in parameters}
        """By input: the input for the standard deviation that may be stated next to its signal."""
        self._stds |= {quantity: std for quantity, std in FLOW_STDS.items() if std in flow_names}
        self._mapped = tuple(name for name in MAPPED_QUANTITIES if name in flow_names)
        self._constants: dict[str, float] = {}
        self._frames_in_use, self._with_timeout, self._signals_with_unit = set[str](), set[str](), set[str]()
        self._checked = set[str]()
        unknown = sorted(set(mapping) - _TABLES)
        if "slow_strains" in unknown:
            raise self._refusal("slow_strains", "expected no such entry: slower frames of strains are held")
        if unknown:
            raise InputError(f"{name}: expected one of {', '.join(sorted(_TABLES))}, got entry '{unknown[0]}'")

    def _refusal(self, where: str, text: str) -> InputError:
        """Return the error of the entry ``where``."""
        return InputError(f"{self._name}: {where}: {text}")

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
        (kind, absent), inputs = _OTHER_INPUTS[table], self._others[table]
        for stated, entry in self._table(table, optional=True).items():
            # A sensor of a map may have a name that no input of an FMU can have.
            name = identifier(stated) if table == "sensors" and stated not in inputs else stated
            if name not in inputs:
                known = ", ".join(inputs)[:200] or f"none, the estimator has no {absent}"
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

    # --- what they name in the DBC file --------------------------------------------------------------------------

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
            factor, offset = self._factor(message, signal, TEMPERATURE_UNITS, "a unit of temperature")
            return factor, offset
        if is_parameter(quantity) or is_parameter_std(quantity):
            return 1.0, 0.0  # the vehicle file has their unit; no mapping states it
        if quantity in self._readings:
            unit = self._readings[quantity]
            units = READING_UNITS.get(unit, {unit: 1.0})
            return self._factor(message, signal, units, f"a unit of {quantity}"), 0.0
        return self._factor(message, signal, *_UNITS_OF[quantity]), 0.0

    def _factor(
        self, message: Any, signal: Any, units: Mapping[str, Any], what: str, unless_stated: str = ""
    ) -> Any:
        """Return what ``units`` states of a signal's unit; the mapping takes precedence over the DBC file.

        A signal without a unit has the unit ``unless_stated``.
        """
        path = f"{message.name}.{signal.name}"
        self._signals_with_unit.add(path)
        unit = self._table("units", optional=True).get(path, signal.unit or unless_stated)
        if not isinstance(unit, str) or unit.strip() not in units:
            text = f"unit: expected {what} ({', '.join(units)}), got {unit!r}; state it under [units]"
            raise self._refusal(f"signal '{path}'", text)
        return units[unit.strip()]

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

    def _milliseconds(self, name: str, frame: str | None = None) -> float | None:
        """Return what an entry, or entry ``frame`` of the table ``name``, states in ms [s]; None without one."""
        where = name if frame is None else f"{name}.{frame}"
        stated = self._mapping.get(name) if frame is None else self._table(name, optional=True).get(frame)
        if stated is None:
            return None
        if isinstance(stated, bool) or not isinstance(stated, int | float) or not abs(stated) < 1e9:
            raise self._refusal(where, f"expected a number of ms, got {str(stated)[:40]}")
        return stated / 1e3
