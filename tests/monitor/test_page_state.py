"""What the page is told: every number with its unit, every gauge with its reason, events with their causes."""

import json
import time
from typing import Any

import numpy as np
import pytest
from bus_run import live_run, wait_until
from can_faults import Fault, FaultKind
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from strainfmu.can.machine import Result
from strainfmu.can.page_message import (
    EstimatorFacts,
    GaugePosition,
    estimator_facts,
    layout_message,
    result_message,
)
from strainfmu.can.quality import (
    REASONS,
    BusState,
    Cause,
    Quality,
    all_words,
)
from strainfmu.cosim.estimators.step import ENVELOPE_SCORE
from strainfmu.estimator.health import HealthState
from strainfmu.monitor.events import LISTED
from strainfmu.monitor.message import UNITS, parsed
from strainfmu.monitor.state import COLUMNS, SILENT_AFTER, Answer, MonitorState

NAMES = ("a", "b", "c", "d", "e")
QUALITY_WORDS, CAUSE_WORDS = (all_words()[kind] for kind in ("quality", "cause"))
NO_FRAME, NO_VALUE, FROZEN, HEALING = (REASONS[k] for k in (1, 3, 6, 8))
POSITIONS = [GaugePosition(name, 0.5 * k, 90.0 * k) for k, name in enumerate(NAMES)]


def flags(*held: int) -> np.ndarray:
    found = np.zeros(len(NAMES), dtype=bool)
    found[list(held)] = True
    return found


def message(number: int = 1, **changed: Any) -> dict[str, Any]:
    """Return a datagram of a bridge in order, with what is ``changed``."""
    names = ("force.axial", "force.normal", "force.side", "moment.pitch", "moment.yaw")
    further = {name: 1000.0 + k for k, name in enumerate(names)}
    further |= {f"sigma.{name}": 10.0 for name in names}
    further |= {"M_R": 0.01, "sigma.M_R": 0.002, "section.torsion[1]": -30.0, "sigma.section.torsion[1]": 1.5}
    further |= {ENVELOPE_SCORE: 0.5, "health.chi_square_limit": 30.0, "health.valid_gauges": 5.0}
    result = Result(
        time=1.0,
        quality=Quality.VALID,
        causes=Cause.NONE,
        usable=True,
        valid=np.ones(len(NAMES), dtype=bool),
        strain=np.arange(5.0) * 1e-6,
        dynamic_pressure=9e4,
        mach_number=6.0,
        altitude=2e4,
        age=1e-3,
        age_uncertainty=2e-4,
        coefficients=np.arange(5.0),
        coefficients_std=np.full(5, 0.1),
        chi_square=12.0,
        health=0,
        other_outputs=further,
    )
    return {
        "timestamp": 1000.0 + 0.02 * number,
        "sequence": number,
        "uptime_s": 0.02 * number,
        **result_message(result, POSITIONS, 1.8, Cause.NONE),
        "bus_state": "ERROR_ACTIVE",
        "bus": {"name": "virtual:x", "last_fault": "", "reconnects": 0},
        "recording": {"file": "run.blf", "frames": 10, "lost": 0, "failure": ""},
        "account": {"received": 10, "used": 10, "not accounted for": 0},
        "results": {"VALID": number},
        "period_text": "",
        **changed,
    }


def test_the_senders_period_is_announced_once_and_says_why() -> None:
    right = {"period_text": "period: measured 10 ms, as expected"}
    wrong = {"period_text": "period: expected 10 ms, measured 20 ms", "causes": ["PERIOD"]}
    wrong |= {"quality_name": "UNCONFIRMED", "quality": 7}
    events = events_of(message(0), *(message(k, **right) for k in (1, 2)), *(message(k, **wrong) for k in (3, 4)))
    announced = [event for event in events if event["what"] == "period of the sender"]
    assert [(event["level"], event["why"], event["count"]) for event in announced] == [
        ("note", right["period_text"], 1),
        ("alarm", wrong["period_text"], 1),
    ]
    (quality,) = [event for event in events if event["what"] == "quality UNCONFIRMED"]
    assert quality["why"] == f"PERIOD: {wrong['period_text']}"


