"""Importers that can be installed with pip, each driven over a table of inputs.

Run in a process of its own, so that an importer that dies takes nothing with it:

    python -m strainfmu.fmu.checks.importers IMPORTER X.fmu INPUT.csv OUTPUT.csv

Inputs are set at the start of each step and held; outputs are read at its end. Row 0 of the output table is what
the importer gives before the first step, empty where it gives nothing.
"""

import csv
import ctypes
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

Table = dict[str, list[list[float]]]
"""Values by name of the variable: one list of elements per row, of one element for a scalar."""

NANOSECONDS = 1e9

_CASTS: dict[str, Callable[[float], Any]] = {"Real": float, "Integer": int, "Boolean": bool}
"""Python's type by FMI's; ecos and libcosim know no Enumeration."""

_CASTS_3: dict[str, Callable[[float], Any]] = {"Float64": float, "Int32": int, "Boolean": bool}
_CALLS = {"Enumeration": "Int64"}
"""What FMI 3.0 calls the type in the names of its functions, where that is another."""

_ECOS_NAMES = {"Real": "real", "Integer": "integer", "Boolean": "bool"}


def read_table(path: Path) -> Table:
    """Return a table of :func:`~strainfmu.fmu.reference_run.run.signal_table`, "time" among its columns."""
    with path.open(newline="", encoding="utf-8") as stream:
        names, *rows = csv.reader(stream)
    # A table of time alone has a blank behind its name.
    return {name.strip(): [[float(v) for v in row[k].split()] for row in rows] for k, name in enumerate(names)}


