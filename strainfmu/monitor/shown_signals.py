"""What the page shows of signals: tiles of the flow, and histories of coefficients and loads.

The page iterates over these tables; it names no signal.
"""

from __future__ import annotations

from typing import Any

from strainfmu.estimator.air_inputs import AIR_INPUTS, DYNAMIC_PRESSURE
from strainfmu.estimator.map.validity import VALIDITY_LABELS
from strainfmu.interface.estimator_variables import LOADS
from strainfmu.interface.fmi_variables import COEFFICIENTS, unit_shown
from strainfmu.interface.input_names import FLOW_KEYS


def flow_tiles() -> list[dict[str, Any]]:
    """Return a tile of each quantity of the flow: key in a result, label, unit and factor to it, digits.

    ``range`` is its name among the ranges of a map; ``is_needed`` whether results without it are in question.
    """
    tiles = []
    for quantity in AIR_INPUTS:
        if quantity.name in FLOW_KEYS:
            unit, factor = unit_shown(quantity.unit, quantity.shown)
            tiles.append(
                {
                    "key": FLOW_KEYS[quantity.name],
                    "label": quantity.label,
                    "unit": "" if unit == "1" else unit,
                    "factor": factor,
                    "digits": 3 if unit == "1" else 2,
                    "range": VALIDITY_LABELS[quantity.name],
                    "is_needed": quantity.name == DYNAMIC_PRESSURE,
                }
            )
    return tiles


def histories() -> list[dict[str, Any]]:
    """Return a history of each coefficient and its load: names in a result, titles, factor to the load's unit."""
    groups = []
    for name, (load, signal) in zip(COEFFICIENTS, LOADS.items(), strict=True):
        unit, factor = unit_shown(signal.unit, f"k{signal.unit}")
        axis = signal.label.partition(" ")[0].lower()
        title = f"{signal.label} [{unit.replace('.', ' ')}]"
        groups.append(
            {
                "name": name,
                "title": f"{name} [1], {axis}",
                "load": load,
                "load_title": title,
                "load_factor": factor,
            }
        )
    return groups
