"""A tare asked for on the bus: taken at rest, refused while loads are not known; the same in a replay."""

from collections.abc import Callable
from pathlib import Path

import cantools
import numpy as np
import pytest
from altered_frames import crc_in
from bus_run import CYCLE, paced_bridge
from sweeps import sweep
from synthetic_vehicle import N_GAUGES, SyntheticFiles, synthetic_inverse_map

from strainfmu.can.authentic import freshness_file, next_trip
from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import Frame, crc_of
from strainfmu.can.machine import Result
from strainfmu.can.observed import observed_bridge
from strainfmu.can.options import BridgeOptions
from strainfmu.can.profiles import PROFILES, profile_layout
from strainfmu.can.quality import Cause, Quality
from strainfmu.can.sender import send_flight
from strainfmu.can.setup import input_layout
from strainfmu.can.strain_sources import FlownSample
from strainfmu.can.tare import TareEnd
from strainfmu.cosim.estimators.zeros_file import load_zeros, write_zeros
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.files import write_bytes_atomically

NAMES = [f"G{i}" for i in range(N_GAUGES)]
ZERO = 1e-6 * np.array([180.0, -95.0, 240.0, -160.0, 20.0, 310.0])
NOISE = 5e-7
WINDOW = 64
QUANTUM = 0.25e-6


def at_rest(n: int, pressure: float = 0.0, **changed: float) -> list[FlownSample]:
    """Return readings of unloaded gauges with their zeros; gauges by name read ``changed`` more at the end."""
    random = np.random.default_rng(3)
    rise = np.array([changed.get(name, 0.0) for name in NAMES]) * np.linspace(0.0, 1.0, n)[:, None]
    readings = ZERO + NOISE * random.normal(size=(n, N_GAUGES)) + rise
    return [FlownSample(one, pressure, np.full(5, np.nan)) for one in readings]


def in_flight(n: int) -> list[FlownSample]:
    """Return the strains of a flight, with the zeros on top."""
    held, random = synthetic_inverse_map(1), np.random.default_rng(4)
    state = 1e5 * np.sin(0.05 * np.arange(n)[:, None] + np.arange(3.0))
    strain = held.mean_strain + state @ held.state_operator.T + ZERO
    strain += 1e-7 * random.normal(size=strain.shape)
    return [FlownSample(one, 9e4, np.full(5, np.nan)) for one in strain]


class Run:
    """Results of a bridge that was asked for a tare, and what it said at its end."""

    def __init__(
        self,
        files: SyntheticFiles,
        folder: Path,
        samples: list[FlownSample],
        channel: str,
        *,
        tare_at: float | None = 0.2,
        is_allowed: bool = True,
        **options: object,
    ) -> None:
        self.zeros, self.results = folder / f"{channel}.toml", list[Result]()
        self.log = folder / f"{channel}.blf"
        chosen = BridgeOptions(
            interface="virtual",
            channel=channel,
            cycle_time=CYCLE,
            tare=files.map_1,
            tare_cycles=WINDOW,
            tare_output=self.zeros,
            **options,  # type: ignore[arg-type]  # of the test at hand
        )
        layout, _ = input_layout(chosen, NAMES)
        key, trip = chosen.key_file, 1
        if key is not None and layout.key is not None:
            trip = next_trip(freshness_file(key, "sender"), layout.key)
        bridge = chosen if is_allowed else BridgeOptions(interface="virtual", channel=channel, cycle_time=CYCLE)
        watched = {"record": self.log, "publish": None, "publish_rate": 1.0, "also": self.results.append}
        with paced_bridge(files.estimator_1, bridge, **watched) as paced:
            self.sent = send_flight(
                paced,
                layout,
                samples,
                clock=paced.clock,
                sleep=paced.sleep,
                tare_at=tare_at,
                sender=paced.sender(layout, trip=trip),
            )
        self.notes, self.summary = paced.notes, paced.summary

    def having(self, cause: Cause) -> list[Result]:
        return [result for result in self.results if result.causes & cause]


