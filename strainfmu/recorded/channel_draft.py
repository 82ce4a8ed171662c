"""A first channels.toml of a recording: the channel that each gauge of a map most likely has, with the evidence.

Evidence is the name, else the roll angle and the station number of the gauge among the numbers of a name, else the
order of as many channels as gauges, which is a guess. A quantity of the flow needs a name and a unit that fit.
"""

import json
import re
from collections.abc import Collection, Mapping, Sequence, Set
from dataclasses import dataclass
from difflib import SequenceMatcher
from functools import lru_cache
from itertools import permutations, product
from math import prod
from os import PathLike
from pathlib import Path

import numpy as np

from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.files import write_bytes_atomically
from strainfmu.interface.parameter_variables import PREFIX
from strainfmu.interface.sensor_variables import PREFIX as SENSOR_PREFIX
from strainfmu.interface.sensor_variables import THRUST
from strainfmu.recorded.channel_map import SIGNAL_UNITS
from strainfmu.recorded.estimators import open_estimator
from strainfmu.recorded.formats import open_table
from strainfmu.recorded.names import (
    OTHER_NAMES,
    QUANTITIES,
    is_signal,
    is_temperature,
    last_part,
    plain_name,
    scale_of,
    some_of,
    strain_number,
    time_rank,
    time_unit,
)
from strainfmu.recorded.table import Reading, Table
from strainfmu.units import STRAIN_UNITS

BY_NAME, BY_PLACE, BY_ORDER = "by name", "by roll angle and station number", "by order, a guess"

MIN_SIMILARITY = 0.6
"""Similarity below which two names are no match."""

MIN_LIKENESS, ABBREVIATED = 0.5, 0.8
"""Likeness of words below which names are not similar, whatever their numbers; of a word and its abbreviation."""

MIN_COVERED = 0.8
"""Part of the gauges of a kind that must have a channel by roll angle and station number."""

_WORDS_OR_NUMBERS = re.compile(r"[^\W\d_]+|[0-9]+")

_KINDS = {"axial": ("a", "l", "x"), "hoop": ("h", "c", "t", "q", "u")}
"""First letters of words for the direction of a gauge: along the axis, around it."""

_GENERAL = frozenset(
    {"ai", "ain", "ch", "chan", "channel", "analog", "adc", "card", "amp", "cal", "axis", "ue", "um"}
)
"""Words that begin alike and say nothing of it."""


