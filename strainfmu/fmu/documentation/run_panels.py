"""Panels of the reference run for the pages of FMUs: estimates with bands, signals in units that people read."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from math import ceil, degrees, floor, log10

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.sensors import shown_units
from strainfmu.fmu.documentation.index_page import Section
from strainfmu.fmu.reference_run.plant import Reference
from strainfmu.fmu.reference_run.run import ReferenceRun, as_recorded
from strainfmu.interface.fmi_variables import COEFFICIENTS, Variable, shown_unit
from strainfmu.interface.health_names import STATE
from strainfmu.interface.sensor_variables import reading_names

COLOURS = ("#1b6ca8", "#c0392b", "#2e8b57", "#8e44ad", "#b8860b")

_LEFT, _RIGHT, _TOP, _PLOT, _GAP, _BOTTOM, _WIDTH = 110, 170, 10, 96, 22, 40, 800


@dataclass(frozen=True, eq=False, kw_only=True)
class Line:
    """A signal over time.

    Attributes
    ----------
    name : for the legend.
    values : (n,) in the unit of its panel; what is not finite is left out.
    spread : (n,) half the height of its band, None for no band.
    steps : whether a value holds until the next one.
    dashed : whether its line is.
    """

    name: str
    values: FloatArray
    spread: FloatArray | None = None
    steps: bool = False
    dashed: bool = False


@dataclass(frozen=True, kw_only=True)
class Panel:
    """Signals of one unit; ``words`` stand at whole values instead of numbers."""

    title: str
    lines: Sequence[Line]
    words: Sequence[tuple[float, str]] = ()


def nice_ticks(low: float, high: float, wanted: int = 4) -> list[float]:
    """Return multiples of 1, 2 or 5 times a power of ten within ``low`` .. ``high``, two or more of them."""
    span = high - low
    power = 10.0 ** floor(log10(span / wanted))
    step = next((m * power for m in (1.0, 2.0, 5.0, 10.0) if span / (m * power) <= wanted + 1e-9), 10.0 * power)
    first, last = ceil(low / step - 1e-9), floor(high / step + 1e-9)
    if last <= first:
        step /= 2.0
        first, last = ceil(low / step - 1e-9), floor(high / step + 1e-9)
    return [float(f"{k * step:.12g}") for k in range(first, last + 1)]


def run_figure(
    time: FloatArray, panels: Sequence[Panel], label: str, shaded: tuple[float, float] | None = None
) -> str:
    """Return an SVG of ``panels`` over ``time`` (n,) [s]; ``label`` says what it shows.

    ``shaded`` is a span of time [s] that stands out in all panels.
    """
    end = float(time[-1])
    height = _TOP + len(panels) * (_PLOT + _GAP) - _GAP + _BOTTOM
    parts = [_panel(time, panel, _TOP + k * (_PLOT + _GAP)) for k, panel in enumerate(panels)]
    bottom = height - _BOTTOM
    if shaded is not None:
        first, last = (_x(edge, time) for edge in shaded)
        span = f'x="{first:.1f}" y="{_TOP}" width="{last - first:.1f}" height="{bottom - _TOP}"'
        parts.insert(0, f'<rect {span} fill="#f3e6c8"/>')
    for tick in nice_ticks(float(time[0]), end, 8):
        x = _x(tick, time)
        parts.append(f'<path d="M{x:.1f},{bottom}v5" stroke="#444"/>')
        parts.append(f'<text x="{x:.1f}" y="{bottom + 17}" text-anchor="middle" class="tick">{tick:g}</text>')
    middle = (_LEFT + _WIDTH - _RIGHT) / 2
    parts.append(f'<text x="{middle:.0f}" y="{height - 6}" text-anchor="middle">time [s]</text>')
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" width="{_WIDTH}" '
        f'font-family="sans-serif" font-size="12" role="img" aria-label="{escape(label)}">'
        f"<style>.tick{{font-size:10px;fill:#444}}</style>{''.join(parts)}</svg>"
    )


def _x(time: float, axis: FloatArray) -> float:
    start, end = float(axis[0]), float(axis[-1])
    return _LEFT + (_WIDTH - _LEFT - _RIGHT) * (time - start) / (end - start)


def _panel(time: FloatArray, panel: Panel, top: int) -> str:
    """Return one panel: frame, ticks and grid, bands under lines, legend on the right."""
    low, high = _limits(panel)

    def y(value: float) -> float:
        return top + _PLOT * (high - value) / (high - low)

    width = _WIDTH - _LEFT - _RIGHT
    parts = []
    marks = panel.words or [(tick, f"{tick:g}") for tick in nice_ticks(low, high)]
    for value, text in marks:
        parts.append(f'<path d="M{_LEFT - 4},{y(value):.1f}h{width + 4}" stroke="#ddd"/>')
        parts.append(
            f'<text x="{_LEFT - 7}" y="{y(value) + 3.5:.1f}" text-anchor="end" class="tick">{escape(text)}</text>'
        )
    parts.append(f'<rect x="{_LEFT}" y="{top}" width="{width}" height="{_PLOT}" fill="none" stroke="#888"/>')
    for k, line in enumerate(panel.lines):
        colour = COLOURS[k % len(COLOURS)]
        if line.spread is not None:
            upper = _points(time, line.values + line.spread, y, steps=line.steps)
            lower = _points(time, line.values - line.spread, y, steps=line.steps)
            parts.append(
                f'<polygon points="{" ".join([*upper, *lower[::-1]])}" fill="{colour}" fill-opacity=".28" '
                f'stroke="{colour}" stroke-opacity=".6" stroke-width=".7"/>'
            )
        points = " ".join(_points(time, line.values, y, steps=line.steps))
        dashes = ' stroke-dasharray="5 3"' if line.dashed else ""
        parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.6"{dashes}/>')
        x, height = _WIDTH - _RIGHT + 8, top + 30 + 15 * k
        parts.append(f'<path d="M{x},{height - 4}h14" stroke="{colour}" stroke-width="3"/>')
        parts.append(f'<text x="{x + 18}" y="{height}" class="tick">{escape(line.name)}</text>')
    parts.append(f'<text x="{_WIDTH - _RIGHT + 8}" y="{top + 12}" font-weight="bold">{escape(panel.title)}</text>')
    return "".join(parts)


def _limits(panel: Panel) -> tuple[float, float]:
    """Return the axis: all lines with their bands, and all words, and a margin."""
    values = [word for word, _ in panel.words]
    for line in panel.lines:
        spread = np.zeros(len(line.values)) if line.spread is None else line.spread
        for edge in (line.values - spread, line.values + spread):
            values += edge[np.isfinite(edge)].tolist()
    low, high = min(values, default=0.0), max(values, default=0.0)
    margin = 0.08 * (high - low) or 0.1 * abs(high) or 1.0
    return low - margin, high + margin


def _points(time: FloatArray, values: FloatArray, y: Callable[[float], float], *, steps: bool) -> list[str]:
    """Return the points of a polyline; a corner more per step."""
    points, before = [], None
    for t, value in zip(time.tolist(), values.tolist(), strict=True):
        if not np.isfinite(value):
            continue
        x = _x(t, time)
        if steps and before is not None:
            points.append(f"{x:.1f},{before:.1f}")
        before = y(value)
        points.append(f"{x:.1f},{before:.1f}")
    return points


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
