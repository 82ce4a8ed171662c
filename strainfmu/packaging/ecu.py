"""Export of an estimator as an ECU: an FMU of FMI 3.0 whose strains and results are CAN frames (FMI-LS-BUS 1.0).

What the compiled ECU reads is made here (``fmus/native/ecu/ecu.c``): the records and arrays of a bridge in Python,
with places instead of addresses, and which variables of the model are its inputs and outputs.
"""

from collections.abc import Mapping, Sequence
from math import nan
from pathlib import Path
from typing import Any, Literal

import numpy as np

from strainfmu.can.bus_file import BusDescription
from strainfmu.can.dbc_writer import dbc_text
from strainfmu.can.machine import Machine
from strainfmu.can.options import BridgeOptions
from strainfmu.can.result_frames import STATUS_PERIOD
from strainfmu.can.setup import all_layouts, make_machine
from strainfmu.cosim.estimators.description import OUTPUTS
from strainfmu.cosim.estimators.exchange import ESTIMATOR, EXCHANGE
from strainfmu.cosim.estimators.source import open_step
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import ANGLE_ERROR, DYNAMIC_PRESSURE, MEASURED_ANGLES, Q_SOURCE, STD
from strainfmu.estimator.map.inverse_map import load_inverse_map
from strainfmu.fmu.description.port import BusPart
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.interface.estimator_variables import estimator_interface
from strainfmu.interface.fmi_variables import strain_names, value_references
from strainfmu.packaging.nodes import bus_of_fmu, node_part

_SETUP = np.dtype([("response_time", "f8"), ("status_period", "f8"), ("bridge", "i8")])
_ADDRESS = np.dtype([(name, "i4") for name in ("at", "place", "changes", "padding")])
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
        machine.compose(results, configuration)
    references = value_references(estimator_interface(load_inverse_map(map_path)))
    content = _Content()
    place = content.put_bridge(machine, references)
    setup = np.array([(bus.response_time, STATUS_PERIOD, place)], dtype=_SETUP)
    return node_part(
        bus,
        results,
        resource="bus.bin",
        tables=(setup, *content.tables()),
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


_Place = tuple[int, bool]
"""Where an array lies, and whether among those that change."""


class _Content:
    """The records of a bridge and their arrays as bytes, those that change in a run apart, and the addresses."""

    def __init__(self) -> None:
        self._fixed, self._changing, self._addresses = bytearray(), bytearray(), list[tuple[int, int, bool, int]]()

    def tables(self) -> tuple[np.ndarray[Any, Any], ...]:
        """Return the tables behind the set-up, in the order of ``ecu.c``."""
        fixed, changing = (np.frombuffer(part, dtype=np.uint8) for part in (self._fixed, self._changing))
        return fixed, changing, np.array(self._addresses, dtype=_ADDRESS)

    def put_bridge(self, machine: Machine, references: Mapping[str, int]) -> int:
        """Put all that a bridge has, with the model as its estimator; return the place of its record."""
        arrays, plan = machine.bridge.arrays, machine.plan
        places = {"state": self._put(arrays["state"], changes=True)}  # it is the first
        tables = {name: self._put(table) for name, table in plan.tables.items()}
        places |= {"plan": self._put_record(plan.record, tables)} | self._put_estimator(machine, references)
        for name, array in arrays.items():
            if name not in places:
                places[name] = self._put(array, changes=name == "counter")
        return self._put_record(machine.bridge.record, places)[0]

    def _put_estimator(self, machine: Machine, references: Mapping[str, int]) -> dict[str, _Place]:
        """Put what makes the model a bridge's estimator; return what a bridge has of it, by field."""
        plan = machine.plan
        strains = strain_names(int(plan.record["n_gauges"][0]))
        start = dict.fromkeys((*strains, DYNAMIC_PRESSURE, *plan.quantities), nan)
        start |= {f"{angle}{STD}": nan for angle in MEASURED_ANGLES if angle in plan.quantities}
        start |= dict(machine.layout.constants)
        inputs = sorted(start, key=Q_SOURCE.__eq__)  # the whole number behind the others
        outputs = (*OUTPUTS[:-1], *machine.output_names, OUTPUTS[-1])
        given, taken = self._put(np.array([start[name] for name in inputs])), self._put(np.zeros(len(outputs)))
        numbers, of_outputs = ([references[name] for name in names] for names in (inputs, outputs))
        n_reals = len(inputs) - (Q_SOURCE in inputs)
        exchanges = [
            self._exchange(numbers[:n_reals], given),
            self._exchange(of_outputs[:-1], taken, is_output=True),
            self._exchange(of_outputs[-1:], taken, whole=len(outputs) - 1, is_output=True),
        ]
        if n_reals < len(inputs):
            exchanges.append(self._exchange(numbers[n_reals:], given, whole=n_reals))
        stds = [f"{angle}{STD}" for angle in MEASURED_ANGLES]
        angles = self._put(np.array([inputs.index(name) for name in stds if name in inputs], dtype=np.int32))
        flow = [-1 if name == DYNAMIC_PRESSURE else inputs.index(name) for name in plan.quantities]
        first, *_ = [self._put_record(row, places) for row, places in exchanges]
        record = np.zeros(1, dtype=ESTIMATOR)
        record["angle_error"], record["n_exchanges"] = ANGLE_ERROR, len(exchanges)
        record["n_angles"] = sum(name in inputs for name in stds)
        fields = {"exchange": first, "input": given, "output": taken, "angle": angles}
        estimator = self._put_record(record, fields)
        return {"estimator": estimator, "place": self._put(np.array(flow, dtype=np.int32)), "output": taken}

    def _exchange(
        self, numbers: Sequence[int], vector: _Place, whole: int | None = None, is_output: bool = False
    ) -> tuple[np.ndarray[Any, Any], dict[str, _Place]]:
        """Return what moves variables from or to ``vector``, a ``whole`` number at that place, and its arrays."""
        row, is_whole = np.zeros(1, dtype=EXCHANGE), whole is not None
        row["n"], row["is_output"], row["is_whole"] = len(numbers), is_output, is_whole
        places = {"reference": self._put(np.array(numbers, dtype=np.uint32)), "value": vector}
        if is_whole:
            buffer, place = np.zeros(1, dtype=np.int32), np.array([whole], dtype=np.int32)
            places |= {"value": self._put(buffer), "place": self._put(place)}
        return row, places

    def _put(self, array: np.ndarray[Any, Any], changes: bool = False) -> _Place:
        """Put the bytes of an array, from a multiple of 8 on."""
        part = self._changing if changes else self._fixed
        place = len(part)
        part += array.tobytes() + bytes(-array.nbytes % 8)
        return place, changes

    def _put_record(self, record: np.ndarray[Any, Any], places: Mapping[str, _Place]) -> _Place:
        """Put a record whose addresses lead to ``places``, by field."""
        place = len(self._fixed)
        self._put(record)
        for name, (to, changes) in places.items():
            at = place + record.dtype.fields[name][1]
            self._fixed[at : at + 8] = bytes(8)
            self._addresses.append((at, to, changes, 0))
        return place, False
