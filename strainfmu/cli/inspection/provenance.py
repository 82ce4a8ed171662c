"""What a map says of its making, in words and with units: part of ``strainfmu inspect map.h5``."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from builder.inverse.mode_choice import mode_choice_lines
from strainfmu.estimator.map.inverse_map import ABSOLUTE, PER_PRESSURE

OF_LEVELS = ("chi-square", "largest |z|", "chi-square of the shapes")

UNIT_ENDINGS = {"_m": "m", "_mm": "mm", "_Pa": "Pa", "_deg": "deg", "_percent": "%", "_um_per_m": "um/m"}
"""Unit that the name of an entry ends on."""

FORMS = {
    PER_PRESSURE: "per dynamic pressure, for the altitudes below",
    ABSOLUTE: "in Pa, for the altitude of the snapshots",
}
SYMMETRIES = {"full": "every flow at every roll angle", "listed": "flows at the listed angles alone"}


def provenance_rows(provenance: Mapping[str, Any], shown_apart: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """Yield name and value of every entry of a map's provenance but those ``shown_apart``."""
    for key, value in provenance.items():
        if key in shown_apart:
            continue
        title, words = _WORDS.get(key, ("", None))
        name, text = with_unit(key, value)
        yield title or name, text if words is None else words(value)


def with_unit(key: str, value: Any) -> tuple[str, str]:
    """Return an entry's name in words, and its value with the unit that the name ends on.

    >>> with_unit("element_length_mm", 10.0)
    ('element length', '10 mm')
    """
    ending = next((unit for unit in UNIT_ENDINGS if key.endswith(unit)), "")
    text = in_words(value)
    if ending and not isinstance(value, str):
        text = f"{text} {UNIT_ENDINGS[ending]}"
    return key.removesuffix(ending).replace("_", " "), text


def in_words(value: Any) -> str:
    """Return a value of JSON as an engineer writes it: yes and no, six digits, lists and tables by commas."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        return ", ".join(" ".join(with_unit(*entry)) for entry in value.items()) or "none"
    if isinstance(value, list | tuple):
        return ", ".join(map(in_words, value)) or "none"
    return "none" if value is None else str(value)


def _levels(facts: Mapping[str, Any]) -> str:
    """Return the factors on alarm levels, the last one on the largest |z| and not on its square."""
    scales = facts.get("scales") or [facts["chi_square_scale"], facts["outlier_scale"]]
    factors = dict(zip(OF_LEVELS, scales, strict=False))
    factors["largest |z|"] **= 0.5
    text = ", ".join(f"{name} times {factor:.3g}" for name, factor in factors.items())
    before, stated = (f"{100.0 * facts[name]:.2g} %" for name in ("rate_before", "stated_rate"))
    flights = f"{facts['samples']} samples of the independent model"
    if not facts["used"]:
        return f"levels of the theory: {before} of {flights} raise an alarm, map and model differ"
    return f"{text}, for {stated} false alarms in {flights} ({before} with the levels of the theory)"


def _flow(facts: Mapping[str, Any]) -> str:
    """Return engine, cells, and the conditions and how many were not solved."""
    said = [f"engine {facts['engine']}"]
    grid = facts.get("marching_grid") or {}
    if {"n_radial", "n_circumferential"} <= set(grid):
        said.append(f"{grid['n_radial']} cells outwards, {grid['n_circumferential']} over half a turn")
    said.append(f"conditions: {in_words(facts.get('sets', []))}")
    if facts.get("conditions_not_solved"):
        said.append(f"{facts['conditions_not_solved']} of them not solved")
    return ", ".join(said)


def _calibration(facts: Mapping[str, Any]) -> str:
    """Return test, fit and what was found; zeros and wall stand in the report next to the map."""
    said = [f"by {facts['test']}, {len(facts['cases'])} cases", f"{facts['readings']} readings"]
    said.append(f"chi-square per reading {facts['chi_square_per_reading']:.3g} (1 is expected)")
    lines = [*facts["faults"], *facts.get("outside_the_model", [])]
    if "accepted" in facts:
        lines.insert(0, f"accepted: {facts['accepted']}")
    return "; ".join([", ".join(said), *(lines or ["no fault found"])])


def _mode_choice(facts: Mapping[str, Any]) -> str:
    """Return which modes are states, and why others are not, a line each."""
    return "\n".join(mode_choice_lines({"mode_choice": facts})) or "every mode that was tried is a state"


def _mesh_error(facts: Mapping[str, Any]) -> str:
    """Return how far another discretisation is, in sigmas of the gauges."""
    trusted = "" if facts["sigmas_trusted"] else "; the sigmas of the map are not to be trusted"
    return (
        f"{facts['rms_sigma']:.3g} sigma of gauge noise (rms), {facts['largest_sigma']:.3g} at "
        f"{facts['largest_at']}, against {facts['against']}{trusted}"
    )


_WORDS: dict[str, tuple[str, Callable[[Any], str] | None]] = {
    "alarm_levels": ("alarm levels, linear estimate", _levels),
    "flight_alarm_levels": ("alarm levels, nonlinear estimator", _levels),
    "flow": ("flow", _flow),
    "calibration": ("calibrated", _calibration),
    "mesh_error": ("mesh error", _mesh_error),
    "energy_of_modes": ("variance of the snapshots in the modes", lambda value: f"{100.0 * value:.4g} %"),
    "form": ("loads", lambda value: FORMS.get(value, str(value))),
    "symmetry": ("flows taken", lambda value: SYMMETRIES.get(value, str(value))),
    "internal_pressure_Pa": ("", lambda value: value if isinstance(value, str) else f"{value:.6g} Pa"),
    "layout": ("gauge layout", None),
    "mode_choice": ("choice of modes", _mode_choice),
    "modes": ("modes estimated", None),
    "modes_skipped": ("modes left to the noise, not observed", None),
    "snapshots": ("snapshots", lambda value: f"{value} conditions"),
    "strainfmu_version": ("made by strainfmu", None),
}
"""Title of an entry, empty for its name, and what states its value; None for :func:`in_words`."""
