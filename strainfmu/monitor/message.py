"""The check of a bridge's datagrams: what comes in is of known form and type before any page receives it.

A page must not receive what it cannot parse: a number that JSON does not have, or a structure without end.
"""

import json
from collections.abc import Iterable
from hmac import compare_digest
from math import isfinite
from typing import Any, NoReturn

from strainfmu.can.publisher import TOKEN
from strainfmu.estimator.air_inputs import AIR_INPUTS, DYNAMIC_PRESSURE
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.estimator.other_loads import coefficient_names
from strainfmu.estimator.signal_names import COEFFICIENT_ARRAY
from strainfmu.interface.estimator_variables import LOADS
from strainfmu.interface.input_names import FLOW_KEYS

LARGEST_DATAGRAM = 1 << 16

UNITS = {
    "timestamp": "s since 1970",
    "sequence": "1",
    "uptime_s": "s",
    "quality": "code",
    COEFFICIENT_ARRAY: "1",
    "sigma": "1",
    "loads": {name: load.unit.replace(".", " ") for name, load in LOADS.items()},
    "loads_sigma": {name: load.unit.replace(".", " ") for name, load in LOADS.items()},
    "other_loads": f"1 of {', '.join(coefficient_names())}, N of forces, N m of moments",
    "strain_um_per_m": "um/m",
    "gauges_used": "gauges",
    "suspects": "gauges",
    **{FLOW_KEYS[quantity.name]: quantity.unit for quantity in AIR_INPUTS if quantity.name in FLOW_KEYS},
    "age_ms": "ms",
    "age_uncertainty_ms": "ms",
    "health": "code",
    "usable": "1 or 0",
    "chi_square": "1",
    "chi_square_limit": "1",
    "envelope_score": "standard deviations",
    "envelope_score_limit": "standard deviations",
    "account": "frames",
    "results": "results",
    "bus": {"reconnects": "times"},
    "recording": {"frames": "frames", "lost": "frames"},
}
"""Unit of every number of a result, by its key; a code is a number whose name stands next to it."""

FIELD_UNITS = {"timestamp": "s since 1970", "x": "m", "roll_angle": "deg", "pressure_Pa": "Pa"}
"""Unit of every number of a pressure field."""

_NUMBERS = ("quality", FLOW_KEYS[DYNAMIC_PRESSURE], "age_ms", "health", "chi_square")
_TEXTS = ("quality_name", "health_name", "bus_state")
_LATER_NUMBERS = (
    *("sequence", "uptime_s"),
    *(key for name, key in FLOW_KEYS.items() if name != DYNAMIC_PRESSURE),
    *("usable", "envelope_score", "envelope_score_limit"),
    *("chi_square_limit", "gauges_used", "suspects", "age_uncertainty_ms"),
)
_LATER_TEXTS = ("health_text", "suspect_gauge", "period_text")
"""Keys that a bridge of an earlier version does not send."""


def parsed(datagram: bytes, token: str | None = None) -> dict[str, Any]:
    """Return the object of a datagram: {"layout": ...}, {"field": ...} or a result, flat and of known types.

    ``token`` is what it must state; None: anything.

    Raises
    ------
    ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError
        It is none of a bridge's.
    """
    content = json.loads(datagram[:LARGEST_DATAGRAM], parse_constant=_refused)
    if token is not None and not compare_digest(str(content.get(TOKEN)).encode(), token.encode()):
        raise ValueError("a datagram without the token")
    if "field" in content:
        return {"field": _field(content["field"])}
    return {"layout": _layout(content["layout"])} if "layout" in content else _result(content)


def _result(content: dict[str, Any]) -> dict[str, Any]:
    """Return the contents of a result for the page."""
    timestamp = _number(content["timestamp"])
    if timestamp is None:
        raise ValueError("a result without a time")
    strains = _numbers(content["strain_um_per_m"], content["strain_um_per_m"])
    return {
        "timestamp": timestamp,
        **{name: _number(content[name]) for name in _NUMBERS},
        **{name: _text(content[name]) for name in _TEXTS},
        **{name: _number(content.get(name)) for name in _LATER_NUMBERS},
        **{name: _text(content.get(name)) for name in _LATER_TEXTS},
        "causes": [_text(cause) for cause in content["causes"]],
        "causes_since": [_text(cause) for cause in content.get("causes_since", [])],
        COEFFICIENT_ARRAY: _numbers(content[COEFFICIENT_ARRAY], COEFFICIENT_NAMES),
        "sigma": _numbers(content["sigma"], COEFFICIENT_NAMES),
        "loads": _numbers(content.get("loads") or {}, LOADS),
        "loads_sigma": _numbers(content.get("loads_sigma") or {}, LOADS),
        "other_loads": _numbers(content.get("other_loads") or {}, content.get("other_loads") or {}),
        "strain_um_per_m": strains,
        "not_used": _not_used(content.get("not_used"), strains),
        "account": _numbers(content["account"], content["account"]),
        "results": _numbers(content.get("results") or {}, content.get("results") or {}),
        "bus": _bus(content.get("bus") or {}),
        "recording": _recording(content.get("recording")),
    }


