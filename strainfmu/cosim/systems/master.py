"""The co-simulation master: one loop over connected FMI 2.0 FMUs.

Gauss-Seidel in topological order: an instance is stepped after all that feed it and gets their outputs of the
same communication point, so a series of FMUs has no delay, and the outputs at the start are right already. A cycle
of FMUs needs a delayed connection: its target gets what the source gave at the communication point before.
"""

import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, inf
from os import PathLike
from pathlib import Path
from time import perf_counter_ns
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.cosim.systems.instance import Instance, SignalBlock, read_description, safe_temporary_parent, unzip
from strainfmu.cosim.systems.recording import Recording
from strainfmu.cosim.systems.system import (
    Connection,
    System,
    check_connections,
    find_variable,
    split_signal,
    stepping_order,
    unit_of,
)
from strainfmu.errors import InputError

Progress = Callable[[float], None]


@dataclass(frozen=True)
class _Wired:
    """An instance with its exchange made ready for the loop."""

    instance: Instance
    inputs: list[SignalBlock]
    delayed: list[SignalBlock]
    outputs: list[SignalBlock]
    step: Callable[[float, float], None]

    def feed(self, signals: FloatArray) -> None:
        """Set the inputs that are connected without delay from the vector of all signals."""
        for block in self.inputs:
            block.buffer[:] = signals[block.columns]
            block.call()

    def feed_delayed(self, signals: FloatArray) -> None:
        """Set the inputs that are connected with a delay from the signals of the communication point before."""
        for block in self.delayed:
            block.buffer[:] = signals[block.columns]
            block.call()

    def read(self, signals: FloatArray) -> None:
        """Get the outputs in use into the vector of all signals."""
        for block in self.outputs:
            block.call()
            signals[block.columns] = block.buffer


def simulate(
    system: System,
    stop_time: float,
    communication_step_size: float,
    record: Sequence[str] | None = None,
    progress: Progress | None = None,
    at_once: bool = False,
) -> Recording:
    """Simulate ``system`` from time 0 and return what was recorded, the start included.

    Parameters
    ----------
    stop_time : end [s]; the last step is shorter where it is no multiple of the step size.
    communication_step_size : time between communication points [s].
    record : signals ``instance.variable`` to record; None records all outputs that are numbers.
    progress : called with the simulated time [s] after every step.
    at_once : step all instances with the outputs of the communication point before (Jacobi), as most
        other engines do: every connection then has a delay of one step. The start is the same.

    Raises
    ------
    InputError
        An FMU is missing or damaged, a name is unknown, or a connection or a time is impossible.
    StrainfmuError
        fmpy is not installed, or an FMU failed; the message includes the FMU's log.
    """
    time = communication_points(stop_time, communication_step_size)
    descriptions = {name: read_description(Path(path)) for name, path in system.instances.items()}
    _check_system(system, descriptions, time)
    order = stepping_order(system)
    recorded = _recorded_signals(descriptions, order) if record is None else tuple(record)
    units = tuple(unit_of(find_variable(signal, descriptions)) for signal in recorded)
    signals = tuple(dict.fromkeys((*recorded, *(connection.source for connection in system.connections))))

    with _instances(system, descriptions, order) as instances:
        wired = [_wire(instances[name], system, signals) for name in order]
        current = np.full(len(signals), np.nan)
        _initialize(wired, system, stop_time, current)
        values = np.empty((len(time), len(recorded)))
        values[0] = current[: len(recorded)]
        step_cost = _run(wired, time, current, values, progress, at_once)
    return Recording(time=time, names=recorded, units=units, values=values, instances=order, step_cost=step_cost)


def communication_points(stop_time: float, communication_step_size: float) -> FloatArray:
    """Return the (n,) communication points from 0 to ``stop_time`` [s].

    Raises
    ------
    InputError
        A time is not positive and finite, or the step is longer than the simulation.
    """
    for name, value in (("stop_time", stop_time), ("communication_step_size", communication_step_size)):
        if not 0.0 < value < inf:
            raise InputError(f"{name}: expected a positive time, got {value:g} s")
    if communication_step_size > stop_time:
        raise InputError(
            f"communication_step_size: {communication_step_size:g} s found, "
            f"at most stop_time, {stop_time:g} s, allowed"
        )
    # Multiplied, not summed up, so that points carry no growing round-off.
    n_steps = ceil(stop_time / communication_step_size * (1.0 - 1e-12))
    return np.append(np.arange(n_steps) * communication_step_size, stop_time)


def matching_connections(
    source: str, target: str, instances: Mapping[str, str | PathLike[str]]
) -> tuple[Connection, ...]:
    """Return connections from every output of ``source`` to the input of ``target`` of the same name.

    Raises
    ------
    InputError
        An FMU is missing or damaged, or no name matches.
    """
    outputs = {v.name for v in read_description(instances[source]).modelVariables if v.causality == "output"}
    inputs = [v.name for v in read_description(instances[target]).modelVariables if v.causality == "input"]
    pairs = tuple(Connection(f"{source}.{name}", f"{target}.{name}") for name in inputs if name in outputs)
    if not pairs:
        raise InputError(f"no output of '{source}' has the name of an input of '{target}'")
    return pairs


