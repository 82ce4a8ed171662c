"""A system of connected FMUs: what there is, what goes where, and in which order it is stepped."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from os import PathLike
from typing import Any

from strainfmu.errors import InputError


@dataclass(frozen=True)
class Connection:
    """An output that feeds an input, both as ``instance.variable``.

    A delayed connection carries the output of the communication point before. Every cycle needs one.
    """

    source: str
    target: str
    delayed: bool = False

    def __str__(self) -> str:
        return f"{self.source} -> {self.target}"


@dataclass(frozen=True)
class System:
    """Instances of FMUs and what connects them.

    Attributes
    ----------
    instances : path of the FMU by name of the instance; names hold no dot.
    connections : at most one per input.
    start_values : value by ``instance.variable``, for inputs and parameters, set before initialization.
    """

    instances: Mapping[str, str | PathLike[str]]
    connections: Sequence[Connection] = ()
    start_values: Mapping[str, float] = field(default_factory=dict)


def split_signal(signal: str, instances: Mapping[str, Any]) -> tuple[str, str]:
    """Return instance and variable of ``instance.variable``.

    Raises
    ------
    InputError
        There is no such instance.
    """
    instance, dot, variable = signal.partition(".")
    if not dot or instance not in instances:
        raise InputError(f"signal '{signal}': no instance '{instance}', there are {', '.join(instances)}")
    return instance, variable


def find_variable(signal: str, descriptions: Mapping[str, Any]) -> Any:
    """Return fmpy's ScalarVariable of ``instance.variable``.

    Raises
    ------
    InputError
        There is no such instance or variable, or it is a String.
    """
    instance, name = split_signal(signal, descriptions)
    for variable in descriptions[instance].modelVariables:
        if variable.name == name:
            if variable.type == "String":
                raise InputError(f"signal '{signal}': is a String, only numbers can be used")
            return variable
    raise InputError(f"signal '{signal}': the FMU of '{instance}' has no variable '{name}'")


def unit_of(variable: Any) -> str:
    """Return the unit of fmpy's ScalarVariable, from its type if need be; "" if it has none."""
    declared = variable.declaredType.unit if variable.declaredType is not None else None
    return variable.unit or declared or ""


def check_connections(system: System, descriptions: Mapping[str, Any]) -> None:
    """Refuse connections that cannot be meant.

    Raises
    ------
    InputError
        An end is unknown, of the wrong causality or type, fed twice, or the units differ.
    """
    fed: dict[str, Connection] = {}
    for connection in system.connections:
        source = find_variable(connection.source, descriptions)
        target = find_variable(connection.target, descriptions)
        if source.causality != "output":
            raise InputError(f"connection {connection}: the source is of causality {source.causality}, not output")
        if target.causality != "input":
            raise InputError(f"connection {connection}: the target is of causality {target.causality}, not input")
        if connection.target in fed:
            raise InputError(f"connection {connection}: {fed[connection.target].source} feeds that input already")
        if (source.type == "Real") != (target.type == "Real"):
            raise InputError(f"connection {connection}: {source.type} cannot feed {target.type}")
        if unit_of(source) and unit_of(target) and unit_of(source) != unit_of(target):
            raise InputError(
                f"connection {connection}: unit '{unit_of(source)}' cannot feed unit '{unit_of(target)}'"
            )
        fed[connection.target] = connection


def stepping_order(system: System) -> tuple[str, ...]:
    """Return the instances so that every source is stepped before what it feeds without delay.

    Raises
    ------
    InputError
        The connections form a cycle without a delay, which would need an iteration.
    """
    graph: dict[str, set[str]] = {name: set() for name in system.instances}
    for connection in system.connections:
        source, _ = split_signal(connection.source, system.instances)
        target, _ = split_signal(connection.target, system.instances)
        if not connection.delayed:
            graph[target].add(source)
    try:
        return tuple(TopologicalSorter(graph).static_order())
    except CycleError as error:
        raise InputError(
            f"connections form a cycle: {' -> '.join(error.args[1])}; one of them must be delayed"
        ) from error