def write_table(path: Path, table: Table) -> None:
    """Write a table with full precision."""
    rows = zip(*table.values(), strict=True)
    lines = [",".join(f'"{name}"' for name in table)]
    lines += [",".join(" ".join(repr(float(v)) for v in cell) for cell in row) for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def run_fmpy(fmu: Path, table: Table) -> Table:
    """Simulate with FMPy; what it prints of a failing FMU explains the failure."""
    import fmpy

    if any(len(cells[0]) > 1 for cells in table.values()):
        return _run_fmpy_arrays(fmu, table)
    rows = zip(*table.values(), strict=True)
    signals = np.array([tuple(cell[0] for cell in row) for row in rows], dtype=[(name, float) for name in table])
    time = [row[0] for row in table["time"]]
    result = fmpy.simulate_fmu(
        str(fmu),
        stop_time=time[-1],
        output_interval=time[1] - time[0],
        input=signals,
        fmi_type="CoSimulation",
        debug_logging=True,  # some FMUs say what is wrong only then; fmpy prints it
    )
    return {
        name: [np.atleast_1d(cell).astype(float).tolist() for cell in result[name]] for name in result.dtype.names
    }


def _run_fmpy_arrays(fmu: Path, table: Table) -> Table:
    """Simulate by FMPy's calls of FMI 3.0: its ``simulate_fmu`` takes no table with an array and a scalar."""
    import fmpy

    description = fmpy.read_model_description(str(fmu), validate=False)
    variables = {variable.name: variable for variable in description.modelVariables}
    outputs = [variable for variable in variables.values() if variable.causality == "output"]
    time = [row[0] for row in table["time"]]
    results: Table = {"time": table["time"], **{variable.name: [] for variable in outputs}}
    with tempfile.TemporaryDirectory() as folder:
        instance = fmpy.instantiate_fmu(
            fmpy.extract(str(fmu), folder), description, "CoSimulation", debug_logging=True
        )

        def set_inputs(row: int) -> None:
            for name in (name for name in table if name != "time"):
                setter = getattr(instance, f"set{_CALLS.get(variables[name].type, variables[name].type)}")
                setter(
                    [variables[name].valueReference], [_CASTS_3[variables[name].type](v) for v in table[name][row]]
                )

        def read_outputs() -> None:
            for variable in outputs:
                getter = getattr(instance, f"get{_CALLS.get(variable.type, variable.type)}")
                count = int(np.prod([int(dimension.start) for dimension in variable.dimensions]))
                results[variable.name].append(
                    [float(value) for value in getter([variable.valueReference], nValues=count)]
                )

        instance.enterInitializationMode(startTime=time[0], stopTime=time[-1])
        set_inputs(0)
        instance.exitInitializationMode()
        read_outputs()
        for row in range(len(time) - 1):
            set_inputs(row)
            instance.doStep(time[row], time[row + 1] - time[row])
            read_outputs()
        instance.terminate()
        instance.freeInstance()
    return results


def run_ecos(fmu: Path, table: Table) -> Table:
    """Simulate with ecos (package ecospy), which needs libtbb.so.12: the system's, or the one of package tbb."""
    library = Path(sys.prefix, "lib", "libtbb.so.12")
    if library.exists():  # where pip puts it and no loader looks
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    from ecospy import EcosSimulation, EcosSimulationStructure

    types = {name: variable.type for name, variable in _variables(fmu).items()}
    inputs, outputs = {name: types[name] for name in table if name != "time"}, _scalar_outputs(fmu)
    time = [row[0] for row in table["time"]]
    results: Table = {"time": table["time"], **{name: [[]] for name in outputs}}
    with EcosSimulationStructure() as structure:
        structure.add_model("x", str(fmu))
        with EcosSimulation(structure=structure, step_size=time[1] - time[0]) as simulation:
            simulation.init()
            for row in range(len(time) - 1):
                for name, type_ in inputs.items():
                    cast, setter = _CASTS[type_], getattr(simulation, f"set_{_ECOS_NAMES[type_]}")
                    setter(f"x::{name}", cast(table[name][row][0]))
                simulation.step()
                for name, type_ in outputs.items():
                    getter = getattr(simulation, f"get_{_ECOS_NAMES[type_]}")
                    results[name].append([float(getter(f"x::{name}"))])
            simulation.terminate()
    return results


def run_libcosim(fmu: Path, table: Table) -> Table:
    """Simulate with libcosim of the Open Simulation Platform (package libcosimpy)."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.WARNING)
    variables = _variables(fmu)
    outputs = _scalar_outputs(fmu)
    time = [row[0] for row in table["time"]]
    execution = CosimExecution.from_step_size(int((time[1] - time[0]) * NANOSECONDS))
    slave = execution.add_local_slave(CosimLocalSlave(fmu_path=str(fmu), instance_name="x"))
    manipulator, observer = CosimManipulator.create_override(), CosimObserver.create_last_value()
    execution.add_manipulator(manipulator)
    execution.add_observer(observer)
    results: Table = {"time": table["time"], **{name: [[]] for name in outputs}}
    for row in range(len(time) - 1):
        for type_, cast in _CASTS.items():
            names = [name for name in table if name != "time" and variables[name].type == type_]
            if names:
                set_values = getattr(manipulator, f"slave_{type_.lower()}_values")
                values = [cast(table[name][row][0]) for name in names]
                set_values(slave, [variables[name].valueReference for name in names], values)
        if not execution.step():
            raise RuntimeError(f"step {row} failed")
        for type_ in _CASTS:
            names = [name for name, its in outputs.items() if its == type_]
            if names:
                get_values = getattr(observer, f"last_{type_.lower()}_values")
                values = get_values(slave, [variables[name].valueReference for name in names])
                for name, value in zip(names, values, strict=True):
                    results[name].append([float(value)])
    return results


def _variables(fmu: Path) -> dict[str, Any]:
    import fmpy

    return {v.name: v for v in fmpy.read_model_description(str(fmu), validate=False).modelVariables}


def _scalar_outputs(fmu: Path) -> dict[str, str]:
    """Return the type by name of the outputs that numbers can be read from."""
    return {n: v.type for n, v in _variables(fmu).items() if v.causality == "output" and v.type in _CASTS}


IMPORTERS: dict[str, tuple[str, tuple[str, ...], Callable[[Path, Table], Table]]] = {
    "FMPy": ("fmpy", ("2.0", "3.0"), run_fmpy),
    "ecos": ("ecospy", ("2.0",), run_ecos),
    "libcosim": ("libcosimpy", ("2.0",), run_libcosim),
}
"""Package on PyPI, versions of FMI that it is driven with, and how, by name of the importer."""


def main(arguments: list[str]) -> None:
    """Run one importer over one table."""
    name, fmu, table, result = arguments
    write_table(Path(result), IMPORTERS[name][2](Path(fmu), read_table(Path(table))))


if __name__ == "__main__":
    main(sys.argv[1:])
