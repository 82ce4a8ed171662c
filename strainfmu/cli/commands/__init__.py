"""The sub-commands of ``strainfmu``: arguments in, calls into the packages, tables out; one file per theme."""

from __future__ import annotations

from collections.abc import Callable
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
    placements,
    reproduction,
    stress,
    structures,
    taring,
    trade_studies,
    whole_way,
)
from strainfmu.cli.commands.command import ProgramCommand, ProgramGroup
from strainfmu.cli.commands.help_layout import COMMANDS
from strainfmu.version import __version__

app = typer.Typer(
    cls=ProgramGroup,
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


FUNCTIONS: dict[str, Callable[..., None]] = {
    function.__name__: function
    for function in (
        calibration.calibrate,
        can_bus.bridge,
        can_bus.dbc,
        can_data.channels,
        can_data.estimate,
        can_data.monitor,
        can_data.replay,
        can_send.send,
        comparison.compare,
        flights.fly,
        flights.plant,
        flows.convert,
        flows.snapshots,
        flows.surface,
        load_tests.loadtest,
        maps.bench,
        maps.build,
        maps.crosscheck,
        maps.export,
        maps.inspect,
        pictures.picture,
        placements.place,
        placements.review,
        reproduction.reproduce,
        stress.stress,
        trade_studies.study,
        structures.structure,
        taring.tare,
        whole_way.check,
        whole_way.demo,
    )
}
"""The commands by their names; :data:`~help_layout.COMMANDS` has their order in the help."""

for panel, names in COMMANDS.items():
    for name in names:
        app.command(cls=ProgramCommand, rich_help_panel=panel)(FUNCTIONS[name])
