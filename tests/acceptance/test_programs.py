"""Programs that a stranger writes from the reference alone: public names of both packages, and nothing else."""

import ast
import time
from pathlib import Path

import can
import numpy as np
import pandas
import pytest
from matplotlib import pyplot as plt
from ogive import OGIVE

import builder
import strainfmu

RANDOM = np.random.default_rng(5)


def own_arrays() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Strain per pressure (12, 300) of one's own program, snapshots (300, 40), and loads per pressure (5, 300)."""
    place = np.linspace(0.0, 1.0, 300)
    shapes = np.array([np.cos(np.pi * k * place) for k in range(6)])
    snapshots = 2e4 + 1e3 * shapes.T @ RANDOM.normal(size=(6, 40))
    return 1e-9 * RANDOM.normal(size=(12, 300)), snapshots, 1e-3 * shapes[:5]


def test_programs_use_public_names_alone() -> None:
    modules = [n.module for n in ast.walk(ast.parse(Path(__file__).read_text())) if isinstance(n, ast.ImportFrom)]
    assert not [name for name in modules if str(name).startswith(("strainfmu", "builder"))]


def test_paper_on_arrays() -> None:
    Z, snapshots, _ = own_arrays()
    noise = 1e-7
    found = strainfmu.linear_map(Z, snapshots, noise_std=noise, gamma=1.0)
    # The posterior of the source, with the snapshots' mean and covariance as the prior.
    mean = snapshots.mean(axis=1)
    covariance = np.cov(snapshots)
    gain = covariance @ Z.T @ np.linalg.inv(Z @ covariance @ Z.T + noise**2 * np.eye(12))
    np.testing.assert_allclose(found.T, gain, rtol=1e-6, atol=1e-6 * np.abs(gain).max())
    np.testing.assert_allclose(found.estimate(Z @ mean), mean, rtol=1e-9)
    posterior = covariance - gain @ Z @ covariance
    np.testing.assert_allclose(found.posterior_covariance, posterior, atol=1e-6 * np.abs(covariance).max())
    modes = strainfmu.linear_map(Z, snapshots, noise_std=noise, modes=3, truncated_noise=False)
    assert modes.T.shape == (3, 12)
    assert modes.condition_number > 1.0


def test_own_map_to_fmu(tmp_path: Path) -> None:
    Z, snapshots, loads = own_arrays()
    own = strainfmu.linear_map(Z, snapshots, noise_std=1e-7, loads=loads)
    made = own.to_map(reference_area=0.1, reference_length=0.36, dynamic_pressure=9e4)
    strainfmu.save_inverse_map(made, tmp_path / "own.h5")
    strainfmu.export(tmp_path / "own.h5", tmp_path / "own.fmu")
    strain = Z @ snapshots[:, 7]
    inputs = {f"estimator.strain[{i}]": value for i, value in enumerate(strain.tolist(), start=1)}
    system = strainfmu.System(
        {"estimator": tmp_path / "own.fmu"}, (), inputs | {"estimator.dynamic_pressure": 9e4}
    )
    recording = strainfmu.simulate(system, 0.1, 0.01, record=["estimator.C_N", "estimator.M_P"])
    result = strainfmu.load(tmp_path / "own.h5").estimate(strain, dynamic_pressure=9e4)
    assert recording["estimator.C_N"][-1] == pytest.approx(result.C_N, rel=1e-9)
    assert recording["estimator.M_P"][-1] == pytest.approx(result.M_P, rel=1e-9)
    force = (own.load_gain @ strain + own.load_offset)[1]
    assert pytest.approx(force / (9e4 * 0.1), rel=1e-9) == result.C_N