def events_of(*messages: dict[str, Any], end: float | None = None) -> list[dict[str, Any]]:
    state = MonitorState()
    for number, content in enumerate(messages):
        state.take(json.dumps(content).encode(), 0.02 * number)
    assert state.refused == 0
    found = json.loads(state.snapshot(0.02 * len(messages) if end is None else end))
    return list(found["events"])


def numbers_without_unit(content: Any, units: Any, where: str = "") -> list[str]:
    """Return the paths of numbers in ``content`` for which ``units`` names no unit."""
    if isinstance(content, dict):
        missing = []
        for name, value in content.items():
            unit = units if isinstance(units, str) else (units or {}).get(name)
            missing += numbers_without_unit(value, unit, f"{where}.{name}")
        return missing
    is_number = isinstance(content, int | float) and not isinstance(content, bool)
    return [where] if is_number and not isinstance(units, str) else []


@pytest.mark.fast
def test_a_suspect_sensor_has_its_name_and_does_not_count_as_a_gauge() -> None:
    """An estimator counts auxiliary sensors behind the gauges."""
    further = {"health.suspect_gauge": 7.0, "health.suspects": 1.0, "health.valid_gauges": 7.0}
    valid = np.ones(len(NAMES), dtype=bool)
    result = Result(
        time=1.0,
        quality=Quality.SUSPECT,
        causes=Cause.HEALTH,
        valid=valid,
        strain=np.zeros(5),
        other_outputs=further,
    )
    found = result_message(result, POSITIONS, 1.8, Cause.NONE, ("port_0deg", "port_180deg"))
    assert found["suspect_gauge"] == "port_180deg"
    assert found["gauges_used"] == len(NAMES)


def test_every_number_of_the_state_has_a_unit_and_no_field_is_missing() -> None:
    state = MonitorState()
    state.take(json.dumps(layout_message(POSITIONS, EstimatorFacts(vehicle="V", score_limit=1.8))).encode(), 0.0)
    state.take(json.dumps(message()).encode(), 0.0)
    content = json.loads(state.snapshot(0.1))
    latest = content["latest"]
    assert content["units"] == UNITS
    assert numbers_without_unit(latest, UNITS) == []
    assert [name for name in UNITS if name not in latest] == []
    assert [name for name, value in latest.items() if value is None] == ["health_text", "suspect_gauge"]
    assert latest["loads"]["force.normal"] == 1001.0
    assert latest["other_loads"] == {
        "M_R": 0.01,
        "sigma.M_R": 0.002,
        "section.torsion[1]": -30.0,
        "sigma.section.torsion[1]": 1.5,
    }
    assert (latest["chi_square_limit"], latest["gauges_used"], latest["not_used"]) == (30.0, 5, {})
    assert (latest["age_ms"], latest["age_uncertainty_ms"]) == (1.0, pytest.approx(0.2))
    assert len(content["points"][0]) == len(COLUMNS) == len(content["columns"])


@pytest.mark.fast
def test_every_cause_and_state_has_words() -> None:
    kinds = {"quality": Quality, "cause": Cause, "bus": BusState, "health": HealthState}
    assert {kind: set(words) for kind, words in all_words().items()} == {
        kind: {member.name for member in members} for kind, members in kinds.items()
    }
    assert all(text for words in all_words().values() for text in words.values())


