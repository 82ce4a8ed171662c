"""Nodes of FMI-LS-BUS 1.0 as files that compiled code reads: frames that are sent, and the sender of strains.

``fmus/native/network/link.h`` and ``fmus/native/nodes/sender.c`` read them.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from math import nan
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.can.bus_file import TABLES, BusDescription, read_bus
from strainfmu.can.encoder import cycles_apart
from strainfmu.can.frame_layout import FLOW_QUANTITIES, NAVIGATION, FrameLayout, InputFrame, InputLayout
from strainfmu.can.options import BridgeOptions
from strainfmu.can.result_frames import result_layouts
from strainfmu.can.setup import input_layout, result_form, stated_in
from strainfmu.can.signals import SIGNAL, frame_table, signal_table
from strainfmu.can.strain_sources import recorded_samples
from strainfmu.cosim.models.flight_model import FlightModel, load_flight_model
from strainfmu.cosim.models.schedule import ScheduledSignal
from strainfmu.errors import InputError
from strainfmu.estimator.signal_names import STRAIN, TARE
from strainfmu.fmu.description.port import BusPart, Port
from strainfmu.fmu.plant_export import export_schedule
from strainfmu.interface.fmi_variables import Variable, strain_names
from strainfmu.interface.sensor_variables import fmi_units, sensor_names

_SESSION = 1
"""Number of the sender's run, the same in every simulation."""

_CONSTANT, _SAMPLE_TIME = -1, -2
_HEARD = {"heard_counter": -3, "heard_time": -4, "heard_delay": -5}
"""Sources of a signal other than a variable, as ``sender.c`` lists them."""

_OF_HARDWARE = (
    *("interface", "channel", "bus_options", "log_channel", "key_file", "freshness_file", "synchronised"),
    *("zeros", TARE, "record", "publish", "http"),
)
"""Fields whose entries of a bus file an FMU has no use for."""

_SOURCE = np.dtype([("from", "i4"), ("padding", "i4"), ("value", "f8")], align=True)
_SETUP = np.dtype([("period", "f8"), ("answer_key", "u4"), ("answer_length", "i4")])
"""Records of ``nodes/sender.c``."""


def bus_of_fmu(path: Path) -> BusDescription:
    """Return the bus of an FMU that a file describes.

    Raises
    ------
    InputError
        The file is wrong, or states what hardware alone has.
    """
    bus = read_bus(path)
    named = {entry.sets: f"{table}.{name}" for table, entries in TABLES.items() for name, entry in entries.items()}
    for field in _OF_HARDWARE:
        if bus.stated.get(field) is not None or getattr(bus, field, None) is not None:
            raise InputError(
                f"{path}: {named[field]}: expected no such entry with '--bus' of an FMU, which has no hardware"
            )
    return bus


def node_part(bus: BusDescription, layouts: Sequence[FrameLayout], **parts: Any) -> BusPart:
    """Return the port of a node that sends ``layouts``, with ``parts`` as the class takes them."""
    has_fd = any(layout.is_fd for layout in layouts)
    return BusPart(
        ports=(Port(bus.network, bus.tx_clock),),
        can_rate=1000 * bus.can_rate,
        fd_rate=1000 * bus.fd_rate if has_fd else 0,
        **parts,
    )


def sender_part(bus_path: Path, model: FlightModel, variables: Mapping[str, int]) -> BusPart:
    """Return what makes the FMU of a vehicle, or of its recording, a sender of strains.

    Parameters
    ----------
    variables : number of each variable of the FMU by name.

    Raises
    ------
    InputError
        The bus file is wrong, or its frames are not such as an FMU can send.
    """
    bus = bus_of_fmu(bus_path)
    options = bus.options(BridgeOptions(interface="", channel=""))
    n = model.n_strain_gauges
    names, units = model.gauge_names[:n], () if model.sensors is None else fmi_units(model.sensors)[n:]
    readings = dict(zip(sensor_names(model), units, strict=True))
    if bus.gauges is not None:
        names, readings, _ = stated_in(bus.gauges)
    if tuple(names) != tuple(model.gauge_names[:n]):
        raise InputError(f"{bus_path}: input.gauges: expected the gauges of the flight model")
    layout, _ = input_layout(options, names, readings, needs_key=False)
    if layout.is_authenticated or layout.trailer is not None:
        raise InputError(
            f"{bus_path}: input.profile: expected fd64, or a DBC file, of an FMU that sends, got {layout.name}"
        )
    frames = _sent_frames(layout, variables)
    results = result_layouts(result_form(options, layout), options.identifiers, layout.cycle_time)
    answer = next(frame for frame in results if frame.cycle_time and "AnsweredCounter" in _names(frame))
    answered = [name for name in ("AnsweredCounter", "E2E_Counter", "SampleTime") if name in _names(answer)]
    setup = np.array([(layout.cycle_time, answer.key, answer.length)], dtype=_SETUP)
    rows = [row for frame in frames for row in _sources(frame, layout, variables)]
    return node_part(
        bus,
        [frame.layout for frame in frames],
        resource="sender.bin",
        tables=(
            setup,
            frame_table([(frame.layout, cycles_apart(frame, layout.cycle_time)) for frame in frames]),
            np.concatenate([_table(frame) for frame in frames]).astype(SIGNAL),
            np.array(rows, dtype=_SOURCE),
            signal_table(answer)[[answer.index_of(name) for name in answered]],
        ),
        lines=(
            f"Connect the terminal <code>{bus.network}</code> to a CAN bus of FMI-LS-BUS 1.0, in an importer with "
            f"event mode. Strains go in frames of {layout.name}, a cycle every {1e3 * layout.cycle_time:g} ms.",
        ),
    )


