"""Panels of the reference run for the pages of FMUs: estimates with bands, signals in units that people read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from math import degrees

import numpy as np

from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.sensors import shown_units
from strainfmu.fmu.documentation.index_page import Section
from strainfmu.fmu.documentation.run_figure import Line, Panel, run_figure
from strainfmu.fmu.reference_run.plant import Reference
from strainfmu.fmu.reference_run.run import ReferenceRun, as_recorded
from strainfmu.interface.fmi_variables import COEFFICIENTS, Variable, shown_unit
from strainfmu.interface.health_names import STATE
from strainfmu.interface.sensor_variables import reading_names

_ANGLE = "air_data.angle_of_attack"
_TITLES = {_ANGLE: "angle of attack"}


def estimate_figure(inverse_map: InverseMap, run: ReferenceRun) -> str:
    """Return an SVG of ``run`` over time: the failing gauge, estimates with bands of 3 sigma and truth, health.

    Estimates are the coefficients and, where the map has tables, the angle of attack. The fault is shaded.
    """
    panels = [_fault_panel(inverse_map, run)]
    for name in (*COEFFICIENTS, _ANGLE):
        if name in run.truth:
            factor, unit = (degrees(1.0), "deg") if name == _ANGLE else (1.0, "1")
            spread = 3.0 * factor * run.outputs[f"sigma.{name}"]
            estimate = Line(name="estimate, 3 sigma", values=factor * run.outputs[name], spread=spread)
            true = Line(name="true", values=factor * run.truth[name], dashed=True)
            panels.append(Panel(title=f"{_TITLES.get(name, name)} [{unit}]", lines=[estimate, true]))
    state = run.outputs[STATE]
    met = sorted({int(value) for value in state})
    place = {value: float(k) for k, value in enumerate(met)}
    shown = np.array([place[int(value)] for value in state])
    words = [(place[value], HealthState(value).name) for value in met]
    panels.append(Panel(title="health", lines=[Line(name="state", values=shown, steps=True)], words=words))
    label = "A failing gauge, estimates with 3 sigma bands and the truth, and the state of health"
    return run_figure(run.time, panels, label, shaded=fault_span(run))


def fault_span(run: ReferenceRun) -> tuple[float, float]:
    """Return the times [s] of the first and the last row of the outputs whose inputs have the fault."""
    assert run.fault is not None
    first, last = run.time[np.flatnonzero(run.fault.fails)[[0, -1]]].tolist()
    return first, last


def _fault_panel(inverse_map: InverseMap, run: ReferenceRun) -> Panel:
    """Return what the failing gauge reads, and what it would read."""
    fault = run.fault
    assert fault is not None
    scale, unit = shown_units(inverse_map.sensors)[fault.gauge]
    reading = (
        as_recorded(run.inputs[reading_names(inverse_map)[fault.gauge]]) / inverse_map.sensors.scale[fault.gauge]
    )
    lines = [
        Line(name="reading", values=scale * reading),
        Line(name="without the fault", values=scale * (reading - fault.size * fault.fails), dashed=True),
    ]
    return Panel(title=f"{inverse_map.gauge_names[fault.gauge]} [{unit}]", lines=lines)


def reference_sections(reference: Reference, interface: Sequence[Variable]) -> list[Section]:
    """Return the section of an FMU's page on its reference run; none where it holds none."""
    if reference.run is None:
        return []
    text = "Input and output of a short run, 6 digits, lie in extra/org.fmi-standard.fmi-ls-ref. Computed with"
    figure = signals_figure(reference.run, interface, reference.groups, in_steps=reference.in_steps)
    return [("Reference run", [f"{text} {escape(reference.source)}.", figure])]


def signals_panel(
    run: ReferenceRun, interface: Sequence[Variable], title: str, names: Mapping[str, str], in_steps: bool
) -> Panel | None:
    """Return a panel of inputs and outputs of ``run``, text of the legend by name; None where it has none of them.

    All are shown in the display unit of the first. Inputs and discrete outputs are always drawn in steps.
    """
    variables = {variable.name: variable for variable in interface}
    signals = {**run.inputs, **run.outputs}
    shown = [variables[name] for name in names if name in signals]
    if not shown:
        return None
    unit, factor = shown_unit(shown[0])
    lines = [
        Line(
            name=names[variable.name],
            values=factor * signals[variable.name],
            steps=in_steps or variable.causality == "input" or variable.variability == "discrete",
        )
        for variable in shown
    ]
    return Panel(title=f"{title} [{unit}]" if unit else title, lines=lines)


def signals_figure(
    run: ReferenceRun,
    interface: Sequence[Variable],
    groups: Mapping[str, Mapping[str, str]],
    in_steps: bool = False,
) -> str:
    """Return an SVG with a panel per group: legend by name of the signal, by title of the panel."""
    all_panels = [
        signals_panel(run=run, interface=interface, title=title, names=names, in_steps=in_steps)
        for title, names in groups.items()
    ]
    panels = [panel for panel in all_panels if panel is not None]
    return run_figure(run.time, panels, f"Reference run: {', '.join(panel.title for panel in panels)}")