@pytest.mark.parametrize("profile", sweep(["fd64", "fd64-sec", "classic-le"], ["fd64"]))
def test_zeros_are_taken_at_rest_and_used_in_flight(
    synthetic: SyntheticFiles, tmp_path: Path, profile: str, run: Callable[..., tuple[int, str, str]]
) -> None:
    """On the bus, and by a replay, which writes no file of zeros."""
    key = tmp_path / "bus.key"
    write_bytes_atomically(key, bytes(range(16)).hex().encode(), is_private=True)
    secured = {"key_file": key} if profile == "fd64-sec" else {}
    samples = at_rest(100) + in_flight(60)
    live = Run(synthetic, tmp_path, samples, f"tare-{profile}", profile=profile, **secured)
    assert len(live.having(Cause.TARE_RUNNING)) == WINDOW - 1
    assert len(live.having(Cause.ZEROS_TAKEN)) == 10
    assert live.having(Cause.TARE_REFUSED) == []
    zeros = load_zeros(live.zeros, NAMES)
    # Quantisation of 0.25 um/m is a noise of its own.
    expected = np.hypot(NOISE, QUANTUM / np.sqrt(12.0)) / np.sqrt(WINDOW)
    np.testing.assert_allclose(zeros.std, expected, rtol=0.5)
    assert np.all(np.abs(zeros.value - ZERO) < 5.0 * expected)
    assert any(note.startswith(f"tare taken: {N_GAUGES} zeros from {WINDOW} cycles") for note in live.notes)
    assert f"{live.zeros}: zeros written" in live.notes
    # The coefficients in flight are those of the map in Python with the same zeros.
    flown = [result for result in live.results[-70:] if result.quality.has_coefficients]
    assert len(flown) > 40
    direct = Estimator(synthetic_inverse_map(1), zeros=zeros)
    for result in flown:
        reference = direct.estimate(result.strain, result.dynamic_pressure)
        np.testing.assert_allclose(result.coefficients, reference.coefficients, rtol=1e-9)
        np.testing.assert_allclose(result.coefficients_std, reference.coefficients_std, rtol=1e-6)
    if profile == "fd64":
        live.zeros.unlink()
        code, _, errors = run("replay", live.log, synthetic.estimator_1, "-o", tmp_path / "again.csv")
        assert (code, errors) == (0, "")
        rows = (tmp_path / "again.csv").read_text().splitlines()
        column = rows[0].split(",").index("C_N [1]")
        again = np.array([float(row.split(",")[column]) for row in rows[1:]])
        np.testing.assert_array_equal(again, [result.coefficients[1] for result in live.results])
        assert not live.zeros.exists()


@pytest.mark.parametrize(
    ("samples", "why"),
    [
        (in_flight(60), "loads are not known: dynamic pressure is 9e+04 Pa"),
        (at_rest(100, float("nan")), "loads are not known: no dynamic pressure on the bus"),
        (at_rest(100, G2=2e-5), "readings drift: gauge 'G2'"),
        ([*at_rest(40), *in_flight(40)], "loads are not known: dynamic pressure is 9e+04 Pa"),
    ],
)
def test_refused_while_loads_are_not_known(
    synthetic: SyntheticFiles, tmp_path: Path, samples: list[FlownSample], why: str
) -> None:
    run = Run(synthetic, tmp_path, samples, "tare-refused")
    assert len(run.having(Cause.TARE_REFUSED)) == 10
    assert run.having(Cause.ZEROS_TAKEN) == []
    said, *others = [note for note in run.notes if note.startswith("tare refused: ")]
    assert why in said
    assert others == []
    assert not run.zeros.exists()


