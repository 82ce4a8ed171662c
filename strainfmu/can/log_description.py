"""The description next to a log, LOG.json: options, start, end of a bridge. With it a replay repeats the run."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import Any, get_args, get_type_hints

from strainfmu.can.frame import error_line
from strainfmu.can.options import BridgeOptions
from strainfmu.can.profiles import Identifiers
from strainfmu.errors import InputError
from strainfmu.estimator.signal_names import TARE

SIDECAR_VERSION = 1

_FILES = ("dbc", "mapping", "key_file", "freshness_file", "zeros", TARE, "tare_known", "tare_output")
"""Options that are files."""


def sidecar(path: Path) -> Path:
    """Return where the description of a log lies."""
    return path.with_name(f"{path.name}.json")


def load_description(path: Path) -> dict[str, Any] | None:
    """Return the description of the log at ``path``, None if there is none.

    Raises
    ------
    InputError
        It is damaged or of another version.
    """
    sidecar_path = sidecar(path)
    if not sidecar_path.is_file():
        return None
    try:
        description = json.loads(sidecar_path.read_text())
        if description.get("version") != SIDECAR_VERSION:
            raise InputError(
                f"{sidecar_path}: expected version {SIDECAR_VERSION}, got {description.get('version')}"
            )
        return {**description, **_run(description), "options": _options(description["options"])}
    except KeyError as error:
        raise InputError(f"{sidecar_path}: damaged: no entry {error}") from error
    except (ValueError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise InputError(f"{sidecar_path}: damaged: {error_line(error)[:200]}") from error


def _run(description: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries of a description about the run itself, times in s; raise if one is of another kind."""
    run: dict[str, Any] = {name: _checked(name, description[name], str) for name in ("fmu", "fmu_sha256")}
    run |= {name: _checked(name, description[name], float) for name in ("start", "log_start")}
    run["end"] = _checked("end", description.get("end"), float | None)
    run["freshness"] = _checked("freshness", description.get("freshness"), int | None)
    run["first_result"] = _checked("first_result", description.get("first_result", 0), int)
    run["lost"] = _checked("lost", description.get("lost", 0), int)
    for name in ("skips", "unanswered"):
        run[name] = [(_checked(name, a, float), _checked(name, b, float)) for a, b in description.get(name, ())]
    return run


def _checked(name: str, value: Any, kind: Any) -> Any:
    """Return ``value`` if it is of ``kind``, a type or a union; a whole number is a float too."""
    kinds = get_args(kind) or (kind,)
    if type(value) is int and float in kinds:
        value = float(value)
    is_bool = isinstance(value, bool) and bool not in kinds
    if is_bool or not isinstance(value, kinds) or (isinstance(value, float) and not isfinite(value)):
        allowed = " or ".join("null" if kind is type(None) else kind.__name__ for kind in kinds)
        raise ValueError(f"entry '{name}': expected {allowed}, got {str(value)[:40]!r}")
    return value


def plain_options(options: BridgeOptions) -> dict[str, Any]:
    """Return the options as JSON holds them; files by their whole path, none of their content."""
    values = asdict(options)
    for name in _FILES:
        values[name] = None if values[name] is None else str(Path(values[name]).resolve())
    return values


def _options(values: Mapping[str, Any]) -> BridgeOptions:
    """Return the options that :func:`plain_options` gave; raise if one is missing or of another kind."""
    numbers = _checked("identifiers", values["identifiers"], dict)
    texts = _checked("bus_options", values["bus_options"], list)
    options: dict[str, Any] = {
        "identifiers": Identifiers(
            **{name: _checked(name, numbers[name], kind) for name, kind in get_type_hints(Identifiers).items()}
        ),
        "bus_options": tuple(_checked("bus_options", text, str) for text in texts),
    }
    for name in _FILES:
        text = _checked(name, values.get(name), str | None)
        options[name] = None if text is None else Path(text)
    for name, kind in get_type_hints(BridgeOptions).items():
        if name not in options and name in values:
            options[name] = _checked(name, values[name], kind)
    return BridgeOptions(**options)