def _check_system(system: System, descriptions: Mapping[str, Any], time: FloatArray) -> None:
    """Refuse a system before anything is loaded."""
    if not system.instances:
        raise InputError("system: expected at least one instance, got none")
    paths = [Path(path).resolve() for path in system.instances.values()]
    for name, path in zip(system.instances, paths, strict=True):
        interface = descriptions[name].coSimulation
        if "." in name:
            raise InputError(f"instance '{name}': a dot found, instance names must hold none")
        if interface.canBeInstantiatedOnlyOncePerProcess and paths.count(path) > 1:
            raise InputError(f"instance '{name}': {path} can be instantiated only once per process")
        uneven = len(time) > 2 and not np.isclose(time[-1] - time[-2], time[1], rtol=1e-6)
        if uneven and not interface.canHandleVariableCommunicationStepSize:
            raise InputError(f"instance '{name}': {path} needs equal steps, stop_time must be a multiple of them")
    check_connections(system, descriptions)
    for signal in system.start_values:
        causality = find_variable(signal, descriptions).causality
        if causality not in ("input", "parameter"):
            raise InputError(f"start value '{signal}': is of causality {causality}, not input or parameter")


def _recorded_signals(descriptions: Mapping[str, Any], order: Sequence[str]) -> tuple[str, ...]:
    """Return all outputs that are numbers."""
    return tuple(
        f"{name}.{variable.name}"
        for name in order
        for variable in descriptions[name].modelVariables
        if variable.causality == "output" and variable.type != "String"
    )


@contextmanager
def _instances(
    system: System, descriptions: Mapping[str, Any], order: Sequence[str]
) -> Iterator[dict[str, Instance]]:
    """Load the instances; afterwards free them, remove their files and what they did to Python's imports."""
    python_path = list(sys.path)
    with ExitStack() as stack:
        stack.callback(_forget_imports, python_path)
        parent = safe_temporary_parent()
        folder = Path(
            stack.enter_context(
                tempfile.TemporaryDirectory(prefix="strainfmu_", dir=parent, ignore_cleanup_errors=True)
            )
        )
        loaded: dict[str, Instance] = {}
        unzipped: dict[Path, Path] = {}
        for name in order:
            path = Path(system.instances[name])
            if path not in unzipped:
                unzipped[path] = folder / str(len(unzipped))
                unzip(path, unzipped[path])
            loaded[name] = Instance(name, path, descriptions[name], unzipped[path])
            stack.callback(loaded[name].close)
        yield loaded


def _forget_imports(python_path: list[str]) -> None:
    """Undo what PythonFMU does to the interpreter: folders on sys.path, and its own modules from an FMU."""
    added = set(sys.path) - set(python_path)
    sys.path[:] = python_path
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__file__", None)
        if file and any(Path(folder) in Path(file).parents for folder in added):
            del sys.modules[name]


def _wire(instance: Instance, system: System, signals: Sequence[str]) -> _Wired:
    """Look up value references once; the loop uses arrays only."""
    column = {signal: index for index, signal in enumerate(signals)}
    variables = {variable.name: variable for variable in instance.description.modelVariables}
    prefix = f"{instance.name}."

    def blocks(delayed: bool) -> list[SignalBlock]:
        feeding = [c for c in system.connections if c.target.startswith(prefix) and c.delayed == delayed]
        targets = [variables[c.target.removeprefix(prefix)] for c in feeding]
        return instance.block("Set", targets, [column[c.source] for c in feeding])

    sources = [signal for signal in signals if signal.startswith(prefix)]
    read = [variables[signal.removeprefix(prefix)] for signal in sources]
    return _Wired(
        instance=instance,
        inputs=blocks(delayed=False),
        delayed=blocks(delayed=True),
        outputs=instance.block("Get", read, [column[signal] for signal in sources]),
        step=instance.stepper(),
    )


def _initialize(wired: Sequence[_Wired], system: System, stop_time: float, current: FloatArray) -> None:
    """Set start values and initialize all, each after those that feed it; delayed inputs start as they are."""
    for item in wired:
        _set_start_values(item.instance, system)
        item.instance.begin(stop_time)
    for item in wired:
        item.feed(current)
        item.instance.end_initialization()
        item.read(current)


def _set_start_values(instance: Instance, system: System) -> None:
    """Set the start values of one instance."""
    values = {
        s: v for s, v in system.start_values.items() if split_signal(s, system.instances)[0] == instance.name
    }
    variables = [find_variable(signal, {instance.name: instance.description}) for signal in values]
    numbers = np.array(list(values.values()), dtype=float)
    for block in instance.block("Set", variables, range(len(variables))):
        block.buffer[:] = numbers[block.columns]
        block.call()


def _run(
    wired: Sequence[_Wired],
    time: FloatArray,
    current: FloatArray,
    values: FloatArray,
    progress: Progress | None,
    at_once: bool,
) -> FloatArray:
    """Step all instances through ``time``, fill ``values``; return the (n - 1, n_i) cost of the steps [s]."""
    cost = np.empty((len(time) - 1, len(wired)))
    points = time.tolist()
    n_recorded = values.shape[1]
    before = current.copy()
    for k, (start, end) in enumerate(pairwise(points)):
        before[:] = current
        for i, item in enumerate(wired):
            began = perf_counter_ns()
            item.feed(before if at_once else current)
            item.feed_delayed(before)
            item.step(start, end - start)
            item.read(current)
            cost[k, i] = perf_counter_ns() - began
        values[k + 1] = current[:n_recorded]
        if progress is not None:
            progress(end)
    return cost * 1e-9