def test_strain_of_known_loads_is_taken_off(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    weight = 1e-6 * np.array([20.0, -20.0, 5.0, 0.0, -7.0, 11.0])
    path = tmp_path / "known.toml"
    write_zeros(path, NAMES, GaugeZeros(value=weight, std=0.02 * np.abs(weight)), {})
    samples = at_rest(100)
    for sample in samples:
        sample.strain[:] += weight
    run = Run(synthetic, tmp_path, samples, "tare-known", tare_known=path)
    zeros = load_zeros(run.zeros, NAMES)
    assert np.all(np.abs(zeros.value - ZERO) < 3e-7)
    np.testing.assert_array_less(0.02 * np.abs(weight), zeros.std)
    assert zeros.std[0] == pytest.approx(np.hypot(0.4e-6, zeros.std[3]), rel=0.05)


def test_what_shows_a_pressure_is_told_of_zeros(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    """Of those given at the start, and of those of a tare."""
    reported = list[GaugeZeros]()
    given, taken = (GaugeZeros(value=factor * ZERO, std=np.full(N_GAUGES, 1e-7)) for factor in (1.0, 2.0))
    write_zeros(tmp_path / "given.toml", NAMES, given, {})
    options = BridgeOptions(
        interface="virtual",
        channel="told",
        cycle_time=CYCLE,
        zeros=tmp_path / "given.toml",
        tare=synthetic.map_1,
        tare_output=tmp_path / "taken.toml",
    )
    with observed_bridge(synthetic.estimator_1, options, on_zeros=reported.append) as ready:
        assert ready.zeros is not None
        ready.zeros.ended(TareEnd(text="", zeros=taken, samples=100))
    np.testing.assert_allclose([one.value for one in reported], [given.value, taken.value], rtol=1e-8)


def test_without_a_command_or_the_option_nothing_happens(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    of_tare = Cause.TARE_RUNNING | Cause.TARE_REFUSED | Cause.ZEROS_TAKEN
    quiet = Run(synthetic, tmp_path, at_rest(30), "tare-quiet", tare_at=None)
    # A request that is on the bus from the start is of an earlier time.
    early = Run(synthetic, tmp_path, at_rest(30), "tare-early", tare_at=0.0)
    other = Run(synthetic, tmp_path, at_rest(30), "tare-other", is_allowed=False)
    for run in (quiet, early, other):
        assert run.having(of_tare) == []
        assert not run.zeros.exists()


@pytest.mark.parametrize("profile", PROFILES)
def test_the_frame_is_in_the_dbc_file_as_it_is_sent(
    synthetic: SyntheticFiles, tmp_path: Path, profile: str, run: Callable[..., tuple[int, str, str]]
) -> None:
    out = tmp_path / "x.dbc"
    code, _, errors = run(
        "dbc", synthetic.map_1, "-o", out, "--profile", profile, "--set", f"tare.map={synthetic.map_1}"
    )
    assert (code, errors) == (0, "")
    message = cantools.database.load_file(out).get_message_by_name("TareCommand")
    layout = profile_layout(profile, NAMES, CYCLE, has_tare=True)
    assert layout.command is not None
    assert (message.frame_id, message.length) == (layout.command.layout.identifier, layout.command.layout.length)
    if profile != "fd64-sec":
        frames = StrainEncoder(layout).encode(ZERO, 0.0, cycle=5, sample_time=0.05, tare_request=7)
        data = command_of(frames, message.frame_id).data
        assert message.decode(data)["Request"] == 7
        protection = layout.command.layout.protection
        assert protection is not None
        assert crc_in(data, protection) == crc_of(data, protection)
    without = profile_layout(profile, NAMES, CYCLE)
    assert without.frames == tuple(frame for frame in layout.frames if frame is not layout.command)


def command_of(frames: list[Frame], identifier: int) -> Frame:
    (found,) = [frame for frame in frames if frame.identifier == identifier]
    return found


def test_old_and_forged_commands_are_none(synthetic: SyntheticFiles) -> None:
    """Recorded commands of half a second ago, with counters that follow, do not begin a window."""
    from can_case import Projection

    from strainfmu.can.machine import Machine
    from strainfmu.can.options import BridgeSettings
    from strainfmu.can.quality import FrameClass
    from strainfmu.can.tare import Taring

    layout = profile_layout("fd64", NAMES, CYCLE, has_tare=True)
    assert layout.command is not None
    taring = Taring(Estimator(synthetic_inverse_map(1)), lambda zeros: None, WINDOW)
    core = Machine(layout, Projection(N_GAUGES), BridgeSettings(), start=0.0)
    core.on_cycle = taring.take
    samples, encoder, identifier = at_rest(200), StrainEncoder(layout), layout.command.layout.identifier
    for cycle in range(200):
        now = cycle * CYCLE
        request = 0 if cycle < 100 else 1
        of_time = now if cycle < 100 else now - 0.5
        sample = samples[cycle]
        frames = encoder.encode(sample.strain, 0.0, cycle=cycle, sample_time=now, tare_request=0)
        late = encoder.encode(sample.strain, 0.0, cycle=cycle, sample_time=of_time, tare_request=request)
        frames = [f for f in frames if f.identifier != identifier] + [command_of(late, identifier)]
        for frame in frames:
            frame.time = now
            core.receive(frame)
    assert not taring._is_running
    assert core.account.classes[FrameClass.TOO_OLD] == 100
    assert core.account.unaccounted == 0


def test_wrong_options_are_one_line(
    synthetic: SyntheticFiles, tmp_path: Path, run: Callable[..., tuple[int, str, str]]
) -> None:
    bus = ("--interface", "virtual", "--channel", "tare-wrong", "--duration", "0.1")
    code, _, errors = run("bridge", synthetic.estimator_1, *bus, "--set", f"tare.map={tmp_path / 'none.h5'}")
    assert (code, errors.count("\n")) == (2, 1)
    code, _, errors = run("bridge", synthetic.estimator_1, *bus, "--set", "tare.output=x.toml")
    assert (code, "--set: tare.output: expected with tare.map, got it alone" in errors) == (2, True)
    (tmp_path / "a.dbc").write_text("")
    options = BridgeOptions(
        interface="virtual", channel="x", dbc=tmp_path / "a.dbc", mapping=tmp_path / "a.toml", tare=Path("m.h5")
    )
    with pytest.raises(InputError, match=r"tare\.map: expected with a profile"):
        input_layout(options, NAMES)


def test_a_gauge_that_does_not_read_gets_no_zero(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    samples = at_rest(100)
    for sample in samples:
        sample.strain[1] = np.nan
    run = Run(synthetic, tmp_path, samples, "tare-dead")
    zeros = load_zeros(run.zeros, NAMES)
    assert (zeros.value[1], zeros.std[1]) == (0.0, pytest.approx(0.05))
    assert np.all(np.abs(np.delete(zeros.value - ZERO, 1)) < 1e-6)
    assert not any(result.quality is Quality.VALID for result in run.results)
