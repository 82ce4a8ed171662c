"""What is said of a tare: on the bus, in an FMU, and of a recording alike; the numbers are the core's."""

from __future__ import annotations

from collections.abc import Mapping
from math import isnan

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.signal_names import ZERO, ZERO_COMMON_STD, ZERO_STD
from strainfmu.estimator.zeros.tare import LEAST_PART, LEAST_SAMPLES, LOUD, Tare, TareFault, TareLimits


def judged_tare(inverse_map: InverseMap, outcome: Mapping[str, FloatArray], limits: TareLimits) -> Tare:
    """Return the tare of the gauges of ``held`` by ``outcome`` of the core, which names its values.

    Raises
    ------
    InputError
        The window holds too few readings.
    """
    reasons, samples = TareFault(int(outcome["faults"][0])), int(outcome["samples"][0])
    if TareFault.SHORT in reasons:
        raise InputError(f"window: expected at least {LEAST_SAMPLES} samples, got {samples}")
    return Tare(
        zeros=zeros_of(outcome),
        samples=samples,
        memory=float(outcome["memory"][0]),
        gauges=int(outcome["gauges"][0]),
        rms=float(outcome["rms"][0]),
        largest_std=float(outcome["largest_std"][0]),
        reasons=reasons,
        faults=_faults(inverse_map, reasons, outcome, limits),
        notes=_notes(inverse_map, outcome),
    )


def zeros_of(outcome: Mapping[str, FloatArray]) -> GaugeZeros:
    """Return the zeros in ``outcome``."""
    return GaugeZeros(value=outcome[ZERO], std=outcome[ZERO_STD], common_std=float(outcome[ZERO_COMMON_STD][0]))


def loads_fault(dynamic_pressure: float, limits: TareLimits, where: str = "") -> str:
    """Return why loads are not known at ``dynamic_pressure`` [Pa], NaN where it is not stated; "" if they are.

    ``where`` says where it should be, as " on the bus".
    """
    if isnan(dynamic_pressure):
        return f"loads are not known: no dynamic pressure{where}"
    if abs(dynamic_pressure) > limits.dynamic_pressure:
        return (
            f"loads are not known: dynamic pressure is {dynamic_pressure:.4g} Pa, expected at most "
            f"{limits.dynamic_pressure:g} Pa"
        )
    return ""


def refusal(tare: Tare) -> str:
    """Return why the zeros of a window are not to be used; "" if they are."""
    if tare.faults:
        return "; ".join(tare.faults)
    if TareFault.FEW_GAUGES in tare.reasons:
        return f"{tare.gauges} of {len(tare.zeros.value)} gauges read"
    return ""


def refused_text(why: str) -> str:
    """Return the line of a tare that is refused."""
    return f"tare refused: {why}; zeros as before"


def taken_text(tare: Tare, unit: str) -> str:
    """Return the line of zeros that are taken; ``unit`` says what their window counts, as "cycles"."""
    return (
        f"tare taken: {tare.gauges} zeros from {tare.samples} {unit}, rms {1e6 * tare.rms:.4g} um/m, standard "
        f"deviations up to {1e6 * tare.largest_std:.2g} um/m each and {1e6 * tare.zeros.common_std:.2g} um/m in "
        "common"
    )


def _faults(
    inverse_map: InverseMap, reasons: TareFault, outcome: Mapping[str, FloatArray], limits: TareLimits
) -> tuple[str, ...]:
    of = {name: float(values[0]) for name, values in outcome.items() if len(values) == 1}

    def gauge(kind: str) -> str:
        return inverse_map.gauge_names[int(of[f"{kind}_gauge"]) - 1]

    noise = inverse_map.noise_std[int(of["moving_gauge"]) - 1]
    lines = {
        TareFault.PRESSURE: f"loads are not known: dynamic pressure reaches {of[DYNAMIC_PRESSURE]:.4g} Pa, "
        f"expected at most {limits.dynamic_pressure:g} Pa",
        TareFault.DRIFTS: f"readings drift: gauge '{gauge('drifting')}' by {1e6 * of['drift']:.3g} um/m over the "
        f"window, expected at most {1e6 * limits.drift:g} um/m",
        TareFault.MOVES: f"readings move: gauge '{gauge('moving')}' by {1e6 * of['moving_scatter']:.3g} um/m rms, "
        f"expected at most {LOUD:g} times its noise of {1e6 * noise:.3g} um/m",
        TareFault.TOO_LARGE: f"no plausible zero: gauge '{gauge('largest')}' reads {1e6 * of['largest']:.4g} "
        f"um/m, expected at most {1e6 * limits.zero:g} um/m",
        TareFault.LIKE_LOAD: f"readings look like load: {1e6 * of['along']:.3g} um/m of them lie along the "
        f"strain of flights, expected at most {1e6 * of['along_limit']:.3g} um/m of random zeros",
    }
    return tuple(line for fault, line in lines.items() if fault in reasons)


def _notes(inverse_map: InverseMap, outcome: Mapping[str, FloatArray]) -> tuple[str, ...]:
    reads, scatter = outcome["reads"] != 0.0, outcome["scatter"]
    silent = [inverse_map.gauge_names[i] for i in np.flatnonzero(~reads)]
    seldom = f"reads in less than {100 * LEAST_PART:g} % of the window: no zero, not to be used"
    notes = [f"gauge '{name}': {seldom}" for name in silent]
    still = [inverse_map.gauge_names[i] for i in np.flatnonzero(reads & (scatter == 0.0))]
    notes += [f"gauge '{name}': every reading is the same: is it alive?" for name in still]
    lost, samples = int(outcome["samples_without"][0]), int(outcome["samples"][0])
    if lost == samples:
        notes.append("dynamic pressure is not recorded: that air does not load the vehicle is taken on trust")
    elif lost:
        notes.append(
            f"dynamic pressure has no value in {lost} of {samples} samples: that air does not load "
            "the vehicle then is taken on trust"
        )
    return tuple(notes)
