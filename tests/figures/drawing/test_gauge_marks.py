"""Gauges in figures: each is of one kind by its direction, drawn along it, and counted once."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from builder.aero.surface.mesh import mesh_of_grid
from builder.figures.demonstration import gauges
from builder.figures.drawing import gauge_kinds, kind_label
from builder.figures.gauge_figures import gauge_loss
from builder.figures.observability_figures import unrolled_pressure
from builder.vehicle.shape.geometry import chain_segments, surface_grid
from strainfmu.estimator.map.sensors import STRAIN, SensorRows, strain_rows

pytestmark = pytest.mark.fast

ROSETTES = 4
GRID = surface_grid(chain_segments([(2.0, 0.1, 0.1)]), 10, 16)


def rosettes(*angles: float) -> SimpleNamespace:
    """Return gauges at ``angles`` [deg] from the meridian, at four roll angles on a cone."""
    position, direction = [], []
    for roll in np.radians([0.0, 60.0, 180.0, 270.0][:ROSETTES]):
        out = np.array([0.0, np.sin(roll), np.cos(roll)])
        aft = np.cos(0.1) * np.array([1.0, 0.0, 0.0]) + np.sin(0.1) * out
        across = np.array([0.0, np.cos(roll), -np.sin(roll)])
        for angle in np.radians(angles):
            position.append(0.1 * out + [1.0, 0.0, 0.0])
            direction.append(np.cos(angle) * aft + np.sin(angle) * across)
    return SimpleNamespace(
        gauge_position=np.array(position),
        gauge_direction=np.array(direction),
        gauge_names=[f"s{i}" for i in range(len(position))],
        n_gauges=len(position),
        n_strain_gauges=len(position),
        sensors=strain_rows(len(position)),
        has_auxiliary_sensors=False,
        noise_std=np.full(len(position), 2e-6),
        vehicle="cone",
    )


def legend_of(figure: Any) -> list[str]:
    """Return the texts of the only legend of a figure."""
    legends = [axis.get_legend() for axis in figure.axes if axis.get_legend() is not None] + figure.legends
    assert len(legends) == 1
    return [text.get_text() for text in legends[0].get_texts()]


def test_every_gauge_is_of_one_kind() -> None:
    one = rosettes(0.0, 45.0, 90.0)
    kinds = gauge_kinds(one.gauge_position, one.gauge_direction)
    assert {kind: int(chosen.sum()) for kind, chosen in kinds.items()} == {"axial": 4, "hoop": 4, "inclined": 4}
    assert (np.sum(list(kinds.values()), axis=0) == 1).all()
    two = rosettes(0.0, 180.0)
    assert list(gauge_kinds(two.gauge_position, two.gauge_direction)) == ["axial"]


@pytest.mark.parametrize(
    ("angles", "label"),
    [((45.0,), "45 deg, 4"), ((45.0, -45.0), "45 and -45 deg, 8"), ((20.0, 30.0, 40.0), "inclined, 12")],
)
def test_label_names_the_angle(angles: tuple[float, ...], label: str) -> None:
    one = rosettes(*angles)
    assert kind_label("inclined", one.gauge_position, one.gauge_direction) == label


def test_figure_of_the_gauges() -> None:
    """Each is a stroke along its direction: matplotlib's marker (2, 2, turn) is upright at 0."""
    figure = gauges(rosettes(0.0, 45.0, 90.0), GRID)  # type: ignore[arg-type]  # what of a map the figure draws
    assert legend_of(figure) == ["axial, 4", "hoop, 4", "45 deg, 4"]
    assert {line.get_marker()[2] for line in figure.axes[0].lines} == {-90.0, -45.0, 0.0}


def test_figures_of_the_report() -> None:
    one: Any = rosettes(0.0, 45.0, 90.0)
    surface = mesh_of_grid(GRID)
    at_nodes = np.linspace(0.0, 1.0, len(surface.point))
    drawn = unrolled_pressure(surface, removed=at_nodes, mean=at_nodes, std=at_nodes, inverse_map=one)
    assert legend_of(drawn.figure) == ["axial, 4", "hoop, 4", "45 deg, 4"]
    growth = 1.0 + np.arange(60.0).reshape(12, 5)
    growth[3] = np.inf
    drawn = gauge_loss(one, growth=growth, detectable_bias=np.full(12, 1e-6), leverage=np.ones(12))
    assert legend_of(drawn.figure) == ["axial, 4", "hoop, 4", "45 deg, 4"]


def with_sensors(one: Any) -> Any:
    """The last two gauges are a port and a load cell."""
    n, scale = one.n_gauges - 2, np.array([4e8, 2e6])
    one.has_auxiliary_sensors, one.n_strain_gauges = True, n
    one.sensors = SensorRows(
        kind=(*(STRAIN,) * n, "pressure", "force"),
        unit=(*("m/m",) * n, "Pa", "N"),
        scale=np.append(np.ones(n), scale),
        largest=np.append(np.ones(n), 0.1 * scale),
        thrust_response=np.zeros(n + 2),
    )
    return one


def test_further_sensors_have_marks_and_units_of_their_own() -> None:
    one = with_sensors(rosettes(0.0, 45.0, 90.0))
    growth, bias = 1.0 + np.arange(60.0).reshape(12, 5), np.linspace(5e-6, 27e-6, 12)
    drawn = gauge_loss(one, growth=growth, detectable_bias=bias, leverage=np.full(12, 0.5))
    assert legend_of(drawn.figure) == ["axial, 4", "hoop, 3", "45 deg, 3", "auxiliary sensors, 2"]
    assert any(axis.get_ylabel() == "bias [sigma of its noise]" for axis in drawn.figure.axes)
    texts = [one.text for one in drawn.places()]
    assert "detectable bias 5 um/m" in texts[0]
    assert texts[10].startswith("s10, pressure\n")
    assert "detectable bias 1e+04 Pa" in texts[10]
    assert "detectable bias 54 N" in texts[11]
    of_bias = next(one for one in drawn.figure.axes[5].collections if one.get_label().startswith("auxiliary"))
    np.testing.assert_allclose(of_bias.get_array(), bias[10:] / 2e-6)
