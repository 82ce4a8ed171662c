"""Options that all commands of the bus share, checked before anything is opened."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable
from importlib import import_module

from strainfmu.errors import InputError

_QUOTED = re.compile(r"""(["'])(\w+)\1""")


_ENTRIES = {
    "--dbc": "input.dbc",
    "--mapping": "input.mapping",
    "--cycle-time": "input.cycle_time_ms",
    "--id-base": "input.id_base",
    "--result-base": "results.id_base",
    "--extended": "input.extended",
    "--key": "input.key",
    "--freshness": "input.freshness",
    "--dynamic-pressure": "input.dynamic_pressure_pa",
    "--result": "results.form",
    "--stuck-cycles": "trust.stuck_cycles",
    "--max-age": "trust.max_age_cycles",
    "--clock-tolerance": "clock.tolerance_ppm",
    "--synchronised": "clock.synchronised_ms",
    "--publish": "page.publish",
    "--publish-rate": "page.rate_hz",
    "--publish-field": "page.field",
    "--zeros": "zeros.file",
    "--tare": "tare.map",
    "--tare-cycles": "tare.cycles",
    "--tare-known": "tare.known",
    "--tare-output": "tare.output",
    "--tare-at": "tare.at_s",
}
"""The entry of the bus file that replaces an option."""

_FRAMES = ("--cycle-time", "--id-base", "--result-base", "--extended")

OLD_OPTIONS: dict[str, dict[str, str]] = {
    command: {option: _ENTRIES[option] for option in options}
    for command, options in {
        "bridge": (
            *_FRAMES,
            "--dbc",
            "--mapping",
            "--key",
            "--freshness",
            "--dynamic-pressure",
            "--result",
            "--stuck-cycles",
            "--max-age",
            "--clock-tolerance",
            "--synchronised",
            "--publish",
            "--publish-rate",
            "--publish-field",
            "--zeros",
            "--tare",
            "--tare-cycles",
            "--tare-known",
            "--tare-output",
        ),
        "send": (
            *_FRAMES,
            "--key",
            "--freshness",
            "--dynamic-pressure",
            "--tare-at",
        ),
        "dbc": (*_FRAMES, "--tare"),
        "replay": (*_FRAMES, "--dbc", "--mapping", "--key", "--dynamic-pressure", "--zeros"),
    }.items()
}
"""Options that a command had, and the entry of the bus file that replaces each."""

OLD_SOURCES = {"--data": "the argument DATA", "--scenario": "the argument DATA", "--files": "the folder of --map"}
"""Options that ``send`` had, and what replaces each."""


def refuse_old_options(command: str, arguments: Iterable[str]) -> None:
    """Refuse an option that is an entry of the bus file by now.

    Raises
    ------
    InputError
        There is one; the message has the entry.
    """
    for argument in arguments:
        option = argument.partition("=")[0]
        entry = OLD_OPTIONS.get(command, {}).get(option)
        if entry is not None:
            table, _, name = entry.partition(".")
            raise InputError(
                f"{option}: state it as entry {name} of [{table}] in the bus file, or by --set {entry}=VALUE"
            )
        if command == "send" and option in OLD_SOURCES:
            raise InputError(f"{option}: is replaced by {OLD_SOURCES[option]}: strainfmu send DATA --map map.h5")


def check_bus_options(interface: str, names: Iterable[str]) -> None:
    """Refuse options that nothing of the interface reads: python-can ignores them silently.

    Raises
    ------
    InputError
        An option is not one of the interface's.
    """
    known = known_bus_options(interface)
    for name in names:
        if known is not None and name not in known:
            stated = ", ".join(sorted(_parameters(interface)))
            raise InputError(f"--bus-option: expected an option of {interface} ({stated}), got '{name}'")


def known_bus_options(interface: str) -> frozenset[str] | None:
    """Return every name that an interface of python-can may read, None where that cannot be known.

    Some read further options out of their keyword arguments: these stand in quotes in their source. A bit timing's
    parameters may always be stated one by one. Interfaces of others, and what does not load here, cannot be known.
    """
    from strainfmu.can.frame import import_can

    can = import_can()
    classes = _classes(interface)
    if not classes or not all(one.__module__.startswith("can.") for one in classes):
        return None
    names = {*_parameters(interface), "config_context", "ignore_config"}
    for one in (can.BitTiming, can.BitTimingFd):
        names |= set(inspect.signature(one).parameters)
    try:
        for module in {one.__module__ for one in classes}:
            names |= {match[2] for match in _QUOTED.finditer(inspect.getsource(import_module(module)))}
    except OSError:  # installed without its source
        return None
    return frozenset(names)


def _parameters(interface: str) -> set[str]:
    """Return what the constructors of an interface name, but for channel and what is no name."""
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    stated = [inspect.signature(one).parameters.values() for one in _classes(interface)]
    return {entry.name for entries in stated for entry in entries if entry.kind in kinds} - {"channel"}


def _classes(interface: str) -> list[type]:
    """Return the class of an interface and its bases, none if it does not load: opening it reports why."""
    from can.interfaces import BACKENDS

    if interface not in BACKENDS:
        return []
    module, name = BACKENDS[interface]
    try:
        found: type = getattr(import_module(module), name)
    except Exception:  # each vendor's driver is missing in its own way
        return []
    return [one for one in found.__mro__ if one.__module__.split(".")[0] not in ("builtins", "abc")]
