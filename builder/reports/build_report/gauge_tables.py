"""Tables of a build report with a row for each gauge, and for each auxiliary sensor."""

from __future__ import annotations

from math import degrees
from typing import Any

import numpy as np

from builder.reports.build_report.build_findings import BuildReport
from builder.reports.page.page_tables import Column, Table, make_table
from builder.structure.observability import direction_names
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.estimator.map.sensors import shown_units


def gauges(report: BuildReport) -> Table:
    """Return the table of the strain gauges."""
    gauge_rows = _rows_of_map(report, range(report.inverse_map.n_strain_gauges))
    rows = [(name, *place, *values) for name, place, values in gauge_rows]
    columns = (Column("gauge"), *_PLACE, *_value_columns("um/m", "maximum |strain|"))
    return make_table(
        "gauges", "Every gauge: position, cost of its loss, detectable and isolable bias.", columns, rows
    )


def sensors_table(report: BuildReport) -> Table:
    """Return the table of the auxiliary sensors, each in its own unit."""
    sensors = report.inverse_map.sensors
    rows = range(sensors.n_strain_gauges, len(sensors.kind))
    sensor_rows = _rows_of_map(report, rows)
    kinds = zip(sensors.kind[rows.start :], sensors.unit[rows.start :], strict=True)
    content = [(row[0], *two, *row[1], *row[2]) for row, two in zip(sensor_rows, kinds, strict=True)]
    columns = (
        Column("sensor"),
        Column("kind"),
        Column("unit"),
        *_PLACE,
        *_value_columns("", "maximum |reading|"),
    )
    caption = "Every auxiliary sensor in its unit: position, cost of its loss, detectable and isolable bias."
    return make_table("sensors", caption, columns, content)


_PLACE = (Column("x", "m"), Column("roll angle", "deg", ".4g"), Column("direction"))


def _value_columns(unit: str, largest: str) -> tuple[Column, ...]:
    """Return the columns of the values of :func:`_rows_of_map`; ``unit`` "" where each row states its own."""
    return (
        Column("noise sigma", unit, ".3g"),
        Column(largest, unit, ".3g"),
        Column("leverage", "1", ".3f"),
        *(Column(f"lost: sigma of {name} grows", "%", ".1f") for name in COEFFICIENT_NAMES),
        Column("detectable bias", unit, ".3g"),
        Column("isolable bias", unit, ".3g"),
        Column("effect of an undetected bias, maximum", "sigma", ".2f"),
        Column("on"),
    )


def _rows_of_map(report: BuildReport, rows: range) -> list[tuple[str, tuple[Any, ...], tuple[Any, ...]]]:
    """Return name, place and values of ``rows`` of the map, in the units that are shown."""
    inverse_map, value = report.inverse_map, report.gauges
    units = shown_units(inverse_map.sensors)
    position = inverse_map.gauge_position
    roll = [degrees(angle) % 360.0 for angle in np.arctan2(position[:, 1], position[:, 2])]
    directions = direction_names(position, inverse_map.gauge_direction)
    worst = np.argmax(value.undetected_effect, axis=1)
    return [
        (
            inverse_map.gauge_names[i],
            # A value just below 360 deg is 0.
            (position[i, 0], roll[i] if roll[i] < 360.0 - 1e-9 else 0.0, directions[i]),
            (
                units[i][0] * inverse_map.noise_std[i],
                units[i][0] * inverse_map.strain_range[i],
                value.leverage[i],
                *(100.0 * (value.growth[i] - 1.0)),
                units[i][0] * value.detectable_bias[i],
                units[i][0] * value.isolable_bias[i],
                value.undetected_effect[i, worst[i]],
                COEFFICIENT_NAMES[worst[i]],
            ),
        )
        for i in rows
    ]