@pytest.mark.fast
def test_events_have_times_and_causes() -> None:
    degraded = {
        "quality": 3,
        "quality_name": "DEGRADED",
        "causes": ["PARTIAL_CYCLE"],
        "causes_since": ["PARTIAL_CYCLE"],
        "not_used": {"d": NO_FRAME, "e": NO_FRAME},
    }
    suspect = {
        "quality": 4,
        "quality_name": "SUSPECT",
        "causes": ["HEALTH"],
        "health_name": "SUSPECT",
        "suspect_gauge": "b",
        "suspects": 2,
    }
    off = {"bus_state": "BUS_OFF", "bus": {"name": "virtual:x", "last_fault": "bus off", "reconnects": 1}}
    full = {"recording": {"file": "run.blf", "frames": 10, "lost": 7, "failure": "No space left on device"}}
    found = events_of(
        message(1),
        message(2, **degraded),
        message(3),
        message(4, **suspect),
        message(5, **off),
        message(6, **full),
    )
    lines = [f"{event['what']}: {event['why']}" for event in found]
    for expected in (
        "bridge connected: virtual:x",
        "quality DEGRADED: PARTIAL_CYCLE: frames of the cycle are missing, or come after trust.deadline_cycles",
        "2 gauges (d, e) not used: no frame",
        "2 gauges (d, e) used again: ",
        "gauge b suspect: does not fit the others; 2 that cannot be distinguished",
        "quality SUSPECT: HEALTH: SUSPECT, one gauge does not fit the others",
        "no gauge suspect any more: ",
        "bus BUS_OFF: bus off",
        "recording ended early: No space left on device",
        "recording lost 7 frames: ",
    ):
        assert expected in lines
    assert found[lines.index("bus BUS_OFF: bus off")]["first"] == pytest.approx(1000.1)
    assert [event["last"] for event in found] == sorted(event["last"] for event in found)


@pytest.mark.fast
def test_a_gauge_that_heals_is_no_new_event() -> None:
    frozen, healing = (message(k, not_used={"d": reason}) for k, reason in ((2, FROZEN), (3, HEALING)))
    found = events_of(message(1), frozen, healing, message(4))
    assert [event["what"] for event in found if event["kind"] == "gauges"] == [
        "gauge d not used",
        "gauge d used again",
    ]


@pytest.mark.fast
def test_a_cause_between_two_datagrams_is_not_lost() -> None:
    found = events_of(message(1), message(2, causes_since=["OVERLOAD"]))
    assert [(event["what"], event["kind"]) for event in found][-1] == ("OVERLOAD (passed)", "cause")


@pytest.mark.fast
def test_a_flapping_input_is_counted_and_does_not_fill_the_list() -> None:
    bad = {"quality": 5, "quality_name": "STALE", "causes": ["SILENT"], "not_used": dict.fromkeys(NAMES, NO_FRAME)}
    found = events_of(*(message(k, **(bad if k % 2 else {})) for k in range(1, 400)))
    assert len(found) < 20 < LISTED
    assert max(event["count"] for event in found) > 90
    assert any(event["what"] == "all 5 gauges not used" for event in found)


@pytest.mark.fast
def test_silence_and_a_new_bridge_are_events() -> None:
    silent = events_of(message(1), end=SILENT_AFTER + 0.1)
    assert [event["what"] for event in silent][-1] == "bridge gone"
    again = events_of(message(40), message(41), message(1))
    assert [event["what"] for event in again].count("bridge connected") == 2
    lost = events_of(message(1), message(5))
    assert [event["what"] for event in lost][-1].startswith("3 datagrams")


@pytest.mark.fast
def test_a_point_of_the_history_has_the_worst_quality_since_the_one_before() -> None:
    state = MonitorState()
    for number, (quality, name) in enumerate(((1, "VALID"), (6, "INVALID"), (7, "UNCONFIRMED"), (1, "VALID"))):
        content = message(number + 1, quality=quality, quality_name=name)
        state.take(json.dumps(content).encode(), 0.04 * number)
    points = json.loads(state.snapshot(0.2))["points"]
    assert [point[1] for point in points] == [1, 6]


