"""The sub-commands of ``strainfmu``: arguments in, calls into the packages, tables out; one file per theme."""

from __future__ import annotations

from typing import Annotated

import typer

from strainfmu.cli.commands import (
    calibration,
    can_bus,
    can_data,
    can_send,
    comparison,
    flights,
    flows,
    load_tests,
    maps,
    pictures,
    reproduction,
    stress,
    structures,
    taring,
    whole_way,
)
from strainfmu.cli.commands.outputs import CheckedCommand
from strainfmu.version import __version__

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Aerodynamic loads in real time from structural strain.",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(requested: bool) -> None:
    if requested:
        print(f"strainfmu {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and leave."),
    ] = False,
) -> None:
    """Aerodynamic loads in real time from structural strain."""


for command in (
    whole_way.demo,
    whole_way.check,
    reproduction.reproduce,
    flows.snapshots,
    flows.surface,
    flows.convert,
    structures.structure,
    maps.build,
    calibration.calibrate,
    maps.export,
    maps.crosscheck,
    maps.inspect,
    maps.bench,
    pictures.picture,
    load_tests.loadtest,
    stress.stress,
    comparison.compare,
    flights.fly,
    flights.plant,
    can_bus.bridge,
    can_bus.dbc,
    can_send.send,
    can_data.replay,
    can_data.estimate,
    taring.tare,
    can_data.monitor,
):
    app.command(cls=CheckedCommand)(command)
