"""The DBC file of a bridge's frames for the tools at the other end of the bus: a profile's input, the results."""

from __future__ import annotations

from pathlib import Path

from strainfmu.can.bridge.options import BridgeOptions
from strainfmu.can.bridge.results.layouts import result_layouts
from strainfmu.can.bridge.setup import map_input_layout, map_load_groups, result_form
from strainfmu.can.settings import checked_cycle_time
from strainfmu.can.wire.frame_layout import FrameLayout
from strainfmu.files import write_bytes_atomically


def write_dbc(source: Path, output: Path, options: BridgeOptions) -> int:
    """Write the DBC file of the frames for a map, or its FMU; return its number of frames.

    With a DBC file of the user's own as input, it holds the frames of the results alone.

    Raises
    ------
    InputError
        The map or an option is wrong.
    StrainfmuError
        cantools is not installed, or the file cannot be written.
    """
    from strainfmu.can.wire.dbc_writer import dbc_text

    layouts = all_layouts(source, options)
    of_input = f"profile {options.profile}" if options.dbc is None else f"results for {options.dbc.name}"
    text = dbc_text(layouts, f"{source.name}, {of_input}")
    write_bytes_atomically(output, text.encode("cp1252", "replace"))
    return len(layouts)


def all_layouts(source: Path, options: BridgeOptions) -> list[FrameLayout]:
    """Return every frame of a profile, input, then results; of a user's own DBC file the results alone.

    Raises
    ------
    InputError
        The map or an option is wrong.
    """
    checked_cycle_time(options.cycle_time, "cycle time")
    layout, _, _ = map_input_layout(options, source, needs_key=False)
    identifiers = options.identifiers
    results = result_layouts(result_form(options, layout), identifiers, layout.cycle_time, map_load_groups(source))
    identifiers.checked(len(layout.frames) if options.dbc is None else 1, len(results))
    of_input = [frame.layout for frame in layout.frames] if options.dbc is None else []
    return [*of_input, *results]
