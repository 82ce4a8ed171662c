"""The sub-commands of ``strainfmu``: arguments in, calls into the packages, tables out; one file per theme."""

from collections.abc import Container
from functools import partial
from importlib import import_module
from typing import Annotated, Any

import typer

from strainfmu.cli.commands.command import ProgramCommand, ProgramGroup
from strainfmu.cli.commands.described import command_function
from strainfmu.cli.commands.help_layout import COMMANDS, MODULES
from strainfmu.version import __version__


def _show_version(requested: bool) -> None:
    if requested:
        print(f"strainfmu {__version__}")
        raise typer.Exit


def _root(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and leave."),
    ] = False,
) -> None:
    """Aerodynamic loads in real time from structural strain."""


def _run(command: str, **options: Any) -> None:
    getattr(import_module(f"{__name__}.{MODULES[command]}"), command)(**options)


def program(names: Container[str] = MODULES, *, with_options: bool = True) -> typer.Typer:
    """Return the program with the commands ``names``; a command imports its module when it runs.

    A list of the commands needs none of their options.
    """
    app = typer.Typer(
        cls=ProgramGroup,
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        help="Aerodynamic loads in real time from structural strain.",
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_root)
    for panel, commands in COMMANDS.items():
        for name in commands:
            if name in names:
                function = command_function(name, partial(_run, name), with_options=with_options)
                app.command(cls=ProgramCommand, rich_help_panel=panel)(function)
    return app
