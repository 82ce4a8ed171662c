"""Each command is one public function, with the same options as keywords and the same defaults."""

from __future__ import annotations

import inspect
from importlib import import_module
from math import pi
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import pytest

from strainfmu.cli.commands import MODULES
from strainfmu.cli.commands.help_layout import public_functions

pytestmark = pytest.mark.fast

ONLY_PRINTED = {"verbose"}
"""Options of what is printed."""

CHOOSE_A_FUNCTION = {
    "bench": {"worst"},
    "fly": {"figures"},
    "loadtest": {"template"},
}
"""Options that choose one of the functions of a command."""


def functions(command: str) -> list[Any]:
    """Return the functions that a command names in the reference."""
    dotted = [name.partition(".") for name in public_functions(command)]
    return [getattr(import_module(package), name) for package, _, name in dotted]


def command(name: str) -> Any:
    return getattr(import_module(f"strainfmu.cli.commands.{MODULES[name]}"), name)


def default(name: str, parameter: inspect.Parameter, hint: Any) -> Any:
    """Return the default of an option as its function has it: in SI units, lists for text, text for paths."""
    value = parameter.default
    for info in get_args(hint)[1:] if get_origin(hint) is Annotated else ():
        if getattr(info, "callback", None) and value is not None:
            value = info.callback(type("Parameter", (), {"opts": [f"--{name}"]}), value)
    return value


def same(of_option: Any, of_function: Any) -> bool:
    """Return whether an option and a keyword have one default; nothing is None, an empty text or an empty list."""
    if isinstance(of_option, Path):
        of_option = str(of_option)
    if isinstance(of_option, str) and isinstance(of_function, tuple | list):
        parts = [part for part in of_option.split(",") if part]
        if of_function and isinstance(of_function[0], float):
            return not parts or [float(part) * pi / 180.0 for part in parts] == pytest.approx(list(of_function))
        return parts == list(of_function)
    if isinstance(of_option, float) and isinstance(of_function, float):
        return of_option == pytest.approx(of_function)
    return of_option == of_function or not (of_option or of_function)


@pytest.mark.parametrize("name", sorted(MODULES))
def test_options_of_a_command_are_keywords_with_the_same_defaults(name: str) -> None:
    found = functions(name)
    keywords = {n: p for function in reversed(found) for n, p in inspect.signature(function).parameters.items()}
    options, hints = (
        inspect.signature(command(name)).parameters,
        get_type_hints(command(name), include_extras=True),
    )
    wanted = options.keys() - ONLY_PRINTED - CHOOSE_A_FUNCTION.get(name, set())
    assert wanted - keywords.keys() == set()
    empty = inspect.Parameter.empty
    others = {
        option: (value, keywords[option].default)
        for option in sorted(wanted)
        if empty not in (keywords[option].default, options[option].default)
        and not same(value := default(option, options[option], hints[option]), keywords[option].default)
    }
    assert others == {}
