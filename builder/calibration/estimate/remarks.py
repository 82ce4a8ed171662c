"""What a calibration says in plain words: what is not as the files state, a chi-square that does not fit, and
readings that no error with a name explains.

What has a name is warned of, and the map is made: noise larger than stated, walls that taper or are not round,
gauges and loads at fault. A vehicle that is many standard deviations from the drawing, or readings that no vehicle
fits, mean that loads, units or signs are not what is stated; a map of them would look good and be wrong. So do
many faults at once: what gauges and loads have in common is wrong rather than each of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from builder.calibration.estimate.cause import Cause
from builder.calibration.estimate.causes import Evidence, least_of
from builder.calibration.estimate.estimated_vehicle import Estimate
from builder.calibration.estimate.ground_test_faults import Fault, too_many
from builder.calibration.estimate.outside_terms import OutsideModel
from builder.calibration.estimate.readings_model import DIRECTIONS, PAD, ReadingsModel
from builder.structure.as_built.as_built_vehicle import slices
from strainfmu.arrays import FloatArray

NAMED = 3.0
"""Standard deviations after the test from which a difference is named."""

SMALLEST = 0.01
"""Relative difference from which one is named [1]."""

LEADING = 3
"""Causes that a refusal names."""


FARTHEST = 6.0
"""Standard deviations that a parameter may be from its value before the test.

