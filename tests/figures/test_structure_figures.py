"""Figures of a structure show its mesh, gauges and responses, whole and with units."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from structure_record import LAYOUTS, NAMES, ROLL_ANGLES, STATIONS, small_structure

from builder.figures import structure_figures
from builder.figures.drawing import save
from builder.structure.observability import SmoothResponse, smooth_response, wave_names, wave_response
from builder.structure.structure_file import Structure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@pytest.fixture(scope="module")
def structure() -> Structure:
    return small_structure()


@pytest.fixture(scope="module")
def response(structure: Structure) -> SmoothResponse:
    return smooth_response(structure.strain_operator, structure.point, structure.surface.node_area)


@pytest.fixture
def draw(structure: Structure, response: SmoothResponse) -> Callable[[str], Figure]:
    def drawn(name: str) -> Figure:
        function = getattr(structure_figures, name)
        return function(structure) if name == "mesh_and_gauges" else function(structure, response)

    return drawn


@pytest.mark.parametrize("name", ["mesh_and_gauges", "strain_patterns", "waves", "singular_values"])
def test_every_figure_is_drawn_inside_its_frame(name: str, draw: Callable[[str], Figure], tmp_path: Path) -> None:
    figure = draw(name)
    save(figure, tmp_path / "figure.png")
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
    ink, frame = figure.get_tightbbox(), figure.bbox_inches
    assert ink.xmin >= -0.02
    assert ink.ymin >= -0.02
    assert ink.xmax <= frame.width + 0.02
    assert ink.ymax <= frame.height + 0.02


@pytest.mark.fast
def test_each_edge_is_drawn_once_and_none_across_the_whole_width(
    structure: Structure, draw: Callable[[str], Figure]
) -> None:
    """Of an open triangulated cylinder: edges = nodes + triangles (Euler: V - E + F = 0)."""
    whole = draw("mesh_and_gauges").axes[-1]  # the unrolled views come after the close-up and the one from behind
    segments = np.array(whole.collections[0].get_segments())
    assert len(segments) == STATIONS * ROLL_ANGLES + len(structure.triangle)
    step = 360.0 / ROLL_ANGLES
    assert np.ptp(segments[:, :, 1], axis=1).max() == pytest.approx(step, rel=1e-9)
    assert segments[:, :, 1].max() == 360.0


@pytest.mark.fast
def test_marks_lie_along_the_gauges(draw: Callable[[str], Figure]) -> None:
    """Matplotlib's marker (2, 2, turn) is a stroke upright at 0; axial gauges lie flat, hoop gauges stand."""
    first = next(axis for axis in draw("mesh_and_gauges").axes if axis.get_title("left").startswith("first"))
    strokes = {(line.get_marker()[2], tuple(line.get_ydata())) for line in first.lines}
    assert {turn for turn, _ in strokes} == {-90.0, 0.0, -45.0}
    assert sorted(y for turn, roll in strokes if turn == -90.0 for y in roll) == pytest.approx([0.0, 90.0])
    labels = {text.get_text() for text in first.get_legend().get_texts()}
    assert labels == {"axial, 2", "hoop, 2", "45 deg, 1"}


def test_gauges_shared_by_layouts_count_once(structure: Structure) -> None:
    distinct = structure_figures.distinct_gauges(structure)
    assert [NAMES[i] for i in distinct] == ["axial_0", "axial_90", "hoop_0", "hoop_45", "slanted [45]", "hoop_180"]
    assert all(LAYOUTS[i] == "first" for i in distinct[:5])


def test_patterns_are_of_each_direction(structure: Structure) -> None:
    """At one station the gauge nearest to roll angle 180 deg stands for all of its direction."""
    chosen = [[NAMES[i] for i in gauges] for gauges in structure_figures.pattern_gauges(structure)]
    assert chosen == [["axial_90"], ["hoop_180"], ["slanted [45]"]]


@pytest.mark.fast
def test_pattern_is_the_weight_of_the_pressure(draw: Callable[[str], Figure]) -> None:
    """hoop_180 weighs with 1 + cos + cos 2 of the angle from 180 deg: 3 (um/m)/(kPa m2) there, 1 at 0."""
    axis = next(axis for axis in draw("strain_patterns").axes if axis.get_title().startswith("hoop_180"))
    values = axis.collections[0].get_array().reshape(181, 241)
    np.testing.assert_allclose(values[[90, 0, 45]], np.array([[3.0], [1.0], [0.0]]) + 0.0 * values[:3], atol=1e-9)
    low, high = axis.collections[0].get_clim()
    assert high == -low == pytest.approx(3.0)


def test_heat_map_is_the_response_per_wave(
    structure: Structure, response: SmoothResponse, draw: Callable[[str], Figure]
) -> None:
    figure = draw("waves")
    second = next(axis for axis in figure.axes if axis.get_title() == "second")
    assert [text.get_text() for text in second.get_xticklabels()] == wave_names()
    assert [text.get_text() for text in second.get_yticklabels()] == ["axial_0", "hoop_180"]
    expected = 1e9 * wave_response(response)[structure.gauges_of("second")]
    np.testing.assert_allclose(second.images[0].get_array(), np.maximum(expected, 1e-30), rtol=1e-9)


@pytest.mark.fast
def test_a_blind_class_is_marked(draw: Callable[[str], Figure]) -> None:
    """Of the second layout (0 and 180 deg), which sees cosines alone, both classes odd in y; of the first none."""
    classes = next(axis for axis in draw("singular_values").axes if axis.get_yscale() == "log" and axis.patches)
    assert [text.get_text() for text in classes.texts] == ["blind", "blind"]
