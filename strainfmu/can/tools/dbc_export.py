"""The DBC file of a map's frames, for the tools at the other end of the bus."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from strainfmu.can.bridge.results.layouts import result_layouts
from strainfmu.can.bridge.setup import (
    map_gauge_names,
    map_load_groups,
    map_reading_units,
)
from strainfmu.can.settings import checked_cycle_time
from strainfmu.can.wire.frame_layout import FrameLayout
from strainfmu.can.wire.profiles import Identifiers, profile_layout, result_form_of
from strainfmu.estimator.other_loads import LoadGroup
from strainfmu.files import write_bytes_atomically


def write_dbc(
    source: Path,
    output: Path,
    profile: str,
    cycle_time: float,
    identifiers: Identifiers,
    has_tare: bool = False,
) -> int:
    """Write the DBC file of a map's (or its FMU's) frames; return its number of frames.

    ``has_tare`` adds the frame that asks for a tare.

    Raises
    ------
    InputError
        The map or an option is wrong.
    StrainfmuError
        cantools is not installed, or the file cannot be written.
    """
    from strainfmu.can.wire.dbc_writer import dbc_text

    checked_cycle_time(cycle_time, "cycle time")
    names = map_gauge_names(source)
    layouts = all_layouts(
        profile,
        names,
        cycle_time=cycle_time,
        identifiers=identifiers,
        has_tare=has_tare,
        groups=map_load_groups(source),
        readings=map_reading_units(source),
    )
    text = dbc_text(layouts, f"{source.name}, profile {profile}")
    write_bytes_atomically(output, text.encode("cp1252", "replace"))
    return len(layouts)


def all_layouts(
    profile: str,
    gauge_names: Sequence[str],
    cycle_time: float,
    identifiers: Identifiers,
    has_tare: bool = False,
    groups: Sequence[LoadGroup] = (),
    readings: Mapping[str, str] | None = None,
) -> list[FrameLayout]:
    """Return every frame of a profile: input, then results.

    ``groups`` as of :func:`result_layouts`, ``readings`` as of :func:`profile_layout`.
    """
    layout = profile_layout(
        profile,
        gauge_names,
        cycle_time=cycle_time,
        identifiers=identifiers,
        has_tare=has_tare,
        readings=readings,
    )
    results = result_layouts(result_form_of(profile), identifiers, cycle_time, groups)
    identifiers.checked(len(layout.frames), len(results))
    return [*(frame.layout for frame in layout.frames), *results]
