"""Results that examples of the gallery share: in a build of the site, each is made once.

An example is a whole program that a reader runs alone, so most begin with the flows and the map of one vehicle.
A flow depends on its key and its engine's inputs alone (:mod:`builder.aero.engine`), a map that is given nothing
else on its vehicle alone. No example changes them.
"""

from __future__ import annotations

import json
from functools import wraps
from typing import Any

from sphinx.application import Sphinx

import builder
from builder.aero.engine import Flow, FlowKey
from builder.aero.engines.euler import EulerEngine
from builder.vehicle.file import Vehicle
from strainfmu.estimator.map.inverse_map import InverseMap


def keep_flows() -> None:
    """Let the Euler engine keep what it solved."""
    solve = EulerEngine.solve
    solved: dict[tuple[str, FlowKey], Flow] = {}

    @wraps(solve)
    def solve_once(engine: EulerEngine, key: FlowKey) -> Flow:
        place = json.dumps(engine.inputs(), sort_keys=True), key
        if place not in solved:
            solved[place] = solve(engine, key)
        return solved[place]

    EulerEngine.solve = solve_once  # type: ignore[method-assign]


def keep_maps() -> None:
    """Let ``builder.build_map`` keep the maps of vehicles that come without snapshots and structure."""
    build = builder.build_map
    built: list[tuple[Vehicle, InverseMap]] = []

    @wraps(build)
    def build_once(vehicle: Vehicle, **given: Any) -> InverseMap:
        if given:
            return build(vehicle, **given)
        found = next((inverse_map for other, inverse_map in built if other == vehicle), None)
        if found is None:
            found = build(vehicle)
            built.append((vehicle.model_copy(deep=True), found))
        return found

    builder.build_map = build_once


def setup(app: Sphinx) -> dict[str, bool]:
    """Keep flows and maps while the site is built."""
    keep_flows()
    keep_maps()
    return {"parallel_read_safe": True, "parallel_write_safe": True}
