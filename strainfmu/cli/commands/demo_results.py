"""What a demonstration prints at its end, and the README.txt of its folder."""

from __future__ import annotations

from collections.abc import Sequence
from io import StringIO
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from builder.figures.drawing import estimator_in_words
from strainfmu.estimator.signal_names import COEFFICIENT_NAMES

if TYPE_CHECKING:
    from builder.pipeline.demonstration.demo import DemoResult

README = "README.txt"
WIDTH = 130
"""Columns of the tables in it."""


def show_result(console: Console, result: DemoResult, is_verbose: bool = False) -> None:
    """Print what flew, one table, health, time per step, what to open and what to do next; all, if ``is_verbose``.

    Scores on held-out results and of a ground test are what such a demonstration is for: they are always printed.
    """
    score = result.summary
    if held_out := score.get("held_out"):
        _show_held_out(console, held_out)
    _say(console, f"{result.vehicle}: {result.flight}; the FMU's estimate against truth, {result.physics.model}")
    console.print(_score_table(score))
    if not result.physics.is_that_of_map:
        _say(console, result.physics.sentence)
    _say(console, _health_line(score))
    times = ", ".join(f"{name} {1e6 * value:.0f} us" for name, value in score["step_time"].items())
    _say(console, f"Time per step (median, through fmpy): {times}.")
    if states := score.get("as_built"):
        _show_states(console, states)
    if is_verbose:
        _show_details(console, result)
    for line in _next_lines(result):
        _say(console, line)


def write_readme(result: DemoResult, lines: Sequence[str]) -> Path:
    """Write README.txt into the folder of a demonstration: results, files, and ``lines`` of stages and notes.

    A run that made nothing leaves the file of the run that did.

    Raises
    ------
    StrainfmuError
        The file cannot be written.
    """
    from strainfmu.files import write_bytes_atomically

    path = result.folder / README
    if path.is_file() and set(result.reused) >= set(result.files):
        return path
    text = StringIO()
    console = Console(file=text, width=WIDTH)
    _say(console, f"Results of strainfmu demo: {result.vehicle}\n")
    show_result(console, result, is_verbose=True)
    _say(console, "\nStages and notes of the run\n")
    for line in lines:
        _say(console, line)
    content = "\n".join(line.rstrip() for line in text.getvalue().splitlines()) + "\n"
    write_bytes_atomically(path, content.encode())
    return path


def _next_lines(result: DemoResult) -> list[str]:
    """Return the picture to open, the FMU to use, the next command, and where the rest stands."""
    folder = result.folder
    pictures = [name for name in result.files if name.endswith(".png")]
    picture = next((name for name in pictures if name == "overview.png"), next(iter(pictures), None))
    lines = [] if picture is None else [f"Picture: {folder / picture}"]
    if "estimator.fmu" in result.files:
        lines.append(f"FMU:     {folder / 'estimator.fmu'}")
    if "flight.csv" in result.files:
        lines.append(f"Next:    strainfmu estimate {folder / 'map.h5'} {folder / 'flight.csv'} -o loads.csv")
    return [*lines, f"More:    {folder / README}: stages, detection thresholds, files; --verbose prints them"]


def _say(console: Console, line: str) -> None:
    console.print(line, highlight=False, markup=False, soft_wrap=True)


def _show_details(console: Console, result: DemoResult) -> None:
    """Print the errors that the uncertainty includes, both estimators, and the files."""
    _say(console, f"The stated uncertainty includes: {', '.join(result.errors_in_sigma)}.")
    if estimators := result.summary.get("estimators"):
        _show_estimators(console, estimators)
    files = Table(title=escape(f"Files in {result.folder}"), show_header=False, box=None)
    for name, holds in result.files.items():
        files.add_row(name, holds, "reused" if name in result.reused else "new")
    console.print(files)


def _accuracy_table(title: str, scores: dict[str, Any]) -> Table:
    """Return a table of rms errors and coverage of the coefficients, a row for each of ``scores``."""
    table = Table(title=title, box=None, pad_edge=False, padding=(0, 3, 0, 0), title_justify="left")
    for heading in ("", "", "rms error", "bound", "within 3 sigma"):
        table.add_column(heading, justify="right" if heading else "left")
    for coefficient in COEFFICIENT_NAMES:
        for name, score in scores.items():
            error, bound = score["rms_error"][coefficient], score["bound"][coefficient]
            first = coefficient if name == next(iter(scores)) else ""
            of_bound = "-" if bound is None else f"{bound:.2e}"
            table.add_row(first, name, f"{error:.2e}", of_bound, f"{score['coverage'][coefficient]:.2%}")
    return table


def _show_estimators(console: Console, estimators: dict[str, Any]) -> None:
    """Show the accuracy of each estimator on the same strains."""
    in_words = {estimator_in_words(name): scores for name, scores in estimators.items()}
    table = _accuracy_table("Linear and nonlinear estimator on the same strains", in_words)
    flown = estimators["nonlinear"]
    for name in ("angle_of_attack", "sideslip_angle"):
        cells = [f"{degrees(flown['rms_error'][name]):.3f}", "-", f"{flown['coverage'][name]:.2%}"]
        table.add_row(escape(f"{name.replace('_', ' ')} [deg]"), estimator_in_words("nonlinear"), *cells)
    console.print(table)


def _show_states(console: Console, states: dict[str, Any]) -> None:
    """Show the accuracy of the map before the ground test, after it, and if the vehicle were known."""
    console.print(
        _accuracy_table("The map before and after the ground test, and of the vehicle known exactly", states)
    )


def _score_table(score: dict[str, Any]) -> Table:
    """Return a table of a score, as files of results hold it."""
    table = Table(box=None, pad_edge=False, padding=(0, 3, 0, 0))
    headings = ("coefficient", "rms error [1]", "bound [1]", "uncertainty, 1 sigma [1]", "of range")
    for heading in headings:
        table.add_column(escape(heading), justify="left" if heading.startswith("coefficient") else "right")
    for name, error in score["rms_error"].items():
        of_range = score["rms_error_of_range"][name]
        table.add_row(
            name,
            f"{error:.2e}",
            "-" if (bound := score["bound"][name]) is None else f"{bound:.2e}",
            f"{score['mean_sigma'][name]:.2e}",
            "constant" if of_range is None else f"{100.0 * of_range:.2f} %",
        )
    return table


def _health_line(score: dict[str, Any]) -> str:
    """Return how often health is OK, and what it does not detect."""
    undetected = [f"{name} {part:.2%}" for name, part in score["undetected"].items() if part > 0.0]
    return (
        f"Health OK in {score['healthy']:.2%} of the samples; truth beyond 3 sigma with health OK: "
        f"{', '.join(undetected) or 'none'}."
    )


def _show_held_out(console: Console, score: dict[str, Any]) -> None:
    """Show the score on results that maps are made without, ahead of a flight with another physics."""
    _say(console, "Held-out conditions of the imported results: estimate against truth")
    console.print(_score_table(score))
    _say(
        console,
        f"Maps made without {', '.join(score['left_out'])} in turn estimate what they are made without, "
        f"{score['flows']} flows inside the range of Mach numbers. {_health_line(score)}",
    )
