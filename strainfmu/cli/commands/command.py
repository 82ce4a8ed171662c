"""A command of the program: its help in panels, and options refused that do not go together."""

import sys
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

from typer.core import TyperCommand, TyperGroup

from strainfmu.cli.commands.help_layout import EXCLUDES, NEEDS, OLD_VALUES, OPTIONS, PAGES
from strainfmu.errors import InputError
from strainfmu.written_files import check_outputs

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

OLD_OPTIONS = dict.fromkeys(("bridge", "dbc", "replay", "send"), _ENTRIES)
"""Options that commands had, and the entry of the bus file that replaces each."""

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


class ProgramGroup(TyperGroup):
    """The program: its commands in the order of their panels."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        for parameter in self.params:
            _without_type(parameter)

    def get_help_option(self, ctx: Any) -> Any:
        """Return ``--help``, shown without a type."""
        return _without_type(super().get_help_option(ctx))

    def main(
        self, args: Sequence[str] | None = None, prog_name: str | None = None, *rest: Any, **settings: Any
    ) -> Any:
        """Run the program. Its help is shown at once: typer would import pydantic to read ``--help``."""
        arguments = sys.argv[1:] if args is None else args
        if {"-h", "--help"}.isdisjoint(arguments):
            return super().main(args, prog_name, *rest, **settings)
        context = self.context_class(self, info_name=prog_name, **self.context_settings)
        command = self.get_command(context, arguments[0])
        if command is not None:
            context = command.context_class(command, context, command.name, **command.context_settings)
        elif not arguments[0].startswith("-"):
            return super().main(args, prog_name, *rest, **settings)
        context.command.get_help(context)  # prints it
        return 0


class ProgramCommand(TyperCommand):
    """A command that checks which options were given together and which files it writes, before it begins."""

    def __init__(self, name: str | None, **settings: Any) -> None:
        super().__init__(name, **settings)
        self.help = unwrapped(self.help or "")
        self.epilog = f"Documentation: {PAGES[name]}" if name in PAGES else None
        panels = {option: panel for panel, options in OPTIONS.get(name or "", {}).items() for option in options}
        for parameter in self.params:
            if parameter.name in panels:
                # An attribute of typer's parameters, which click's type does not have.
                parameter.rich_help_panel = panels[parameter.name]  # type: ignore[attr-defined]
            if parameter.param_type_name == "argument" and not parameter.metavar:
                parameter.metavar = (parameter.name or "").upper()
            _without_type(parameter)

    def get_help_option(self, ctx: Any) -> Any:  # the context of the click that typer comes with
        """Return ``--help``, shown without a type."""
        return _without_type(super().get_help_option(ctx))

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Refuse values and options under their old names, then read the arguments."""
        refuse_old_values(args)
        refuse_old_options(self.name or "", args)
        read: list[str] = super().parse_args(ctx, args)
        return read

    def invoke(self, ctx: Any) -> Any:
        """Check the parameters and run the command."""
        check_outputs(ctx.params)
        sources = {param.name: ctx.get_parameter_source(param.name) for param in self.params if param.name}
        stated = {name for name, source in sources.items() if getattr(source, "name", "") == "COMMANDLINE"}
        check_together(self.name or "", stated, {p.name or "": max(p.opts, key=len) for p in self.params})
        return super().invoke(ctx)


def check_together(command: str, stated: set[str], options: Mapping[str, str]) -> None:
    """Refuse options of a command that need or exclude each other, by :data:`~help_layout.NEEDS` and its like.

    Parameters
    ----------
    command : name of the command.
    stated : names of the parameters that the user stated.
    options : the option of each parameter.

    Raises
    ------
    InputError
        An option was given without one that it needs, or with one that it excludes.
    """
    for name, needed in NEEDS.get(command, {}).items():
        if name in stated and not stated.intersection(needed):
            listed = " or ".join(options[name] for name in needed)
            raise InputError(f"{options[name]}: expected with {listed}, got it alone")
    for group in EXCLUDES.get(command, ()):
        several = [options[name] for name in group if name in stated]
        if len(several) > 1:
            raise InputError(f"{several[-1]}: expected without {several[0]}, got both")


def refuse_old_values(arguments: list[str]) -> None:
    """Refuse the value of an option that has a new name.

    Raises
    ------
    InputError
        There is one; the message has the new name.
    """
    words = [word for argument in arguments for word in argument.split("=", 1)]
    for pair in pairwise(words):
        if pair in OLD_VALUES:
            option, value = pair
            raise InputError(f"{option}: '{value}' is now called '{OLD_VALUES[pair]}'")


def unwrapped(text: str) -> str:
    """Return ``text`` with one line per paragraph, each with its indent: the terminal wraps them."""
    paragraphs = [paragraph.rstrip() for paragraph in text.split("\n\n")]
    return "\n\n".join(
        paragraph[: len(paragraph) - len(paragraph.lstrip())].strip("\n") + " ".join(paragraph.split())
        for paragraph in paragraphs
    )


def _without_type(parameter: Any) -> Any:
    """Show no type for a flag, whose name says all."""
    if getattr(parameter, "is_flag", False) and not parameter.metavar:
        parameter.metavar = ""
    return parameter