def _not_used(stated: dict[str, Any] | None, strains: dict[str, float | None]) -> dict[str, str]:
    """Return why gauges are not used; an earlier bridge states none, and leaves their strains out."""
    if stated is None:
        return {name: "not used" for name, strain in strains.items() if strain is None}
    return {name: str(_text(reason) or "not used") for name, reason in stated.items() if name in strains}


def _bus(content: dict[str, Any]) -> dict[str, Any]:
    return {
        "name": _text(content.get("name")),
        "last_fault": _text(content.get("last_fault")),
        "reconnects": _number(content.get("reconnects")),
    }


def _recording(content: dict[str, Any] | None) -> dict[str, Any] | None:
    if content is None:
        return None
    return {
        "file": _text(content["file"]),
        "frames": _number(content["frames"]),
        "lost": _number(content["lost"]),
        "failure": _text(content["failure"]),
    }


def _field(content: dict[str, Any]) -> dict[str, Any]:
    """Return places and pressure of a field: none, or one for each station and roll angle, station by station."""
    arrays = {name: [_number(value) for value in content[name]] for name in ("x", "roll_angle", "pressure_Pa")}
    if len(arrays["pressure_Pa"]) not in (0, len(arrays["x"]) * len(arrays["roll_angle"])):
        raise ValueError("a field of another number of values than places")
    if any(value is None for values in arrays.values() for value in values):
        raise ValueError("a field with gaps")
    return {"timestamp": _number(content["timestamp"]), **arrays}


def _layout(content: dict[str, Any]) -> dict[str, Any]:
    """Return gauges and limits of an estimator."""
    ranges = content.get("coefficient_range") or {}
    return {
        "gauges": [_gauge(gauge) for gauge in content["gauges"]],
        "vehicle": _text(content.get("vehicle")),
        "coefficient_range": {
            name: [_number(ranges[name][0]), _number(ranges[name][1])]
            for name in COEFFICIENT_NAMES
            if name in ranges
        },
        "load_tables": [_load_table(table) for table in content.get("load_tables") or []],
        "validity": {str(name): _text(text) for name, text in (content.get("validity") or {}).items()},
    }


def _load_table(content: dict[str, Any]) -> dict[str, Any]:
    """Return a table of loads behind the five; raise if it is none."""
    columns = [
        {
            "text": _text(column["text"]),
            "unit": _text(column["unit"]),
            "factor": _number(column["factor"]) or 0.0,
            "digits": _digits(column["digits"]),
        }
        for column in content["columns"]
    ]
    rows = [(_text(row["place"]), [str(_text(name)) for name in row["outputs"]]) for row in content["rows"]]
    if any(len(outputs) != len(columns) for _, outputs in rows):
        raise ValueError("a table of loads with another number of cells than columns")
    return {
        "title": _text(content["title"]),
        "place": _text(content["place"]),
        "columns": columns,
        "rows": [{"place": place, "outputs": outputs} for place, outputs in rows],
    }


def _gauge(content: dict[str, Any]) -> dict[str, Any]:
    """Return name and position of a gauge; raise if it is none."""
    return {
        "name": str(content["name"]),
        "x": _number(content["x"]),
        "roll_angle": _number(content["roll_angle"]),
    }


def _numbers(content: dict[str, Any], names: Iterable[str]) -> dict[str, float | None]:
    return {name: _number(content.get(name)) for name in names}


def _number(value: Any) -> float | None:
    """Return a finite number or None; refuse anything else."""
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise ValueError(f"expected a finite number, got {type(value).__name__}")
    return value


def _digits(value: Any) -> int:
    """Return a number of decimals; refuse what no page can show."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= 20:
        raise ValueError("expected 0 to 20 decimals")
    return value


def _text(value: Any) -> str | None:
    if value is not None and not isinstance(value, str):
        raise TypeError(f"expected a text, got {type(value).__name__}")
    return value


def _refused(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is no JSON")
