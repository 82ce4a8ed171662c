"""The words for qualities, causes, states of the bus and of the estimate, for people who watch a run."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum

from strainfmu.can.cycle.states.bus_state import BusState
from strainfmu.can.cycle.states.quality import Cause, Quality
from strainfmu.estimator.health import HealthState

QUALITY_WORDS = {
    Quality.NO_DATA: "nothing trustworthy received since the start",
    Quality.VALID: "every gauge valid, fresh and protected",
    Quality.UNPROTECTED: "complete and plausible, but the input has no end-to-end protection",
    Quality.DEGRADED: "gauges left out or frames dropped: sigma has grown",
    Quality.SUSPECT: "for information only: 3 sigma need not hold",
    Quality.STALE: "input too old: no coefficients",
    Quality.INVALID: "nothing can be computed: no coefficients",
    Quality.UNCONFIRMED: "for information only: not proven to be the newest strains of the one sender",
}

CAUSE_WORDS = {
    Cause.PARTIAL_CYCLE: "frames of the cycle are missing",
    Cause.GAUGE_INVALID: "a gauge has no value or fails a check",
    Cause.NOT_TRUSTED: "a frame is not trusted end to end",
    Cause.CYCLE_CRC: "CRC or counter over the cycle does not fit",
    Cause.OLD: "strains are older than allowed",
    Cause.FROZEN: "strains do not change",
    Cause.SILENT: "no frames in time",
    Cause.DYNAMIC_PRESSURE: "dynamic pressure is missing, old or not plausible",
    Cause.CLOCK_JUMP: "the sender's clock or counter jumped: a restart",
    Cause.SENDER_STATUS: "the sender reports a fault",
    Cause.HEALTH: "the estimator reports it in its health",
    Cause.STEP_FAILED: "the estimator refused the step",
    Cause.OVERLOAD: "frames were dropped: no time for them",
    Cause.BUS: "the bus is passive, off or was reopened",
    Cause.NAVIGATION: "Mach number, altitude or a parameter is no longer known",
    Cause.TEMPERATURE: "a temperature is no longer known: sigma is larger",
    Cause.SENSOR: "an auxiliary sensor or thrust is no longer known: it is left out",
    Cause.REPEATS: "strains of an earlier cycle, bit by bit: the sender repeats a buffer",
    Cause.PERIOD: "period: the sender's differs from the expected one",
    Cause.NOT_AUTHENTIC: "a frame is not from the sender that holds the key, or is older than one seen before",
    Cause.TARE_RUNNING: "strains are collected for a tare",
    Cause.TARE_REFUSED: "a tare was asked for and refused: zeros are as before",
    Cause.ZEROS_TAKEN: "a tare was taken: the zeros of the gauges are new",
    Cause.HIDDEN_DELAY: "older than stated, perhaps: a slow clock, a growing delay, or cycles lost before",
    Cause.UNPROVEN_RESTART: "a restart that may be a recording, or strains that stay late: confirm the sender",
    Cause.SECOND_SENDER: "a second sender of the same frames",
    Cause.SECOND_BRIDGE: "a second bridge answers on the same identifiers",
}

BUS_WORDS = {
    BusState.ERROR_ACTIVE: "in order",
    BusState.ERROR_WARNING: "errors on the bus",
    BusState.ERROR_PASSIVE: "many errors on the bus: passive",
    BusState.BUS_OFF: "bus off",
    BusState.DISCONNECTED: "disconnected, to be reopened",
}

HEALTH_WORDS = {
    HealthState.OK: "residual as expected",
    HealthState.INCONSISTENT: "the strains fit no known pressure",
    HealthState.NO_COEFFICIENTS: "no usable dynamic pressure",
    HealthState.INVALID: "no gauge gives a valid strain, or all read exactly zero",
    HealthState.DEGRADED: "gauges or navigation left out, sigma has grown",
    HealthState.UNIDENTIFIED: "too few gauges identify the state",
    HealthState.SUSPECT: "one gauge does not fit the others",
    HealthState.OUTSIDE: "outside what the map covers",
}


def all_words() -> dict[str, dict[str, str]]:
    """Return the words by kind and name; a cause or state without words is its name in lower case."""
    kinds: dict[str, Mapping[Enum, str | None]] = {
        "quality": {member: QUALITY_WORDS.get(member) for member in Quality},
        "cause": {member: CAUSE_WORDS.get(member) for member in Cause},
        "bus": {member: BUS_WORDS.get(member) for member in BusState},
        "health": {member: HEALTH_WORDS.get(member) for member in HealthState},
    }
    return {
        kind: {member.name: words or _plain(member.name) for member, words in found.items()}
        for kind, found in kinds.items()
    }


def _plain(name: str) -> str:
    return name.replace("_", " ").lower()