def _names(layout: FrameLayout) -> list[str]:
    return [signal.name for signal in layout.signals]


def _sent_frames(layout: InputLayout, variables: Mapping[str, int]) -> list[InputFrame]:
    """Return the frames in the order of their transmission, if anything in them is known."""
    state = () if layout.state is None else (layout.state,)
    flow = [frame for frame in layout.flow_frames if any(signal.quantity in variables for signal in frame.flow)]
    return [*state, *flow, *layout.strain_frames]


def _table(frame: InputFrame) -> Any:
    """Return the signals of a frame, with the factors of its strains and quantities."""
    table = signal_table(frame.layout)
    for index, factor in zip(frame.indices, frame.to_strain, strict=True):
        table[index]["factor"] = factor
    for signal in frame.flow:
        table[signal.index]["factor"], table[signal.index]["added"] = signal.to_si, signal.offset
    return table


def _sources(frame: InputFrame, layout: InputLayout, variables: Mapping[str, int]) -> list[tuple[int, int, float]]:
    """Return where the value of each signal comes from, as :mod:`strainfmu.can.encoder` has it."""
    frame_layout = frame.layout
    rows = [
        (_CONSTANT, 0, float(signal.initial or 0) * signal.scale + signal.offset)
        for signal in frame_layout.signals
    ]
    for index, gauge in zip(frame.indices, frame.gauges, strict=True):
        rows[index] = (variables[f"{STRAIN}[{gauge + 1}]"], 0, 0.0)
    for signal in frame.flow:
        number = variables.get(signal.quantity)
        rows[signal.index] = (_CONSTANT, 0, nan) if number is None else (number, 0, 0.0)
    if frame.status is not None:
        rows[frame.status] = (_CONSTANT, 0, 0.0)
    if frame.sample_time is not None:
        rows[frame.sample_time] = (_SAMPLE_TIME, 0, frame.tick)
    if frame.session is not None:
        rows[frame.session] = (_CONSTANT, 0, float(_SESSION))
        for role, source in _HEARD.items():
            if (index := getattr(frame, role)) is not None:
                rows[index] = (source, 0, layout.first_of_cycle.tick)
    if frame_layout.multiplexer is not None:
        selector, number = frame_layout.multiplexer
        rows[frame_layout.index_of(selector.name)] = (_CONSTANT, 0, number * selector.scale + selector.offset)
    return rows


def export_recording(recording: Path, flight_model_path: Path, fmu_path: Path, bus_path: Path) -> None:
    """Write an FMU that sends the rows of a recording, one a cycle, as the gauges of a flight model."""
    bus, model = bus_of_fmu(bus_path), load_flight_model(flight_model_path)
    options = bus.options(BridgeOptions(interface="", channel=""))
    names = model.gauge_names[: model.n_strain_gauges]
    with recorded_samples(recording, names, options.dynamic_pressure) as samples:
        rows = [
            (*sample.strain, sample.dynamic_pressure, sample.mach_number, sample.altitude) for sample in samples
        ]
    times = tuple(options.cycle_time * cycle for cycle in range(len(rows)))
    columns = dict(zip((*strain_names(len(names)), *FLOW_QUANTITIES), np.array(rows).T, strict=True))
    for name in NAVIGATION:
        if not np.isfinite(columns[name]).all():
            del columns[name]
    signals = [
        ScheduledSignal(
            Variable(
                name=name, description=f"{name} of the recording", causality="output", variability="discrete"
            ),
            times=times,
            values=tuple(column.tolist()),
        )
        for name, column in columns.items()
    ]
    export_schedule(
        signals,
        fmu_path,
        fmi_version="3",
        flight_model_path=flight_model_path,
        bus=partial(sender_part, bus_path, model),
    )
