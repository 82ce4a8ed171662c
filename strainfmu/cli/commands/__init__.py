"""The sub-commands of ``strainfmu``: arguments in, calls into the packages, tables out; one file per theme."""

from __future__ import annotations

from collections.abc import Container
from importlib import import_module
from typing import Annotated

import typer

from strainfmu.cli.commands.command import ProgramCommand, ProgramGroup
from strainfmu.cli.commands.help_layout import COMMANDS
from strainfmu.version import __version__

MODULES = {
    "bench": "maps",
    "bridge": "can_bus",
    "build": "maps",
    "calibrate": "calibration",
    "channels": "can_data",
    "check": "whole_way",
    "compare": "trials",
    "convert": "flows",
    "crosscheck": "maps",
    "dbc": "can_bus",
    "demo": "whole_way",
    "equations": "calibration",
    "estimate": "can_data",
    "export": "maps",
    "fly": "flights",
    "inspect": "maps",
    "loadtest": "load_tests",
    "monitor": "can_data",
    "picture": "pictures",
    "place": "placements",
    "plant": "flights",
    "replay": "can_data",
    "reproduce": "reproduction",
    "review": "placements",
    "send": "can_send",
    "snapshots": "flows",
    "stress": "trials",
    "structure": "structures",
    "study": "trade_studies",
    "surface": "flows",
    "tare": "taring",
    "trial": "trials",
}
"""Module of each command, whose function has its name; :data:`~help_layout.COMMANDS` has the order in the help."""


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


def program(names: Container[str] = MODULES) -> typer.Typer:
    """Return the program with the commands ``names``, whose modules are imported."""
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
                function = getattr(import_module(f"{__name__}.{MODULES[name]}"), name)
                app.command(cls=ProgramCommand, rich_help_panel=panel)(function)
    return app
