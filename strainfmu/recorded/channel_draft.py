"""A first channels.toml of a recording: the gauges of a map, each with the channel whose name is nearest."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.files import write_bytes_atomically
from strainfmu.interface.parameter_variables import PREFIX
from strainfmu.interface.sensor_variables import PREFIX as SENSOR_PREFIX
from strainfmu.interface.sensor_variables import THRUST
from strainfmu.recorded.channels.channel_entries import SIGNAL_UNITS
from strainfmu.recorded.channels.likely_channels import likely_pairs
from strainfmu.recorded.columns.column_names import (
    OTHER_NAMES,
    QUANTITIES,
    is_signal,
    last_part,
    quantity_of,
    some_of,
    strain_number,
)
from strainfmu.recorded.columns.temperature_columns import is_temperature, temperature_quantities
from strainfmu.recorded.estimates.block_estimates import BlockEstimator
from strainfmu.recorded.estimates.estimator_files import open_block_estimator
from strainfmu.recorded.formats.channel_file import ChannelFile, Reading
from strainfmu.recorded.formats.name_match import plain_name
from strainfmu.recorded.formats.registry import open_channels
from strainfmu.units import STRAIN_UNITS, TIME_UNITS

BY_NAME, BY_ORDER = "by name", "by order"


@dataclass(frozen=True, kw_only=True)
class ChannelDraft:
    """The channels that a recording most likely has for the gauges of a map.

    Attributes
    ----------
    source, recording : the map or FMU, and the file of the recording.
    gauges : all strain gauges of the map.
    channel : channel of each gauge that has one.
    reason : :data:`BY_NAME` or :data:`BY_ORDER`, of each of these.
    flow : channel of each quantity of the flow that has another name in the recording.
    time : channel of the time, None where it is found without an entry.
    has_time : whether the recording has times.
    units : unit of each channel that states one.
    free : channels that are in no entry, those that might be gauges first.
    """

    source: Path
    recording: Path
    gauges: tuple[str, ...]
    channel: Mapping[str, str]
    reason: Mapping[str, str]
    flow: Mapping[str, str]
    time: str | None
    has_time: bool
    units: Mapping[str, str]
    free: tuple[str, ...]

    @property
    def missing(self) -> tuple[str, ...]:
        """Gauges without a channel."""
        return tuple(gauge for gauge in self.gauges if gauge not in self.channel)

    def summary(self) -> str:
        """Return how many gauges have a channel, and how it was found."""
        counts = [f"{list(self.reason.values()).count(how)} {how}" for how in (BY_NAME, BY_ORDER)]
        return f"{len(self.channel)} of {len(self.gauges)} gauges have a channel: {', '.join(counts)}"

    def remarks(self) -> list[str]:
        """Return what the file lacks: gauges without a channel, channels without an entry or a unit."""
        without_unit = [name for name in self.channel.values() if self._unit(name) is None]
        found = {
            "without a channel": self.missing,
            "without an entry, not read": self.free,
            "without a unit, which [defaults] of the file must state": tuple(without_unit),
        }
        return [f"{what}: {some_of(names)}" for what, names in found.items() if names]

    def text(self) -> str:
        """Return the file, with a comment on what to check."""
        head = (_printable(line) for line in self._head())
        return "\n".join((*head, *self._gauges(), *self._flow(), ""))

    def _head(self) -> Iterator[str]:
        yield f"# Channels of {self.recording.name} for the gauges of {self.source.name}, proposed by name."
        yield "# Check every entry, correct it, and then run:"
        yield f"#   strainfmu estimate {self.source} {self.recording} -o loads.csv --channels THIS_FILE"
        yield "# The file of a ground test names it under [readings]: channels."
        yield "# All entries: docs/howto/recorder_channels.md"
        yield ""
        if self.time is not None:
            yield from ("[time]", f"channel = {_quoted(self.time)}", "")
        elif not self.has_time:
            yield from ("# No channel of time was found: name it, or state the rate.", "[time]")
            yield from ('# channel = "NAME"', "# rate_hz = 1000.0", "")
        yield "[defaults]"
        units = {self._unit(one) for one in self.channel.values()}
        if None in units or not units:
            yield '# unit = "um/m"             # the recording states none for some channels: state it here'
        yield '# bridge = "quarter"'
        if any(unit not in STRAIN_UNITS for unit in units if unit is not None):
            yield "# gauge_factor = 2.0        # needed for mV/V and V"
        yield ""

    def _gauges(self) -> Iterator[str]:
        for gauge in self.gauges:
            name = self.channel.get(gauge)
            if name is None:
                yield from (
                    "# No channel was found for this gauge; without an entry it is left out.",
                    "# [[channel]]",
                )
                yield from ('# name = "NAME"', f"# gauge = {_quoted(gauge)}", "")
                continue
            by_order = self.reason[gauge] == BY_ORDER
            yield "[[channel]]" + ("           # by the order of the channels, not by name" if by_order else "")
            yield from (f"name = {_quoted(name)}", f"gauge = {_quoted(gauge)}")
            unit = self._unit(name)
            if unit in SIGNAL_UNITS:
                yield f"unit = {_quoted(unit)}"
            elif unit is not None:
                yield f"# unit = {_quoted(unit)}      # not a unit of strain or bridge signals"
            yield ""

    def _unit(self, name: str) -> str | None:
        """Return the unit of a channel; ``strain[i]`` without one is in m/m, as everywhere."""
        return self.units.get(name) or (None if strain_number(name) is None else "m/m")

    def _flow(self) -> Iterator[str]:
        for quantity, name in self.flow.items():
            yield from ("[[flow]]", f"name = {_quoted(name)}", f"quantity = {_quoted(quantity)}")
            if name in self.units:
                yield f"unit = {_quoted(self.units[name])}"
            yield ""
        if DYNAMIC_PRESSURE not in self.flow:
            yield "# Quantities of the flow with names of the recorder's own need an entry each:"
            yield from ("# [[flow]]", '# name = "NAME"', '# quantity = "dynamic_pressure"', "")
        if self.free:
            shown = _printable(", ".join(self.free[:20]))
            yield f"# Channels without an entry: {shown}" + (" .." if len(self.free) > 20 else "")


def write_draft(source: Path, recording: Path, output: Path) -> ChannelDraft:
    """Write the channels.toml of a recording for the gauges of a map or an FMU, to be corrected by the user.

    Raises
    ------
    InputError
        A file is missing, damaged or of another kind, or there is an output already.
    StrainfmuError
        The library of the recording's format is not installed.
    """
    if output.exists():
        raise InputError(
            f"{output}: expected a new file, got one that is there and may have been corrected by hand; "
            "delete it, or state another name by -o"
        )
    draft = channel_draft(source, recording)
    write_bytes_atomically(output, draft.text().replace("THIS_FILE", str(output)).encode())
    return draft


def channel_draft(source: Path, recording: Path) -> ChannelDraft:
    """Return the channels that ``recording`` most likely has for ``source``; errors as :func:`write_draft`.

    A gauge has the channel of its own name or number ``strain[i]``, else the nearest name. If no name is near and
    as many channels are left as gauges, they are taken in their order.
    """
    with open_block_estimator(source) as estimator:
        gauges, quantities = estimator.gauge_names, _quantities(estimator)
    with open_channels(recording, _reading(gauges)) as file:
        names = file.names
    with open_channels(recording, _reading(names)) as file:
        units = {name: unit for name, unit in file.units.items() if unit}
        time, has_time = _time(file, units)
    others = [name for name in names if name != time and not _is_other(name, quantities)]
    channel = _named(gauges, others)
    reason = dict.fromkeys(channel, BY_NAME)
    flow = _flow_pairs(quantities, [name for name in others if name not in channel.values()])
    free = [name for name in others if name not in {*channel.values(), *flow.values()}]
    left = [name for name in free if units.get(name, "um/m") in SIGNAL_UNITS]
    missing = [gauge for gauge in gauges if gauge not in channel]
    if len(left) == len(missing):
        channel |= zip(missing, left, strict=True)
        reason |= dict.fromkeys(missing, BY_ORDER)
        free, left = [name for name in free if name not in left], []
    return ChannelDraft(
        source=source,
        recording=recording,
        gauges=gauges,
        channel=channel,
        reason=reason,
        flow=flow,
        time=time,
        has_time=has_time,
        units=units,
        free=(*left, *(name for name in free if name not in left)),
    )


def _quantities(estimator: BlockEstimator) -> tuple[str, ...]:
    """Return all that a channel of the flow may be, as channels.toml names it."""
    return (
        *QUANTITIES,
        *temperature_quantities(estimator.sensor_names),
        *(f"{PREFIX}{name}" for name in estimator.parameter_names),
        *(name if name == THRUST else f"{SENSOR_PREFIX}{name}" for name in estimator.readings),
    )


def _reading(names: Sequence[str]) -> Reading:
    known = {plain_name(name) for name in names}
    return Reading(is_known=lambda name: plain_name(name) in known)


def _time(file: ChannelFile, units: Mapping[str, str]) -> tuple[str | None, bool]:
    """Return the channel of time if it needs an entry, and whether there are times at all."""
    held = file.time_channels()
    has_clocks = bool(file.names) and file.clock(file.names[0]) is not None
    if len(held) == 1 or has_clocks:
        return None, True
    by_unit = [name for name in file.names if units.get(name) in TIME_UNITS]
    found = next(iter([*held, *by_unit]), None)
    return found, found is not None


def _is_other(name: str, quantities: Sequence[str]) -> bool:
    """Return whether a channel needs no entry: a time, an output of an FMU, or a quantity by its own name."""
    ends = {one.rpartition(".")[2] for one in quantities}
    return (
        plain_name(last_part(name)) in ("time", "t", "timestamps", "time_s")
        or is_signal(name)
        or quantity_of(name, ()) in ends
        or is_temperature(name)
    )


def _named(gauges: Sequence[str], names: Sequence[str]) -> dict[str, str]:
    """Return the channel of each gauge by its own name, by its number, or by the nearest name."""
    plain = {plain_name(last_part(name)): name for name in reversed(names)}
    numbers = {number: name for name in reversed(names) if (number := strain_number(name)) is not None}
    found = {gauge: plain[plain_name(gauge)] for gauge in gauges if plain_name(gauge) in plain}
    for number, gauge in enumerate(gauges, start=1):
        if gauge not in found and number in numbers and numbers[number] not in found.values():
            found[gauge] = numbers[number]
    left = [name for name in names if name not in found.values() and strain_number(name) is None]
    near = likely_pairs([gauge for gauge in gauges if gauge not in found], left)
    return {gauge: (found | near)[gauge] for gauge in gauges if gauge in found or gauge in near}


def _flow_pairs(quantities: Sequence[str], names: Sequence[str]) -> dict[str, str]:
    """Return the channel of each quantity of the flow that has another name in the recording."""
    found = {quantity: name for name in names if (quantity := OTHER_NAMES.get(_letters(name), "")) in quantities}
    left = [name for name in names if name not in found.values()]
    return found | likely_pairs([one for one in quantities if one not in found and not one.endswith("_std")], left)


def _letters(name: str) -> str:
    return "".join(one for one in last_part(name).casefold() if one.isascii() and one.isalnum())


def _printable(text: str) -> str:
    """Return a text that may stand in a comment, which has no control characters."""
    return "".join(one if one.isprintable() else " " for one in text)


def _quoted(text: str) -> str:
    """Return a basic string of TOML."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
