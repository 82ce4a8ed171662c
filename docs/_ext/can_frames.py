"""The bus as its code states it: directives ``can-frames``, from the files of the profiles, and ``can-causes``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

from generated_text import GeneratedText
from sphinx.application import Sphinx

from strainfmu.can.frame_layout import FLOAT, SIGNED, FrameLayout, SignalLayout
from strainfmu.can.profiles import BASE, Identifiers, profile_layout
from strainfmu.can.quality import Cause, all_words
from strainfmu.can.result_frames import result_layouts
from strainfmu.estimator.other_loads import FAMILIES, LoadGroup

CYCLE = 0.01
GAUGES = 27
"""As many as the largest frame holds."""


def frames_page(name: str) -> str:
    """Return the frames of a profile, or of "results FORM", and their signals, in MyST Markdown."""
    form = name.removeprefix("results ")
    layouts = _input_frames(name) if form == name else _result_frames(form)
    every = [one.name for _, one in layouts]
    rows = ["| frame | identifier | bytes | E2E profile, DataID | |", "|---|---|---|---|---|"]
    for place, one in layouts:
        rows.append(f"| `{one.name}` | {place} | {one.length} | {_protection(one)} | {one.comment} |")
    rows += ["", "| signal | type | value | bytes | |", "|---|---|---|---|---|"]
    places: dict[str, dict[str, list[str]]] = {}
    for _, layout in layouts:
        for of_bytes, row in _signals(layout):
            places.setdefault(row, {}).setdefault(of_bytes, []).append(layout.name)
    for row, found in places.items():
        signal, meaning = row.rsplit(" | ", 1)
        frames = {at: "all" if names == every else ", ".join(names) for at, names in found.items()}
        where = [f"{at}: {names}" for at, names in frames.items()]
        rows.append(f"| {signal} | {'; '.join(where)} | {meaning} |")
    return "\n".join(rows)


def _input_frames(profile: str) -> list[tuple[str, FrameLayout]]:
    """Return the first frame of each kind of a profile, with its identifier in words."""
    gauges = [f"strain_{i}" for i in range(1, GAUGES + 1)]
    readings = {f"sensor.reading_{i}": "" for i in range(1, GAUGES + 1)}
    layout = profile_layout(profile, gauges, CYCLE, has_tare=True, readings=readings)
    frames = []
    for one in sorted((frame.layout for frame in layout.frames), key=lambda one: one.identifier):
        offset, kind = one.identifier - BASE, one.name.rstrip("0123456789")
        is_repeated = kind in ("Strain", "Sensors")
        if is_repeated and one.name != f"{kind}1":
            continue
        place = {-1: "base - 1", 0: "base", 1: "base + 1"}.get(offset, "next")
        frames.append((f"{place} .." if is_repeated else place, one))
    return frames


def _result_frames(form: str) -> list[tuple[str, FrameLayout]]:
    """Return the frames of the results, with rooms for one place of every other load."""
    groups = [LoadGroup(family, load, ("NAME",), 0) for family in FAMILIES for load in family.loads]
    stated = len(result_layouts(form, Identifiers(), CYCLE))
    layouts = result_layouts(form, Identifiers(), CYCLE, groups)
    return [(f"base + {n}" if n <= stated else "next ..", one) for n, one in enumerate(layouts)]


def _protection(layout: FrameLayout) -> str:
    protection = layout.protection
    if protection is None:
        return "in the trailer"
    of_configuration = layout.name == "StrainTrailer"
    return f"{protection.profile}, {'configuration' if of_configuration else f'0x{protection.data_id:04X}'}"


def _signals(layout: FrameLayout) -> Iterator[tuple[str, str]]:
    """Yield bytes of the signals, and their names, type, value and meaning; signals of one kind are one row."""
    ordered = sorted(layout.signals, key=lambda one: one.start)
    starts = [0, *(n for n, (one, two) in enumerate(pairwise(ordered), start=1) if not _alike(one, two))]
    for first, end in pairwise([*starts, len(ordered)]):
        yield _row(ordered[first:end])


def _alike(one: SignalLayout, other: SignalLayout) -> bool:
    """Whether two signals stand side by side and differ in name alone."""
    same = replace(other, name=one.name, start=one.start, comment=one.comment) == one
    return (
        same
        and one.start + one.length == other.start
        and (_stem(one) == _stem(other) or one.comment == other.comment)
    )


def _stem(signal: SignalLayout) -> str:
    return signal.name.rstrip("0123456789")


def _row(signals: Sequence[SignalLayout]) -> tuple[str, str]:
    one, last = signals[0], signals[-1]
    names = ", ".join(f"`{each.name}`" for each in signals)
    if len(signals) > 1 and _stem(one) == _stem(last):
        names = f"`{one.name}` .. `{last.name}`"
    kind = {FLOAT: "float", SIGNED: "int"}.get(one.kind, "uint") + str(one.length)
    factor = f"{one.scale:g}" if one.scale != 1.0 else ""
    value = " ".join(part for part in (factor, one.unit, f"from {one.offset:g}" if one.offset else "") if part)
    codes = ", ".join(f"{code} {text}" for code, text in one.choices)
    comment = one.comment.replace("sensor.reading_1 ", "`sensor.NAME` ")
    meaning = "; ".join(part for part in (comment, codes) if part)
    number = f"{len(signals)} x " if len(signals) > 1 else ""
    return _bytes(one.start, last.start + last.length), f"{names} | {number}{kind} | {value} | {meaning}"


def _bytes(start: int, end: int) -> str:
    """Return the bytes, or within a byte the bits, from the first bit up to the bit behind the last."""
    if start % 8 or end % 8:
        bits = f"bits {start % 8}-{(end - 1) % 8}" if end - start > 1 else f"bit {start % 8}"
        return f"{start // 8} ({bits})"
    return f"{start // 8}" if end - start == 8 else f"{start // 8}-{end // 8 - 1}"


def causes_page() -> str:
    """Return the causes of a result that is not VALID, bit by bit, in MyST Markdown."""
    rows, words = ["| bit | cause | |", "|---|---|---|"], all_words()["cause"]
    for cause in Cause:
        rows.append(f"| {cause.bit_length() - 1} | `{cause.name}` | {words[cause.name or '']} |")
    return "\n".join(rows)


class CanCauses(GeneratedText):
    """The causes of a result that is not VALID."""

    source = "strainfmu.can.quality"

    def text(self) -> str:
        """Return the table."""
        return causes_page()


class CanFrames(GeneratedText):
    """The frames of the profile that is the argument; ``results FORM``: of the results."""

    required_arguments = 1
    final_argument_whitespace = True
    source = "strainfmu.can.profiles"

    def text(self) -> str:
        """Return the tables."""
        return frames_page(self.arguments[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("can-frames", CanFrames)
    app.add_directive("can-causes", CanCauses)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