@pytest.mark.fast
def test_a_page_gets_what_it_has_not_seen() -> None:
    state = MonitorState()
    state.take(json.dumps(message(1)).encode(), 0.0)
    text, seen = state.news(0.0, None)
    assert (len(json.loads(text)["points"]), "words" in json.loads(text)) == (1, True)
    text, seen = state.news(0.0, seen)
    content = json.loads(text)
    assert (content["points"], "events" in content, "words" in content) == ([], False, False)
    state.take(json.dumps(message(2, causes=["OLD"])).encode(), 1.0)
    content = json.loads(state.news(1.0, seen)[0])
    assert (len(content["points"]), content["events"][-1]["what"]) == (1, "OLD")


@pytest.mark.fast
def test_limits_of_the_map_come_from_the_fmu(synthetic: SyntheticFiles) -> None:
    facts = estimator_facts(synthetic.estimator_1)
    # coefficient_range of the synthetic map
    assert facts.ranges == {
        "C_A": (0.1, 0.2),
        "C_N": (-1.0, 1.0),
        "C_Y": (-1.0, 1.0),
        "M_P": (-0.5, 0.5),
        "M_Y": (0.0, 0.0),
    }
    assert facts.vehicle.startswith("synthetic vehicle 1")
    layout = parsed(json.dumps(layout_message(POSITIONS, facts)).encode())["layout"]
    assert layout["coefficient_range"]["C_N"] == [-1.0, 1.0]


def test_a_bridge_reports_loads_reasons_and_its_recording(synthetic: SyntheticFiles, tmp_path: Any) -> None:
    """Gauges without a value in a real run, their reason from the bridge's own checks to the page's state."""
    from strainfmu.monitor.server import Monitor

    monitor = Monitor(("127.0.0.1", 0), ("127.0.0.1", 0))
    try:
        live_run(
            synthetic.estimator_1,
            "page_state",
            n_cycles=160,
            faults=(Fault(kind=FaultKind.NO_VALUE, start=60, cycles=100, seed=3),),
            record=tmp_path / "run.blf",
            publish="{}:{}".format(*monitor.listens_at),
        )
        wait_until(lambda: NO_VALUE in json.dumps(monitor.state.snapshot(time.monotonic())))
        content = json.loads(monitor.state.snapshot(time.monotonic()))
    finally:
        monitor.close()
    latest = content["latest"]
    assert numbers_without_unit(latest, UNITS) == []
    assert latest["recording"]["file"] == "run.blf"
    assert latest["account"]["not accounted for"] == 0
    assert len(latest["strain_um_per_m"]) == N_GAUGES
    causes = " ".join(event["why"] for event in content["events"])
    assert NO_VALUE in causes
    loads = [point[COLUMNS.index("force.normal")] for point in content["points"]]
    assert any(value is not None for value in loads)


@pytest.mark.fast
@pytest.mark.parametrize(
    ("changed", "usable", "why"),
    [
        ({}, True, QUALITY_WORDS["VALID"]),
        ({"quality_name": "DEGRADED", "causes": ["GAUGE_INVALID"]}, True, CAUSE_WORDS["GAUGE_INVALID"]),
        ({"quality_name": "UNPROTECTED"}, True, QUALITY_WORDS["UNPROTECTED"]),
        ({"quality_name": "SUSPECT", "usable": 0, "health_name": "SUSPECT", "health_text": "g3"}, False, "g3"),
        ({"quality_name": "UNCONFIRMED", "usable": 0, "causes": ["PERIOD"]}, False, CAUSE_WORDS["PERIOD"]),
        ({"quality_name": "STALE", "usable": 0, "causes": ["OLD"]}, False, CAUSE_WORDS["OLD"]),
    ],
)
def test_may_these_loads_be_used(changed: dict[str, Any], usable: bool, why: str) -> None:
    answer = Answer()
    assert answer.content() is None
    answer.take(parsed(json.dumps(message(1, **changed)).encode()))
    assert answer.content() == {"usable": usable, "since": 1000.02, "why": why}
    answer.take(parsed(json.dumps(message(2, **changed)).encode()))
    assert (answer.content() or {})["since"] == 1000.02, "since the first of them"
