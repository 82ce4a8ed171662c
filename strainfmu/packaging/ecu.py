"""Export of an estimator as an ECU: an FMU of FMI 3.0 whose strains and results are CAN frames (FMI-LS-BUS 1.0).

What the compiled ECU reads is made here: the plan of the input, the frames of the results, and which variable
takes each quantity (``fmus/native/ecu/ecu.c``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from strainfmu.can.bus_file import BusDescription
from strainfmu.can.dbc_writer import dbc_text
from strainfmu.can.frame_layout import FrameLayout
from strainfmu.can.machine import Machine
from strainfmu.can.options import BridgeOptions
from strainfmu.can.result_frames import STATUS_PERIOD, composition, other_loads
from strainfmu.can.setup import all_layouts, make_machine
from strainfmu.can.signals import SIGNAL, frame_table, signal_table
from strainfmu.cosim.estimators.source import open_step
from strainfmu.cosim.estimators.step import needs_pressure
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import ANGLE_ERROR, MEASURED_ANGLES, Q_SOURCE, STD
from strainfmu.estimator.map.inverse_map import load_inverse_map
from strainfmu.estimator.signal_names import STRAIN
from strainfmu.fmu.description.port import BusPart
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.interface.estimator_variables import estimator_interface
from strainfmu.interface.fmi_variables import value_references
from strainfmu.packaging.nodes import bus_of_fmu, node_part

_SETUP = np.dtype(
    [
        *((name, "f8") for name in ("response_time", "status_period", "bridge_alarm")),
        *((name, "i4") for name in ("needs_pressure", "configuration", STRAIN, "padding")),
    ]
)
_KEY = np.dtype([("key", "u4"), ("slot", "i4")], align=True)
_QUANTITY = np.dtype([("variable", "i4"), ("is_whole", "i4"), ("value", "f8"), ("fallback", "f8")], align=True)
_OTHER = np.dtype([("variable", "i4"), ("padding", "i4"), ("step", "f8")], align=True)
"""Records of ``ecu.c``."""


def export_ecu(
    map_path: Path, fmu_path: Path, bus_path: Path, options: ExportOptions | None = None
) -> Literal["linear", "nonlinear"]:
    """Write the FMU of the map at ``map_path`` on the bus of ``bus_path`` to ``fmu_path``.

    ``options`` are of kind native and FMI 3.0, as by default. Returns which estimator it holds.

    Raises
    ------
    InputError
        A file is wrong, an option cannot be, or the bus file states what hardware alone has.
    StrainfmuError
        The FMU could not be written, or cantools is not installed.
    """
    options = options or ExportOptions(fmi_version="3")
    if options.kind != "native" or options.fmi_version != "3":
        raise InputError("bus: expected an FMU of kind native and FMI 3.0, which alone has clocks: --fmi 3")
    bus = bus_of_fmu(bus_path)
    return export_estimator(map_path, fmu_path, options, lambda source: ecu_part(source, bus))


def ecu_part(map_path: Path, bus: BusDescription) -> BusPart:
    """Return what puts the FMU of a map on ``bus``.

    Raises
    ------
    InputError
        The map or an entry is wrong.
    """
    chosen = bus.options(BridgeOptions(interface="", channel=""))
    with open_step(map_path) as ready:
        machine, results, configuration, _ = make_machine(ready.step, chosen, ready.gauge_names, start=0.0)
        if machine.layout.is_authenticated:
            raise InputError(f"input.profile: expected one without authenticators in an FMU, got {chosen.profile}")
        no_pressure_no_loads = needs_pressure(ready.step)
    references = value_references(estimator_interface(load_inverse_map(map_path)))
    times = (bus.response_time, STATUS_PERIOD, machine.plan.bridge_alarm)
    setup = (*times, no_pressure_no_loads, configuration, references[f"{STRAIN}[1]"], 0)
    return node_part(
        bus,
        results,
        resource="bus.bin",
        tables=(np.array([setup], dtype=_SETUP), *_tables(machine, results, references)),
        dbc=dbc_text(all_layouts(map_path, chosen), map_path.name).encode("cp1252", "replace"),
        lines=_lines(bus, machine),
    )


def _lines(bus: BusDescription, machine: Machine) -> tuple[str, ...]:
    """Return what the page states of the bus."""
    period, delay = 1e3 * machine.layout.cycle_time, 1e3 * bus.response_time
    return (
        f"Connect the terminal <code>{bus.network}</code> to a CAN bus of FMI-LS-BUS 1.0, in an importer with "
        f"event mode. Strains come in the frames of {machine.layout.name}, a cycle every {period:g} ms; the DBC "
        "file is in extra/org.fmi-standard.fmi-ls-bus.",
        f"The transmit clock is {bus.tx_clock}; with a triggered one frames go at the importer's steps. A result "
        f"goes {delay:g} ms after its strains. Age, counter and CRC belong to the tick.",
        "Use loads where Usable of the frame, or <code>health.usable</code>, is true. They are NaN without an "
        "estimate.",
    )


def _tables(
    machine: Machine, results: Sequence[FrameLayout], references: Mapping[str, int]
) -> tuple[np.ndarray[Any, Any], ...]:
    """Return the tables behind the set-up, in the order of ``ecu.c``."""
    plan, constants = machine.plan, dict(machine.layout.constants)
    for angle in MEASURED_ANGLES:
        if angle in plan.quantities and f"{angle}{STD}" not in plan.quantities:
            constants.setdefault(f"{angle}{STD}", ANGLE_ERROR)
    frames = composition(results)
    keys = [(key, slot) for key, slot in plan.slots.items()] + [(frame.key, -1) for frame in results]
    record = plan.record.copy()
    for name in plan.tables:
        record[name] = 0  # an address, the reader's own
    return (
        record,
        *plan.tables.values(),
        np.array(keys, dtype=_KEY),
        np.array([_taken(name, references) for name in plan.quantities], dtype=_QUANTITY),
        np.array([_taken(name, references, value) for name, value in constants.items()], dtype=_QUANTITY),
        np.array([(references[name], 0, step) for name, step in other_loads(results).items()], dtype=_OTHER),
        frame_table([(layout, kind) for layout, kind, _ in frames]),
        np.concatenate([signal_table(layout) for layout, _, _ in frames]).astype(SIGNAL),
        np.concatenate([sources for _, _, sources in frames]).astype("i4"),
    )


def _taken(name: str, references: Mapping[str, int], value: float = np.nan) -> tuple[int, bool, float, float]:
    """Return variable, whether it is an enumeration, value, and what stands for a value that is not above 0."""
    is_angle_error = name in {f"{angle}{STD}" for angle in MEASURED_ANGLES}
    return references[name], name == Q_SOURCE, value, ANGLE_ERROR if is_angle_error else np.nan