def test_recording_to_loads_to_pandas(ic3x_demo: Path, tmp_path: Path) -> None:
    flown = pandas.read_csv(ic3x_demo / "flight.csv")
    estimator = strainfmu.load(ic3x_demo / "map.h5")
    names = {f"plant.strain[{i}]": name for i, name in enumerate(estimator.gauge_names, start=1)}
    table = flown.rename(columns={**names, "plant.dynamic_pressure": "dynamic_pressure"})
    table[["time", *estimator.gauge_names, "dynamic_pressure"]].to_csv(tmp_path / "run.csv", index=False)
    draft = strainfmu.channels(ic3x_demo / "map.h5", tmp_path / "run.csv", tmp_path / "channels.toml")
    assert str(len(estimator.gauge_names)) in draft.summary()
    summary = strainfmu.estimate(ic3x_demo / "map.h5", tmp_path / "run.csv", tmp_path / "loads.csv", columns="all")
    loads = pandas.read_csv(tmp_path / "loads.csv")
    assert summary.samples == len(loads) == len(flown)
    (column,) = [name for name in loads if name.split(" ")[0] == "C_N"]
    error = loads[column].to_numpy() - flown["plant.C_N"].to_numpy()
    assert np.sqrt(np.mean(error**2)) < 0.1 * np.ptp(flown["plant.C_N"])
    strain = table[list(estimator.gauge_names)].to_numpy()
    frame = estimator.estimate(strain[:50], table["dynamic_pressure"].to_numpy()[:50]).to_frame()
    assert len(frame) == 50
    assert isinstance(estimator.estimate(strain[0], table["dynamic_pressure"][0]).C_N, float)


@pytest.mark.slow
def test_calibrate_a_map(ogive_demo: Path, tmp_path: Path) -> None:
    vehicle = builder.load_vehicle(OGIVE)
    structure = builder.as_built_structure(vehicle, vehicle.gauges.layout, resolution=vehicle.resolution.truth)
    prior = builder.as_built_std(vehicle.calibration, structure.counts)
    built = builder.draw_as_built(prior.changed(zero=np.full(structure.n_gauges, 5e-5)), RANDOM)
    errors = builder.LoadErrors()
    cases = builder.standard_load_cases(8, vehicle.body().length, weighs=False)  # the vehicle file has no density
    noise = np.full(structure.n_gauges, 0.3e-6)
    test = builder.simulate_ground_test(structure, built, cases, errors, noise, random=RANDOM)
    (tmp_path / "rig").mkdir()
    path = builder.write_ground_test(test, tmp_path / "rig", "hall 2", str(OGIVE))
    found = builder.calibrate(
        ogive_demo / "map.h5",
        path,
        tmp_path / "calibrated.h5",
        vehicle=OGIVE,
        snapshots=ogive_demo / "snapshots.h5",
    )
    calibrated = strainfmu.load_inverse_map(tmp_path / "calibrated.h5")
    assert np.abs(calibrated.zero_offset - built.zero).max() < 2e-6
    assert found.files[0] == tmp_path / "calibrated.h5"


@pytest.mark.usefixtures("undrawn")
def test_place_gauges_and_review(ogive_demo: Path, tmp_path: Path) -> None:
    flows = ogive_demo / "snapshots.h5"
    found = builder.place(
        OGIVE, 10, tmp_path / "layout.csv", starts=1, estimator="linear", spacing=0.1, snapshots=flows
    )
    assert len(found.placement.layout.names) == 10
    review = builder.review(
        OGIVE, tmp_path / "layout.csv", tmp_path / "review.html", estimator="linear", snapshots=flows
    )
    assert (tmp_path / "review.html").is_file()
    assert review.best[0]
    with pytest.raises(strainfmu.InputError, match=r"expected --budget"):
        builder.place(OGIVE, costs={"axial": 1.0})


def test_closed_loop_with_an_own_plant(ic3x_demo: Path) -> None:
    """A plant of one line: its angle follows a command; its strains come from the flow of the snapshots."""
    flown = strainfmu.load_recording(ic3x_demo / "flight.h5")
    estimator = strainfmu.load(ic3x_demo / "map.h5")
    n, pressure = len(estimator.gauge_names), flown["plant.dynamic_pressure"]
    strain = np.transpose([flown[f"plant.strain[{i}]"] for i in range(1, n + 1)])
    order = np.argsort(flown["plant.C_N"], kind="stable")
    C_N, strain, pressure = flown["plant.C_N"][order], strain[order], pressure[order]
    target, state = float(np.quantile(C_N, 0.7)), float(np.quantile(C_N, 0.3))
    for _ in range(60):
        row = int(np.argmin(np.abs(C_N - state)))
        result = estimator.track(strain[row], dynamic_pressure=pressure[row])
        state += 0.2 * (target - result.C_N)
    assert abs(C_N[np.argmin(np.abs(C_N - state))] - target) < 0.1 * np.ptp(C_N)
    assert result.health in (strainfmu.HealthState.OK, strainfmu.HealthState.DEGRADED)


