"""What a calibration says in plain words: what is not as the files state, a chi-square that does not fit, and
readings that no error with a name explains.

What has a name is warned of, and the map is made: noise larger than stated, walls that taper or are not round,
gauges and loads at fault. A vehicle that is many standard deviations from the drawing, or readings that no vehicle
fits, mean that loads, units or signs are not what is stated; a map of them would look good and be wrong. So do
many faults at once: what gauges and loads have in common is wrong rather than each of them.
"""

from collections.abc import Sequence

import numpy as np

from builder.calibration.estimate.case_faults import Fault
from builder.calibration.estimate.causes import Evidence, least_of
from builder.calibration.estimate.estimated_vehicle import Estimate
from builder.calibration.estimate.ground_test_faults import too_many
from builder.calibration.estimate.outside_terms import OutsideModel
from builder.calibration.estimate.readings_model import DIRECTIONS, PAD, Cause, ReadingsModel
from builder.structure.as_built.as_built_vehicle import slices

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
        entry = model.entries["cell"][0, k]
        size, std = float(fit.vector[entry]), float(fit.std[entry])
        if _differs(size, std):
            lines.append(
                f"{model.names[entry]}: loads are {100.0 * abs(size):.2g} +- {100.0 * std:.1g} % "
                f"{'larger' if size > 0.0 else 'smaller'} than it reads; calibrate it"
            )
    return lines


def _of_cause(fit: Estimate, cause: Cause) -> str:
    """Return what the readings have set free, its size, and where to state it."""
    model, (scale, text) = fit.model, SAID[cause.kind]
    size, std = scale * fit.vector[cause.entries], scale * fit.std[cause.entries]
    each = [f"{value:.2g} +- {sigma:.1g}" for value, sigma in zip(size, std, strict=True)]
    numbered = {"joint": model.structure.joint_stations, "load cell": tuple(model.full_scale.values())}
    said = text.format(
        cause=cause.kind,
        all=", ".join(each),
        first=each[0],
        rest=", ".join(each[1:]),
        last=each[-1],
        largest=float(np.abs(size).max()),
        rms=float(np.sqrt(np.mean(size**2))),
        std=float(np.sqrt(np.mean(std**2))),
        name=model.names[cause.entries[0]],
        at=numbered[cause.kind][cause.number] if cause.kind in numbered else 0.0,
        point=1e3 * PAD * float(np.abs(size).max()) / scale,
    )
    return f"{said}; it is estimated"


_WALL = "wall: {cause} of {rms:.2g} +- {std:.1g} % rms by region; state calibration."

SAID = {
    "support": (
        1e3,
        "clamp: it yields as {all} mm of the wall's material along and across; state "
        "calibration.clamp_compliance_mm = {largest:.1g}",
    ),
    "joint": (
        1e3,
        "joint at or near {at:.3g} m: it yields as {all} mm of the wall; state calibration.joint_stations_m and "
        "joint_softness_mm = {largest:.1g}",
    ),
    "modulus": (
        100.0,
        "modulus: Young's modulus of the regions of the wall differs by {all} %; state "
        "calibration.region_modulus_percent = {largest:.1g}",
    ),
    "taper": (100.0, f"{_WALL}wall_taper_percent = {{rms:.1g}}"),
    "second harmonic": (100.0, f"{_WALL}wall_second_harmonic_percent = {{rms:.1g}}"),
    "direction": (
        float(np.rad2deg(1.0)),
        f"direction of all forces: turned by {{all}} deg {' and '.join(DIRECTIONS)}; check how they are applied, "
        "and state their directions",
    ),
    "drift": (
        1e6,
        "drift: zeros moved by {rms:.2g} um/m rms between the first and the last case; tare between the cases",
    ),
    "rig": (
        1.0,
        "rig: {all} kg hang on every pad and point that no load cell reads; weigh the rig, and state "
        "errors.rig_mass_kg = {largest:.1g}",
    ),
    "pad size": (
        100.0,
        "size of all pads: it differs by {all} % of their length, of points from none to {point:.2g} mm to each "
        "side; state points as pads",
    ),
    "load cell": (
        100.0,
        "{name}: it is not straight, by {rest} % (quadratic, cubic) of {at:.4g} N; its loads at that are {first} "
        "% larger than it reads; calibrate it over its range, and state full_scale_N",
    ),
    "hysteresis": (
        100.0,
        "hysteresis: a case reads {last} % of the strain before it; return to zero load between the cases",
    ),
}
"""Size of the unit of each cause of the vehicle and the test, over SI, and what is said of it."""


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