Of a sound test the largest was 2.8, of single samples said to be means of 25 it was 5.1; all readings times 1.5
move the modulus by 9, times 0.5 the gain by 15."""

MOST_NOISE = 6.0
"""Noise over what is stated that counts as noise: single samples said to be means of 25 are 5."""

MISFIT = 3.0
"""Chi-square per reading, for noise as found, from which no vehicle fits. Walls that taper by 2 % leave 1.3."""


def unexplained(fit: Estimate, outside: OutsideModel, faults: Sequence[Fault]) -> str:
    """Return what speaks against a map of ``found``, in one clause; empty where every error has a name."""
    many = too_many(fit.model, faults)
    if many:
        return f"{many}; leading causes in common: {leading_causes(fit)}"
    noise = max(min(outside.noise_factor, MOST_NOISE / outside.counted), 1.0)
    name, size = fit.farthest
    against = []
    if fit.per_reading > MISFIT * noise**2:
        against.append(f"chi-square per reading is {fit.per_reading:.3g} (1 is expected)")
    if not size <= FARTHEST:
        against.append(
            f"{name} would be {size:.1f} standard deviations from what the vehicle file or the test states"
        )
    return f"{fit.far_off}; {', '.join(against)}" if against else ""


def leading_causes(fit: Estimate) -> str:
    """Return the causes that all or many readings may have in common, the most probable first, in one clause."""
    every = Evidence(fit.model, fit.used, fit.vector).ranking()
    common = [(cause, gain) for cause, gain in every if cause.where in ("vehicle", "noise") and gain > 0.0][
        :LEADING
    ]
    known = dict.fromkeys(cause.kind for cause in fit.model.causes if cause.where in ("vehicle", "noise"))
    names = [*(f"{kind} (estimated)" for kind in known)]
    names += [f"{cause.kind} (odds of 1e{(gain + least_of(cause)) / np.log(10.0):.0f})" for cause, gain in common]
    return ", ".join(names) or "none of the causes that are known"


def remarks(fit: Estimate) -> tuple[str, ...]:
    """Return a line for each thing that the user should look at, none where all is as stated."""
    model = fit.model
    causes = [_of_cause(fit, cause) for cause in model.causes if cause.where == "vehicle"]
    gauges = dict.fromkeys(cause.number for cause in model.causes if cause.where == "gauge")
    scatter = [_of_gauge(model, number) for number in gauges]
    lines = [_of_mass(fit), *_of_load_cells(fit), *causes, *scatter, _of_noise(fit), _of_tolerances(fit)]
    lines += [_at_breaks(model), fit.unsettled, fit.disagreement]
    return tuple(line for line in lines if line)


def _at_breaks(model: ReadingsModel) -> str:
    structure = model.structure
    if not structure.at_break.any():
        return ""
    names = ", ".join(np.array(structure.gauges.names)[structure.at_break])
    return (
        f"gauges within one element of a change of slope or thickness count as less exact: {names}; strain "
        "changes there within millimetres"
    )


def _differs(size: float, std: float) -> bool:
    return abs(size) >= SMALLEST and abs(size) > NAMED * std


def _of_mass(fit: Estimate) -> str:
    part = fit.parameters
    entry = slices(part.counts)["mass"].start
    size, std = float(fit.vector[entry]), float(fit.std[entry])
    if not _differs(size, std):
        return ""
    return (
        f"mass: the vehicle weighs {100.0 * abs(size):.2g} +- {100.0 * std:.1g} % "
        f"{'more' if size > 0.0 else 'less'} than the vehicle file states; weigh it, and check "
        "material.density_kg_per_m3 and what is mounted on the vehicle"
    )


def _of_load_cells(fit: Estimate) -> list[str]:
    model, lines = fit.model, []
    curved = {cause.number for cause in model.causes if cause.kind == "load cell"}
    for k in sorted(set(range(len(model.cells))) - curved):
        entry = model.cell_entries.start + k
        size, std = float(fit.vector[entry]), float(fit.std[entry])
        if _differs(size, std):
            lines.append(
                f"{model.names[entry]}: loads are {100.0 * abs(size):.2g} +- {100.0 * std:.1g} % "
                f"{'larger' if size > 0.0 else 'smaller'} than it reads; calibrate it"
            )
    return lines


def _of_cause(fit: Estimate, cause: Cause) -> str:
    """Return what the readings have set free, its size, and where to state it."""
    size, std = fit.vector[cause.entries], fit.std[cause.entries]
    return f"{_SAID[cause.kind](fit, cause, size, std)}; it is estimated"


def _support(fit: Estimate, cause: Cause, size: FloatArray, std: FloatArray) -> str:
    return (
        f"clamp: it yields as {_pair(1e3 * size, 1e3 * std)} mm of the wall's material along and across; state "
        f"calibration.clamp_compliance_mm = {1e3 * float(np.abs(size).max()):.1g}"
    )


def _joint(fit: Estimate, cause: Cause, size: FloatArray, std: FloatArray) -> str:
    station = fit.model.structure.joint_stations[cause.number]
    return (
        f"joint at or near {station:.3g} m: it yields as {_pair(1e3 * size, 1e3 * std)} mm of the wall; state "
        f"calibration.joint_stations_m and joint_softness_mm = {1e3 * abs(float(size[0])):.1g}"
    )


def _modulus(fit: Estimate, cause: Cause, size: FloatArray, std: FloatArray) -> str:
    return (
        f"modulus: Young's modulus of the regions of the wall differs by {_pair(100.0 * size, 100.0 * std)} %; "
        f"state calibration.region_modulus_percent = {100.0 * float(np.abs(size).max()):.1g}"
    )


def _wall(entry: str) -> Callable[[Estimate, Cause, FloatArray, FloatArray], str]:
    def said(fit: Estimate, cause: Cause, size: FloatArray, std: FloatArray) -> str:
        rms = 100.0 * float(np.sqrt(np.mean(size**2)))
        sigma = 100.0 * float(np.sqrt(np.mean(std**2)))
        size_of = f"{rms:.2g} +- {sigma:.1g} % rms by region"
        return f"wall: {cause.kind} of {size_of}; state calibration.{entry} = {rms:.1g}"

    return said


def _direction(fit: Estimate, cause: Cause, size: FloatArray, std: FloatArray) -> str:
    directions = " and ".join(DIRECTIONS)
    return (
        f"direction of all forces: turned by {_pair(np.rad2deg(size), np.rad2deg(std))} deg {directions}; check "
        "how they are applied, and state their directions"
    )


def _drift(fit: Estimate, cause: Cause, size: FloatArray, std: FloatArray) -> str:
    rms = 1e6 * float(np.sqrt(np.mean(size**2)))
    return f"drift: zeros moved by {rms:.2g} um/m rms between the first and the last case; tare between the cases"


def _hysteresis(fit: Estimate, cause: Cause, size: FloatArray, std: FloatArray) -> str:
    return (
        f"hysteresis: a case reads {_pair(100.0 * size[-1:], 100.0 * std[-1:])} % of the strain before it; "
        "return to zero load between the cases"
    )


def _rig(fit: Estimate, cause: Cause, size: FloatArray, std: FloatArray) -> str:
    return (
        f"rig: {_pair(size, std)} kg hang on every pad and point that no load cell reads; weigh the rig, and "
        f"state errors.rig_mass_kg = {abs(float(size[0])):.1g}"
    )


def _pad_size(fit: Estimate, cause: Cause, size: FloatArray, std: FloatArray) -> str:
    return (
        f"size of all pads: it differs by {_pair(100.0 * size, 100.0 * std)} % of their length, of points from "
        f"none to {1e3 * PAD * abs(float(size[0])):.2g} mm to each side; state points as pads"
    )


def _load_cell(fit: Estimate, cause: Cause, size: FloatArray, std: FloatArray) -> str:
    model = fit.model
    name = model.names[cause.entries[0]]
    return (
        f"{name}: it is not straight, by {_pair(100.0 * size[1:], 100.0 * std[1:])} % (quadratic, cubic) of "
        f"{model.full_scale[model.cells[cause.number]]:.4g} N; its loads at that are "
        f"{_pair(100.0 * size[:1], 100.0 * std[:1])} % larger than it reads; calibrate it over its range, and "
        "state full_scale_N"
    )


def _of_gauge(model: ReadingsModel, number: int) -> str:
    name = model.structure.gauges.names[number]
    scatter = 1e6 * float(np.sqrt(np.mean(model.test.reading_stds[:, number] ** 2)))
    return (
        f"gauge '{name}': its readings differ from what the others predict by about {scatter:.2g} um/m, more than "
        "stated; they are used, and count as less exact"
    )


def _of_noise(fit: Estimate) -> str:
    factor = fit.model.noise_factor
    if np.isclose(factor, 1.0):
        return ""
    return (
        f"noise: the readings scatter about {factor:.2g} times as much as stated, and count as such; state their "
        "noise (readings.reading_std_um_per_m, or windows of more samples)"
    )


def _of_tolerances(fit: Estimate) -> str:
    if fit.tolerances_hold:
        return ""
    return (
        f"tolerances: vehicle and loads differ {np.sqrt(fit.from_priors):.2g} times as much from what the files "
        "state as their tolerances say; state larger ones"
    )


def _pair(size: FloatArray, std: FloatArray) -> str:
    return ", ".join(f"{value:.2g} +- {sigma:.1g}" for value, sigma in zip(size, std, strict=True))


_SAID: dict[str, Callable[[Estimate, Cause, FloatArray, FloatArray], str]] = {
    "support": _support,
    "joint": _joint,
    "modulus": _modulus,
    "taper": _wall("wall_taper_percent"),
    "second harmonic": _wall("wall_second_harmonic_percent"),
    "direction": _direction,
    "drift": _drift,
    "rig": _rig,
    "pad size": _pad_size,
    "load cell": _load_cell,
    "hysteresis": _hysteresis,
}
