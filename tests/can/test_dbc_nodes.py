"""Nodes that know the DBC file alone: the script in the documentation, and whoever reads the results."""

import importlib.util
from pathlib import Path
from types import ModuleType

import cantools
import numpy as np
import pytest
from can_case import CYCLE, Truth, dbc_text_of, gauge_names, layout_of, run_core
from composed_frames import BridgeStatus, ResultFrames
from page_results import altered

from strainfmu.can.dbc_writer import dbc_text
from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import from_message
from strainfmu.can.machine import Result
from strainfmu.can.profiles import PROFILES, Identifiers, configuration_of
from strainfmu.can.quality import Cause, FrameClass, Quality
from strainfmu.can.result_frames import result_layouts
from strainfmu.cosim.estimators.step import ENVELOPE_SCORE

EXAMPLE = Path(__file__).parents[2] / "docs" / "howto" / "can_cantools_example.py"


@pytest.fixture(scope="module")
def example() -> ModuleType:
    """Return the documented script as a module."""
    spec = importlib.util.spec_from_file_location("can_cantools_example", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_script_in_the_docs_writes_frames_that_the_bridge_accepts(example: ModuleType) -> None:
    database = cantools.database.load_string(dbc_text_of("fd64", 30), "dbc")
    layout, truth = layout_of("fd64", 30), Truth(30, 1)
    frames = []
    for k in range(30):
        strain, pressure = truth.cycle(k)
        by_name = {f"gauge_{i}": 1e6 * value for i, value in enumerate(strain)}
        heard = None if k < 5 else ((k - 1) % 256, round((k - 1) * CYCLE * 1e6), (k - 1) * CYCLE + 1e-3)
        messages = example.strain_frames(
            database, k, k * CYCLE, by_name.__getitem__, pressure, session=3, heard=heard
        )
        frames += [from_message(message, k * CYCLE + 1e-4 * i) for i, message in enumerate(messages)]
    results, core = run_core(layout, frames, 30)
    assert [result.quality for result in results[5:]] == [Quality.VALID] * 25
    np.testing.assert_allclose(results[-1].strain, truth.cycle(29)[0], atol=0.126e-6)
    assert core.account.received - core.account.classes[FrameClass.USED] == 12, (
        "except in the three cycles until they are trusted"
    )


RESULT = Result(
    time=2.0,
    quality=Quality.DEGRADED,
    causes=Cause.GAUGE_INVALID | Cause.HEALTH,
    valid=np.arange(54) > 2,
    strain=np.zeros(54),
    dynamic_pressure=95.8e3,
    age=0.0123,
    sample_time=123_456_789,
    counter=77,
    coefficients=np.array([0.02, 0.61, -0.02, -0.18, 0.0123]),
    coefficients_std=np.array([0.001, 0.002, 0.003, 0.004, 0.005]),
    chi_square=48.5,
    health=4,
    arrival=1.99,
)


@pytest.mark.parametrize("form", ["fd", "classic-le"])
def test_results_are_read_by_cantools(form: str, example: ModuleType) -> None:
    layouts = result_layouts(form, Identifiers(), CYCLE)
    database = cantools.database.load_string(dbc_text(layouts, "test"), "dbc")
    composer = ResultFrames(layouts, configuration_of("fd64", gauge_names(54)))
    values: dict = {}
    for count in range(20):
        for frame in composer.of_result(RESULT):
            decoded = database.decode_message(frame.identifier, frame.data, decode_choices=False)
            assert decoded["E2E_Counter"] == count % (256 if form == "fd" else 15)
            values |= decoded
            if form == "fd":
                assert example.is_intact(frame.data, example.data_id_of(database.messages[0]))
    # float32, or the documented steps of 16 bits.
    close = 1e-7 if form == "fd" else 2.51e-4
    names = ("C_A", "C_N", "C_Y", "M_P", "M_Y")
    np.testing.assert_allclose([values[n] for n in names], RESULT.coefficients, rtol=1e-6, atol=close)
    sigmas = [values[f"sigma_{n}"] for n in names]
    np.testing.assert_allclose(sigmas, RESULT.coefficients_std, rtol=1e-6, atol=min(close, 5.1e-5))
    assert values["ChiSquare"] == pytest.approx(48.5)
    assert values["Age"] == pytest.approx(12.3)
    assert (values["Quality"], values["Health"], values["GaugesUsed"]) == (3, 4, 51)
    assert (values["AnsweredCounter"], values["Causes"]) == (77, int(RESULT.causes))
    if form == "fd":
        assert values["SampleTime"] == 123_456_789
        assert values["UsedPressure"] == pytest.approx(95.8e3)


@pytest.mark.parametrize("form", ["fd", "classic-le"])
def test_a_result_outside_the_map_says_so(form: str) -> None:
    layouts = result_layouts(form, Identifiers(), CYCLE)
    database = cantools.database.load_string(dbc_text(layouts, "test"), "dbc")
    for score, shown in ((0.0, 0.0), (4.26, 4.3), (25.4, 25.4), (1e6, 25.4), (np.nan, "NotAvailable")):
        values: dict = {}
        for frame in ResultFrames(layouts, 1).of_result(
            altered(RESULT, quality=Quality.SUSPECT, health=7, other_outputs={ENVELOPE_SCORE: score})
        ):
            values |= database.decode_message(frame.identifier, frame.data)
        assert (str(values["Quality"]), str(values["Health"])) == ("Suspect", "Outside")
        if form != "fd":
            found = values["EnvelopeScore8"]
            assert str(found) == shown if isinstance(shown, str) else found == pytest.approx(shown)


@pytest.mark.parametrize("form", ["fd", "classic-le"])
def test_causes_above_bit_15_and_the_uncertainty_of_the_age_are_in_a_frame_of_their_own(form: str) -> None:
    layouts = result_layouts(form, Identifiers(), CYCLE)
    database = cantools.database.load_string(dbc_text(layouts, "test"), "dbc")
    assert layouts[-1].name == "EstimateDetail"
    composer = ResultFrames(layouts, 1)
    assert layouts[-1].key not in [frame.key for frame in composer.of_result(RESULT)], "no further cause"
    causes = Cause.OLD | Cause.SECOND_BRIDGE
    for uncertainty, shown in ((12.34e-3, 12.3), (9.0, 6553.4), (np.nan, 6553.5)):
        result = altered(RESULT, quality=Quality.UNCONFIRMED, causes=causes, age_uncertainty=uncertainty)
        values: dict = {}
        for frame in composer.of_result(result):
            values |= database.decode_message(frame.identifier, frame.data, decode_choices=False)
        assert values["Causes"] == 1 << 15 | int(Cause.OLD)
        assert values["AllCauses"] == int(causes)
        assert values["AgeUncertainty"] == pytest.approx(shown)
        assert (values["Quality"], values["AnsweredCounter"]) == (7, 77)


@pytest.mark.parametrize("profile", PROFILES)
def test_navigation_is_that_of_the_dbc_file(profile: str) -> None:
    database = cantools.database.load_string(dbc_text_of(profile, 6), "dbc")
    layout = layout_of(profile, 6)
    encoder = StrainEncoder(layout)
    message = database.get_message_by_name("Navigation")
    assert message.frame_id == max(frame.layout.identifier for frame in layout.frames)
    assert message.get_signal_by_name("Altitude").raw_initial == 65535
    for cycle, (mach, altitude) in enumerate([(6.02, 20e3), (np.nan, -150.0), (70.0, 2e5)]):
        frames = encoder.encode(
            np.zeros(6), 9e4, cycle=cycle, sample_time=0.0, mach_number=mach, altitude=altitude
        )
        data = next(frame.data for frame in frames if frame.identifier == message.frame_id)
        values = message.decode(data)
        if cycle == 2:
            assert str(values["MachNumber"]) == str(values["Altitude"]) == "NotAvailable"
            continue
        assert values["Altitude"] == altitude
        if cycle == 0:
            assert values["MachNumber"] == pytest.approx(6.02)
        else:
            assert str(values["MachNumber"]) == "NotAvailable"


@pytest.mark.parametrize("form", ["fd", "classic-le"])
@pytest.mark.parametrize("quality", [q for q in Quality if not q.has_coefficients])
def test_no_coefficients_go_out_without_quality(form: str, quality: Quality) -> None:
    """Even if a result held some by mistake: NaN, or the raw value for "not available"."""
    layouts = result_layouts(form, Identifiers(), CYCLE)
    database = cantools.database.load_string(dbc_text(layouts, "test"), "dbc")
    for frame in ResultFrames(layouts, 1).of_result(altered(RESULT, quality=quality)):
        decoded = database.decode_message(frame.identifier, frame.data)
        for name in ("C_A", "C_N", "C_Y", "M_P", "M_Y"):
            if name in decoded:
                assert str(decoded[name]) in ("nan", "NotAvailable")


@pytest.mark.parametrize("form", ["fd", "classic-le"])
def test_the_status_holds_the_last_valid_coefficients_and_their_age(form: str) -> None:
    from strainfmu.can.quality import BusState, FrameAccount

    layouts = result_layouts(form, Identifiers(), CYCLE)
    database = cantools.database.load_string(dbc_text(layouts, "test"), "dbc")
    account = FrameAccount(received=70_000)
    account.classes[FrameClass.CORRUPT] = 70_000
    status = BridgeStatus(
        time=3.0,
        bus_state=BusState.ERROR_PASSIVE,
        last=altered(RESULT, quality=Quality.STALE, other_outputs={ENVELOPE_SCORE: 5.5}),
        last_valid=altered(RESULT, quality=Quality.VALID),
        account=account,
        cycles=5,
        send_failures=6,
        reconnects=7,
    )
    values: dict = {}
    for frame in ResultFrames(layouts, 1).of_status(status):
        values |= database.decode_message(frame.identifier, frame.data, decode_choices=False)
    # 1 s since then, and 12.3 ms that it was old by then; 10 ms steps in the classic form.
    age = values["LastAge" if form == "fd" else "LastAge16"]
    assert age == pytest.approx(1012.3, abs=0.5 if form == "fd" else 5.0)
    assert values["last_C_N"] == pytest.approx(0.61, abs=2.6e-4)
    assert (values["Quality"], values["BusState"], values["Reconnects"]) == (5, 2, 7)
    if form == "fd":
        assert values["EnvelopeScore"] == 5.5
    assert values["Rejected" if form == "fd" else "Rejected16"] == (70_000 if form == "fd" else 70_000 % 65536)
