"""Options of a bus from python-can's configuration files and environment, each with the place that sets it.

python-can adds what it finds there to the options of a program without a message. Here an option that was given
always stands, and every other one that a bus is opened with is named.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from configparser import ConfigParser, Error
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from strainfmu.can.wire.libraries import error_line, import_can
from strainfmu.errors import InputError

_DEFAULT = "default"
_OF_CHANNEL = ("interface", "bustype", "channel")
_OF_BIT_RATE = ("bitrate", "data_bitrate", "timing")


@dataclass(frozen=True, kw_only=True)
class FoundOption:
    """An option that was not given: its name and value, and the place that sets it."""

    name: str
    value: Any
    place: str

    def __str__(self) -> str:
        return f"{self.place}: sets {self.name} = {self.value}"


def found_options(given: Mapping[str, Any], context: str | None = None) -> list[FoundOption]:
    """Return the options that python-can's sources add to the ``given`` ones, the first source of each.

    Parameters
    ----------
    context : section of the files, and ending of the variables, that come ahead of the default ones.

    Raises
    ------
    InputError
        No source has such a context, or a file or variable cannot be read.
    """
    kept: dict[str, FoundOption] = {}
    is_context_known = context is None
    # A bit rate that was given is not replaced by a bit timing that is not.
    fixed = {*given, *_OF_CHANNEL}
    if fixed & {*_OF_BIT_RATE, *_timing_names()}:
        fixed |= {*_OF_BIT_RATE, *_timing_names()}
    for of_context, place, options in _sources(context):
        is_context_known |= of_context
        for name, value in options.items():
            if name not in fixed and name not in kept:
                kept[name] = FoundOption(name=name, value=value, place=place)
    if not is_context_known:
        places = ", ".join([*map(str, _files()), f"CAN_CONFIG_{context}"])
        raise InputError(f"bus.context: no '{context}' found in {places}")
    return list(kept.values())


def timing_of(options: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the name of the option that python-can makes of a whole bit timing in ``options``, or nothing."""
    typechecking = import_can().typechecking
    kinds = (typechecking.BitTimingDict, typechecking.BitTimingFdDict)
    return ("timing",) if any(options.keys() >= kind.__annotations__.keys() for kind in kinds) else ()


def _sources(context: str | None) -> Iterator[tuple[bool, str, dict[str, Any]]]:
    """Yield whether a source is of the context, its name and its options, in python-can's order."""
    can = import_can()
    yield False, "can.rc", dict(can.rc)
    contexts = [None] if context is None else [context, None]
    for one in contexts:
        ending = "" if one is None else f"_{one}"
        try:
            found = can.util.load_environment_config(one)
        except ValueError as error:
            raise InputError(f"CAN_CONFIG{ending}: no JSON: {error_line(error)}") from error
        if found:
            yield one is not None, f"environment CAN_*{ending}", found
    for one in contexts:
        section = _DEFAULT if one is None else one
        for path in reversed(_files()):  # the later file has precedence
            if (options := _section(path, section)) is not None:
                yield one is not None, f"{path} [{section}]", options


def _files() -> list[Path]:
    """Return the configuration files of python-can on this system that there are."""
    paths = [Path(os.path.expanduser(name)) for name in import_can().util.CONFIG_FILES]
    return [path for path in paths if path.is_file()]


def _section(path: Path, section: str) -> dict[str, str] | None:
    """Return the entries of a section, None if the file has no such section."""
    parser = ConfigParser()
    parser.optionxform = str  # type: ignore[assignment,method-assign]  # as python-can: names keep their case
    try:
        parser.read(path)
    except (Error, UnicodeDecodeError) as error:
        raise InputError(f"{path}: damaged: {error_line(error)[:200]}") from error
    return dict(parser.items(section)) if parser.has_section(section) else None


def _timing_names() -> set[str]:
    """Return the names of the parameters of a bit timing."""
    typechecking = import_can().typechecking
    return {*typechecking.BitTimingDict.__annotations__, *typechecking.BitTimingFdDict.__annotations__}
