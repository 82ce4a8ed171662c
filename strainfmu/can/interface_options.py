"""Options of the interfaces of python-can, checked before anything is opened."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable
from importlib import import_module

from strainfmu.errors import InputError

_QUOTED = re.compile(r"""(["'])(\w+)\1""")


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
