"""Panels of a run's signals, in the units that people read, for the pages of plant, autopilot and schedule."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from strainfmu.fmu.reference_run import ReferenceRun
from strainfmu.fmu.run_figure import Line, Panel, run_figure
from strainfmu.interface.fmi_variables import UNITS, Variable


def signals_panel(
    run: ReferenceRun, interface: Sequence[Variable], title: str, names: Mapping[str, str], in_steps: bool
) -> Panel | None:
    """Return a panel of inputs and outputs of ``run``, text of the legend by name; None where it has none of them.

    All are shown in the display unit of the first. Inputs and discrete outputs are always drawn in steps.
    """
    variables = {variable.name: variable for variable in interface}
    signals = {**run.inputs, **run.outputs}
    found = [variables[name] for name in names if name in signals]
    if not found:
        return None
    unit, factor = shown_unit(found[0])
    lines = [
        Line(
            name=names[variable.name],
            values=factor * signals[variable.name],
            steps=in_steps or variable.causality == "input" or variable.variability == "discrete",
        )
        for variable in found
    ]
    return Panel(title=f"{title} [{unit}]" if unit else title, lines=lines)


def shown_unit(variable: Variable) -> tuple[str, float]:
    """Return the unit that people read, "" for none, and the factor to it."""
    for unit in UNITS:
        for display in unit.display_units:
            if unit.name == variable.unit and display.name == variable.display_unit:
                return display.name, display.factor
    return variable.unit or "", 1.0


def signals_figure(
    run: ReferenceRun,
    interface: Sequence[Variable],
    groups: Mapping[str, Mapping[str, str]],
    in_steps: bool = False,
) -> str:
    """Return an SVG with a panel per group: legend by name of the signal, by title of the panel."""
    found = [
        signals_panel(run=run, interface=interface, title=title, names=names, in_steps=in_steps)
        for title, names in groups.items()
    ]
    panels = [panel for panel in found if panel is not None]
    return run_figure(run.time, panels, f"Reference run: {', '.join(panel.title for panel in panels)}")