def test_listener_on_a_bus(tmp_path: Path) -> None:
    Z, snapshots, loads = own_arrays()
    own = strainfmu.linear_map(Z, snapshots, noise_std=1e-7, loads=loads)
    made = own.to_map(reference_area=0.1, reference_length=0.36, dynamic_pressure=9e4)
    (tmp_path / "bus.toml").write_text("[input]\nprofile = 'fd64'\ncycle_time_ms = 50\n")
    channel, results = f"programs-{time.monotonic_ns()}", []
    bus, sender = (can.Bus(interface="virtual", channel=channel) for _ in range(2))
    listener = strainfmu.LoadListener(strainfmu.Estimator(made), tmp_path / "bus.toml", on_result=results.append)
    notifier = can.Notifier(bus, [listener], timeout=0.05)
    encoder = strainfmu.StrainEncoder(strainfmu.profile_layout("fd64", made.gauge_names, cycle_time=0.05))
    begin, cycle, strain = time.monotonic(), 0, Z @ snapshots[:, 3]
    while not [one for one in results if one.usable] and time.monotonic() < begin + 600.0:
        measured = strain + 1e-7 * RANDOM.normal(size=12)
        for frame in encoder.encode(measured, 9e4, cycle=cycle, sample_time=0.05 * cycle):
            message = can.Message(
                arbitration_id=frame.identifier, data=frame.data, is_fd=True, is_extended_id=frame.is_extended
            )
            sender.send(message)
        cycle += 1
        time.sleep(max(begin + 0.05 * cycle - time.monotonic(), 0.0))
    notifier.stop()
    bus.shutdown()
    sender.shutdown()
    (usable,) = [one for one in results if one.usable][:1]
    expected = strainfmu.Estimator(made).estimate(strain, 9e4)
    assert abs(usable.coefficients[1] - expected.C_N) < 5.0 * expected.sigma.C_N


def test_nonlinear_estimator_over_a_manoeuvre_with_a_figure(ic3x_demo: Path, tmp_path: Path) -> None:
    flown = strainfmu.load_recording(ic3x_demo / "flight.h5")
    estimator = strainfmu.load(ic3x_demo / "map.h5")
    assert estimator.is_nonlinear
    strain = np.transpose([flown[f"plant.strain[{i}]"] for i in range(1, len(estimator.gauge_names) + 1)])
    result = estimator.track(strain, flown["plant.dynamic_pressure"], q_source="independent")
    assert result.air_data.mach_number.shape == flown.time.shape
    middle = {"strain": strain[500], "dynamic_pressure": flown["plant.dynamic_pressure"][500]}
    start = result[499].state[:4]
    again = estimator.estimate(strain[500:501], middle["dynamic_pressure"], start=[start])
    assert again.C_N[0] == estimator.estimate(**middle, start=start).C_N
    figure, (loads, mach) = plt.subplots(2, sharex=True)
    loads.plot(flown.time, flown["plant.C_N"], "k")
    loads.plot(flown.time, result.C_N)
    loads.fill_between(flown.time, result.C_N - 3 * result.sigma.C_N, result.C_N + 3 * result.sigma.C_N, alpha=0.3)
    mach.plot(flown.time, result.air_data.mach_number)
    figure.savefig(tmp_path / "manoeuvre.png")
    plt.close(figure)
    within = np.abs(result.C_N - flown["plant.C_N"]) < 3.0 * result.sigma.C_N
    assert within.mean() > 0.95
    assert (tmp_path / "manoeuvre.png").stat().st_size > 5_000