@dataclass(frozen=True, kw_only=True)
class ChannelDraft:
    """The channels that a recording most likely has for the gauges of a map.

    Attributes
    ----------
    source, recording : the map or FMU, and the file of the recording.
    gauges : all strain gauges of the map.
    channel : channel of each gauge that has one.
    reason : :data:`BY_NAME`, :data:`BY_PLACE` or :data:`BY_ORDER`, of each of these.
    flow : channel of each quantity of the flow that has another name in the recording.
    guesses : channels that may be a quantity of the flow, by their unit alone.
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
    guesses: Mapping[str, str]
    time: str | None
    has_time: bool
    units: Mapping[str, str]
    free: tuple[str, ...]

    def summary(self) -> str:
        """Return how many gauges have a channel, and on what evidence."""
        reasons = list(self.reason.values())
        counts = [f"{reasons.count(how)} {how}" for how in (BY_NAME, BY_PLACE, BY_ORDER)]
        return f"{len(self.channel)} of {len(self.gauges)} gauges have a channel: {', '.join(counts)}"

    def remarks(self) -> list[str]:
        """Return what the file lacks: gauges without a channel, channels without an entry or a unit."""
        lacks = {
            "without a channel": [gauge for gauge in self.gauges if gauge not in self.channel],
            "without an entry, not read": self.free,
            "without a unit, which [defaults] of the file must state": [
                name for name in self.channel.values() if self._unit(name) is None
            ],
        }
        return [f"{what}: {some_of(names)}" for what, names in lacks.items() if names]

    def text(self) -> str:
        """Return the file, with a comment on what to check."""
        head = [
            f"# Channels of {self.recording.name} for the gauges of {self.source.name}: a proposal.",
            "# Check every entry, guesses first, correct it, and then run:",
            f"#   strainfmu estimate {self.source} {self.recording} -o loads.csv --channels THIS_FILE",
            "# The file of a ground test names it under [readings]: channels.",
            "# All entries: docs/howto/recorder_channels.md",
        ]
        lines = [*map(_printable, head), ""]
        if self.time is not None:
            lines += _entry("[time]", {"channel": self.time})
        elif not self.has_time:
            lines += ["# No channel of time was found: name it, or state the rate.", "[time]"]
            lines += ['# channel = "NAME"', "# rate_hz = 1000.0", ""]
        units = {self._unit(name) for name in self.channel.values()}
        lines.append("[defaults]")
        if None in units or not units:
            lines.append(
                '# unit = "um/m"             # the recording states none for some channels: state it here'
            )
        lines.append('# bridge = "quarter"')
        if units - {None, *STRAIN_UNITS}:
            lines.append("# gauge_factor = 2.0        # needed for mV/V and V")
        lines.append("")
        for gauge in self.gauges:
            lines += self._gauge(gauge, self.channel.get(gauge))
        for quantity, name in self.flow.items():
            unit = {"unit": self.units[name]} if name in self.units else {}
            lines += _entry("[[flow]]", {"name": name, "quantity": quantity, **unit})
        for quantity, name in self.guesses.items():
            lines.append("# A guess, by the unit alone: remove the marks if it is so.")
            lines += _entry("[[flow]]", {"name": name, "quantity": quantity, "unit": self.units[name]}, mark="# ")
        if DYNAMIC_PRESSURE not in self.flow:
            lines.append("# Quantities of the flow with names of the recorder's own need an entry each:")
            lines += _entry("[[flow]]", {"name": "NAME", "quantity": DYNAMIC_PRESSURE}, mark="# ")
        if self.free:
            more = " .." if len(self.free) > 20 else ""
            lines.append(f"# Channels without an entry: {_printable(', '.join(self.free[:20]))}{more}")
        return "\n".join([*lines, ""])

    def _gauge(self, gauge: str, name: str | None) -> list[str]:
        """Return the entry of a gauge."""
        if name is None:
            comment = "# No channel was found for this gauge; without an entry it is left out."
            return [comment, *_entry("[[channel]]", {"name": "NAME", "gauge": gauge}, mark="# ")]
        reason, unit = self.reason[gauge], self._unit(name)
        head = "[[channel]]" if reason == BY_NAME else f"[[channel]]           # {reason}"
        entries = {"name": name, "gauge": gauge}
        if unit is None or unit in SIGNAL_UNITS:
            return _entry(head, entries | ({"unit": unit} if unit else {}))
        comment = f"# unit = {_quoted(unit)}      # not a unit of strain or bridge signals"
        return [*_entry(head, entries)[:-1], comment, ""]

    def _unit(self, name: str) -> str | None:
        """Return the unit of a channel; ``strain[i]`` without one is in m/m, as everywhere."""
        return self.units.get(name) or (None if strain_number(name) is None else "m/m")


def _entry(head: str, entries: Mapping[str, str], mark: str = "") -> list[str]:
    """Return the lines of a table of TOML, each behind ``mark``."""
    return [f"{mark}{head}", *(f"{mark}{key} = {_quoted(text)}" for key, text in entries.items()), ""]


def channels(
    source: str | PathLike[str], data: str | PathLike[str], output: str | PathLike[str] = "channels.toml"
) -> ChannelDraft:
    """Propose which channel of a recording is which gauge, in a file to check and correct.

    Each gauge of the map gets the channel of its name or number, or the channel with the nearest name. Units are
    taken from the recording. A file that is there is never overwritten.

    On the command line::

        strainfmu channels map.h5 recorder.tdms -o channels.toml
        strainfmu estimate map.h5 recorder.tdms -o loads.csv --channels channels.toml

    Parameters
    ----------
    source : inverse map (map.h5), or estimator FMU.
    data : CSV, HDF5, MF4, TDMS, MAT or Parquet.
    output : channel file to write (TOML).

    Raises
    ------
    InputError
        A file is missing, damaged or of another kind, or there is an output already.
    StrainfmuError
        The library of the recording's format is not installed.
    """
    output = Path(output)
    if output.exists():
        raise InputError(
            f"{output}: expected a new file, got one that is there and may have been corrected by hand; "
            "delete it, or state another name by -o"
        )
    draft = channel_draft(Path(source), Path(data))
    write_bytes_atomically(output, draft.text().replace("THIS_FILE", str(output)).encode())
    return draft


def channel_draft(source: Path, recording: Path) -> ChannelDraft:
    """Return the channels that ``recording`` most likely has for ``source``; errors as :func:`channels`."""
    with open_estimator(source) as estimator:
        gauges, readings = estimator.wanted.gauge_names, estimator.wanted.readings
        places = _places(estimator.inverse_map, gauges)
        quantities = (
            *QUANTITIES,
            *estimator.wanted.temperatures,
            *(f"{PREFIX}{name}" for name in estimator.parameters),
            *(name if name == THRUST else f"{SENSOR_PREFIX}{name}" for name in readings),
        )
    table = _table(recording, {plain_name(name) for name in gauges})
    table = _table(recording, {plain_name(column.name) for column in table.columns})
    time, has_time = _time(table)
    units = {column.full: column.unit for column in table.columns if column.unit}
    ends = {quantity.rpartition(".")[2] for quantity in quantities}
    # A time, an output of an FMU, or a quantity by its own name needs no entry.
    names = [
        column.full
        for column in table.columns
        if column.full != time
        and time_rank(column.name) is None
        and not is_signal(column.name)
        and last_part(column.name) not in ends
        and not is_temperature(column.name)
    ]
    channel = _named(gauges, names)
    reason = dict.fromkeys(channel, BY_NAME)
    flow, guesses = _flow_channels(quantities, [name for name in names if name not in channel.values()], units)
    free = [name for name in names if name not in {*channel.values(), *flow.values()}]
    strains = [name for name in free if units.get(name, "um/m") in SIGNAL_UNITS]
    by_place = _by_place({gauge: place for gauge, place in places.items() if gauge not in channel}, strains)
    channel |= by_place
    reason |= dict.fromkeys(by_place, BY_PLACE)
    strains = [name for name in strains if name not in by_place.values()]
    with_unit = [name for name in strains if name in units]
    missing = [gauge for gauge in gauges if gauge not in channel]
    for candidates in (strains, with_unit):  # as many with a unit of strain as gauges
        if missing and len(candidates) == len(missing):
            channel |= zip(missing, _by_numbers(candidates), strict=True)
            reason |= dict.fromkeys(missing, BY_ORDER)
            missing, strains = [], [name for name in strains if name not in candidates]
    free = [name for name in free if name not in channel.values()]
    return ChannelDraft(
        source=source,
        recording=recording,
        gauges=gauges,
        channel={gauge: channel[gauge] for gauge in gauges if gauge in channel},
        reason=reason,
        flow=flow,
        guesses={quantity: name for quantity, name in guesses.items() if name not in channel.values()},
        time=time,
        has_time=has_time,
        units=units,
        free=(*strains, *(name for name in free if name not in strains)),
    )


def _table(recording: Path, known: Set[str]) -> Table:
    """Return the table of a recording whose headings are the line with most of the ``known`` names."""
    with open_table(recording, Reading(is_known=lambda name: plain_name(name) in known)) as table:
        return table


def _time(table: Table) -> tuple[str | None, bool]:
    """Return the channel of time if it needs an entry, and whether there are times at all."""
    times = {frame.columns[i].full for frame in table.frames for i in frame.times if not frame.has_clock}
    if len(times) == 1 or any(frame.has_clock for frame in table.frames):
        return None, True
    by_unit = [column.full for column in table.columns if time_unit(column.unit or "") is not None]
    time = next(iter([*sorted(times), *by_unit]), None)
    return time, time is not None


def _named(gauges: Sequence[str], names: Sequence[str]) -> dict[str, str]:
    """Return the channel of each gauge by its own name, by its number, or by the nearest name."""
    plain = {plain_name(last_part(name.rpartition("/")[2])): name for name in reversed(names)}
    numbers = {number: name for name in reversed(names) if (number := strain_number(name)) is not None}
    named = {gauge: plain[plain_name(gauge)] for gauge in gauges if plain_name(gauge) in plain}
    for number, gauge in enumerate(gauges, start=1):
        if gauge not in named and number in numbers and numbers[number] not in named.values():
            named[gauge] = numbers[number]
    rest = [name for name in names if name not in named.values() and strain_number(name) is None]
    return named | likely_pairs([gauge for gauge in gauges if gauge not in named], rest)


def _by_numbers(names: Sequence[str]) -> Sequence[str]:
    """Return names by their numbers where they differ in these alone, and most of their ranges are there."""
    parts = {name: _parts(name) for name in names}
    numbers = [parts[name][1] for name in parts]
    if len({words for words, _ in parts.values()}) > 1 or len({*map(len, numbers)}) > 1 or len(parts) < len(names):
        return names
    of_ranges = prod(max(column) - min(column) + 1 for column in zip(*numbers, strict=True))
    return sorted(names, key=lambda name: parts[name][1]) if of_ranges <= 2 * len(names) else names


# --- roll angles and stations -----------------------------------------------------------------------------------

Place = tuple[str, int, frozenset[int]]
"""Kind of a gauge, its roll angle in whole degrees, and the numbers that its station may have in a name."""


def _places(inverse_map: InverseMap | None, gauges: Sequence[str]) -> dict[str, Place]:
    """Return the places of gauges: by the map, or by the words and the last two numbers of their names."""
    places: dict[str, Place] = {}
    if inverse_map is None:
        for gauge in gauges:
            words, numbers = _parts(gauge)
            if len(numbers) > 1:
                places[gauge] = _kind(words) or " ".join(words), numbers[-2] % 360, frozenset({numbers[-1]})
        return places
    x, y, z = inverse_map.gauge_position[: len(gauges)].T
    along = np.abs(inverse_map.gauge_direction[: len(gauges), 0]) > 0.5
    roll = np.rint(np.degrees(np.arctan2(y, z))).astype(int) % 360
    for i, gauge in enumerate(gauges):
        row = (roll == roll[i]) & (along == along[i])
        station = 1 + int(np.count_nonzero(row & (x < x[i] - 1e-6)))
        stations = frozenset({station, int(np.rint(1e3 * x[i]))})
        places[gauge] = "axial" if along[i] else "hoop", int(roll[i]), stations
    return places


def _kind(words: Sequence[str]) -> str:
    """Return the direction that the words of a name state, "" for none."""
    specific = [word for word in words if word not in _GENERAL]
    kinds = [kind for kind, letters in _KINDS.items() if any(word[:1] in letters for word in specific)]
    return kinds[0] if len(kinds) == 1 else ""


def _by_place(places: Mapping[str, Place], names: Sequence[str]) -> dict[str, str]:
    """Return the channel of each gauge whose roll angle and station number its name states.

    Names of the same words are a class, which has the numbers at the same places. A kind of gauges belongs to the
    class that covers it; of classes that cover it alike, to the one whose words state its direction.
    """
    classes: dict[tuple[str, ...], list[str]] = {}
    for name in names:
        classes.setdefault(_parts(name)[0], []).append(name)
    common = set.intersection(*map(set, classes)) if len(classes) > 1 else set()
    paired: dict[str, str] = {}
    for kind in dict.fromkeys(place[0] for place in places.values()):
        gauges = {gauge: place for gauge, place in places.items() if place[0] == kind}
        ranked = []
        for words, members in classes.items():
            stated = _kind([word for word in words if word not in common])
            pairs = _best_pairs(gauges, members)
            if len(pairs) >= MIN_COVERED * len(gauges) and stated in ("", kind):
                ranked.append((stated == kind, len(pairs), pairs))
        ranked.sort(key=lambda item: item[:2], reverse=True)
        if ranked and (len(ranked) == 1 or ranked[0][:2] != ranked[1][:2]):
            pairs = ranked[0][-1]
            if not {*paired.values()} & {*pairs.values()}:
                paired |= pairs
    return paired


def _best_pairs(gauges: Mapping[str, Place], names: Sequence[str]) -> dict[str, str]:
    """Return the most channels, one for each gauge, of any two places of numbers in the names."""
    numbers = {name: _parts(name)[1] for name in names}
    width = max(map(len, numbers.values()), default=0)
    full = {name: values for name, values in numbers.items() if len(values) == width}
    best: dict[str, str] = {}
    for of_roll, of_station in permutations(range(width), 2):
        pairs = {}
        for gauge, (_, roll, stations) in gauges.items():
            fitting = [
                name for name, ns in full.items() if ns[of_roll] % 360 == roll and ns[of_station] in stations
            ]
            if len(fitting) == 1:
                pairs[gauge] = fitting[0]
        if len(pairs) > len(best) and len(set(pairs.values())) == len(pairs):
            best = pairs
    return best


# --- names of the flow ------------------------------------------------------------------------------------------


def _flow_channels(
    quantities: Sequence[str], names: Sequence[str], units: Mapping[str, str]
) -> tuple[dict[str, str], dict[str, str]]:
    """Return the channel of each quantity of the flow by name and unit, and further ones by the unit alone."""
    flow: dict[str, str] = {}
    for name in names:
        quantity = _stated_quantity(name)
        if quantity in quantities and quantity not in flow and _fits(quantity, units.get(name)):
            flow[quantity] = name
    rest = [name for name in names if name not in flow.values()]
    wanted = [quantity for quantity in quantities if quantity not in flow and not quantity.endswith("_std")]
    near = likely_pairs(wanted, rest)
    flow |= {quantity: name for quantity, name in near.items() if _fits(quantity, units.get(name))}
    guesses: dict[str, str] = {}
    if DYNAMIC_PRESSURE not in flow:
        pressures = [name for name in rest if units.get(name) and _fits(DYNAMIC_PRESSURE, units[name])]
        pressures = [name for name in pressures if name not in flow.values()]
        guesses = {DYNAMIC_PRESSURE: pressures[0]} if len(pressures) == 1 else {}
    return flow, guesses


def _stated_quantity(name: str) -> str:
    """Return the quantity that a name, or a word of it of three letters or more, is another name for."""
    letters = "".join(letter for letter in last_part(name).casefold() if letter.isascii() and letter.isalnum())
    if letters in OTHER_NAMES:
        return OTHER_NAMES[letters]
    words = [word for word in re.split(r"[^a-z0-9]+", last_part(name).casefold()) if len(word) > 2]
    stated = {OTHER_NAMES[word] for word in words if word in OTHER_NAMES}
    return stated.pop() if len(stated) == 1 else ""


def _fits(quantity: str, unit: str | None) -> bool:
    """Return whether a quantity may be in a unit; in none it may."""
    if unit is None or quantity.startswith((PREFIX, SENSOR_PREFIX)) or quantity == THRUST:
        return True
    try:
        scale_of(Path(), "", quantity, unit)
    except InputError:
        return False
    return True


# --- names that are similar -------------------------------------------------------------------------------------


def similarity(name: str, channel: str) -> float:
    """Return how similar two names are, from 0 to 1; 0 for names whose words have nothing in common.

    Numbers count as numbers, from the last to the first, and as much as all letters: 'axial_180deg_2' is more like
    'AX-180-2' than like 'axial_180deg_3'. Equal numbers alone make no two names similar.

    >>> similarity("axial_180deg_2", "AX-180-2") > similarity("axial_180deg_2", "axial_180deg_3")
    True
    >>> similarity("axial_0deg_1", "AI0/ch1")
    0.0
    """
    words, numbers = _parts(name)
    other_words, other_numbers = _parts(channel)
    alike = _likeness(words, other_words)
    if alike < MIN_LIKENESS:
        return 0.0
    if not numbers and not other_numbers:
        return alike
    pairs = zip(reversed(numbers), reversed(other_numbers), strict=False)
    equal = sum(first == second for first, second in pairs) / max(len(numbers), len(other_numbers))
    return 0.5 * alike + 0.5 * equal


@lru_cache(maxsize=4096)  # gauges of one kind have the same words
def _likeness(words: tuple[str, ...], channel_words: tuple[str, ...]) -> float:
    """Return how similar the words of two names are, from 0 to 1; an abbreviation counts much."""
    alike = SequenceMatcher(None, "".join(words), "".join(channel_words), autojunk=False).ratio()
    pairs = [sorted(pair, key=len) for pair in product(words, channel_words)]
    is_short = any(len(short) > 1 and long.startswith(short) for short, long in pairs)
    return max(alike, ABBREVIATED) if is_short else alike


@lru_cache(maxsize=4096)
def _parts(name: str) -> tuple[tuple[str, ...], list[int]]:
    """Return the words and the numbers of a name."""
    parts = _WORDS_OR_NUMBERS.findall(name.casefold())
    return tuple(part for part in parts if not part.isdecimal()), [int(part) for part in parts if part.isdecimal()]


def likely_pairs(wanted: Collection[str], channels: Sequence[str]) -> dict[str, str]:
    """Return the most similar of ``channels`` for each name of ``wanted``, the most similar pairs first.

    A channel belongs to one name at most. Names without a channel of :data:`MIN_SIMILARITY` are left out, and so
    are names that fit two channels equally well.
    """
    scores = {(name, channel): similarity(name, channel) for name in wanted for channel in channels}
    pairs: dict[str, str] = {}
    for name, channel in sorted(scores, key=lambda pair: -scores[pair]):
        score, taken = scores[name, channel], {*pairs.values()}
        if score < MIN_SIMILARITY:
            break
        alike = [free for free in channels if free not in taken and scores[name, free] == score]
        if name not in pairs and alike == [channel]:
            pairs[name] = channel
    return pairs


def _printable(text: str) -> str:
    """Return a text that may stand in a comment, which has no control characters."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def _quoted(text: str) -> str:
    """Return a basic string of TOML."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
