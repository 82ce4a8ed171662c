"""Each command is one public function: its options are keywords, with the same defaults and a description."""

import inspect
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.main import get_command

from strainfmu.cli.commands.described import command_function, keywords
from strainfmu.cli.commands.help_layout import MODULES, public_functions
from strainfmu.cli.commands.spellings import FLAGS

pytestmark = pytest.mark.fast

NO_OPTIONS = {
    "bench": {"reporter"},
    "bridge": {"running", "say"},
    "estimate": {"files", "summary"},
    "fly": {"flown"},
    "inspect": {"console"},
    "send": {"say", "stopped"},
    "structure": {"mesh"},
    "tare": {"known", "known_of"},
    "trial": {"training"},
}
"""Keywords that no text can stand for, or that another command has as options."""

OUTPUT = ("-o", "out")
ARGUMENTS = dict.fromkeys(("convert", "estimate", "picture", "replay", "surface"), OUTPUT)
ARGUMENTS["tare"] = ("--window", "0:1")
"""Options that have to be given."""


def parameters(command: str) -> dict[str, inspect.Parameter]:
    """Return the parameters of the imported functions of a command; the first function's count."""
    dotted = [name.partition(".") for name in public_functions(command)]
    functions = [getattr(import_module(package), name) for package, _, name in reversed(dotted)]
    return {
        name: one
        for function in functions
        for name, one in inspect.signature(function).parameters.items()
        if one.kind is not inspect.Parameter.VAR_KEYWORD
    }


def same(given: Any, default: Any) -> bool:
    """Return whether a command gives what its function has by default; nothing is None or empty."""
    if isinstance(given, Path):
        given = str(given)
    if isinstance(given, Sequence) and not isinstance(given, str):
        return list(given) == (
            pytest.approx(list(default)) if default and isinstance(default[0], float) else list(default or ())
        )
    if isinstance(given, float) and isinstance(default, float):
        return given == pytest.approx(default, rel=1e-12)
    return bool(given == default) or not (given or default)


@pytest.mark.parametrize("command", sorted(MODULES))
def test_a_command_without_options_gives_the_defaults_of_its_function(command: str) -> None:
    """Units and texts are converted there and back; the source says what the imported function says."""
    given: dict[str, Any] = {}
    app = typer.Typer(add_completion=False)
    app.command()(command_function(command, lambda **options: given.update(options)))
    program: Any = get_command(app)
    needed = [one.name for one in program.params if one.param_type_name == "argument" and one.required]
    program.main(args=[*needed, *ARGUMENTS.get(command, ())], standalone_mode=False)
    known = parameters(command)
    without = NO_OPTIONS.get(command, set()) | {"progress"}
    assert given.keys() - FLAGS.get(command, {}).keys() == known.keys() - without
    wrong = {
        name: (value, known[name].default)
        for name, value in given.items()
        if name in known
        and known[name].default is not inspect.Parameter.empty
        and not same(value, known[name].default)
    }
    assert wrong == {}


@pytest.mark.parametrize("command", sorted(MODULES))
def test_every_option_has_a_description(command: str) -> None:
    texts: Mapping[str, str] = {
        name: one.text
        for function in reversed(public_functions(command))
        for name, one in keywords(function).items()
    }
    assert [name for name, text in texts.items() if not text and name not in NO_OPTIONS.get(command, ())] == []
