"""Check of a vehicle file ahead of the long work: ``strainfmu check``."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import degrees
from pathlib import Path
from typing import TypeVar

from builder.aero.engine import Engine
from builder.aero.engines.registry import make_engine
from builder.campaign.failures import extreme_conditions, flows_out_of_reach
from builder.inverse.envelope import condition_ranges, flight_ranges, parameter_ranges
from builder.inverse.noise.inertia import inertia_in_words
from builder.inverse.noise.recorder import reading_in_words
from builder.inverse.problem import check_noise, check_other_loads
from builder.pipeline.demonstration.demo import refuse_without_demo
from builder.pipeline.demonstration.flown_shape import checked_manoeuvre, manoeuvre_warnings
from builder.pipeline.place_and_review import check_model
from builder.pipeline.progress_bars import AnyProgress, reporter_of
from builder.reporting import Reporter
from builder.structure.as_built.as_built_structure import refuse_unheld
from builder.structure.as_built.displaced_structure import refuse_untestable
from builder.structure.gauge_checks import check_gauges, gauges_at_breaks
from builder.truth.flights import other_physics
from builder.truth.flow_table import flow_keys, truth_engine, truth_knots
from builder.truth.shape import refuse_without_independent_model
from builder.vehicle.file import Vehicle, load_vehicle
from builder.vehicle.map_needs import check_map_size, doubtful_entries, unused_entries
from builder.vehicle.toml.reading import named
from strainfmu.cosim.models.trajectory import Trajectory
from strainfmu.errors import FaultsError, InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.valid_ranges import RECORDED_KEYS, valid_conditions, valid_parameters
from strainfmu.flight_condition import ALTITUDE, FlightCondition

T = TypeVar("T")


class _Faults:
    """Runs checks of a vehicle file one after the other and keeps what each refused, with the file's name."""

    def __init__(self, vehicle: Path) -> None:
        self.vehicle = vehicle
        self.lines: list[str] = []

    def result_of(self, check: Callable[[], T]) -> T | None:
        """Return the result of a check, None where it refused."""
        try:
            return check()
        except InputError as error:
            self.lines += named(error.lines, self.vehicle)
            return None

    def raise_if_any(self) -> None:
        if self.lines:
            raise FaultsError("\n".join(dict.fromkeys(self.lines)))  # several checks may meet one fault


@dataclass(frozen=True, kw_only=True)
class VehicleCheck:
    """Findings on a vehicle file: rows of name and value, and lines for the user."""

    name: str
    rows: tuple[tuple[str, str], ...]
    lines: tuple[str, ...]


def check(vehicle: str | Path, *, progress: AnyProgress = None) -> VehicleCheck:
    """Check a vehicle file, its gauges, the reach of the flow solver, and the manoeuvre of the demonstration.

    Solves the flows at the lowest and highest Mach number and angle of attack, which takes seconds.

    On the command line::

        strainfmu check my_vehicle.toml

    Parameters
    ----------
    vehicle : vehicle file (TOML).

    Raises
    ------
    FaultsError
        What the commands that take the file would refuse; a line each, of all of these checks.
    """
    path, reporter = Path(vehicle), reporter_of(progress)
    return _checked(load_vehicle(path), path, reporter)


def _checked(vehicle: Vehicle, path: Path, reporter: Reporter) -> VehicleCheck:
    faults = _Faults(path)
    gauges = faults.result_of(lambda: check_gauges(vehicle))
    engine = faults.result_of(lambda: make_engine(vehicle, None, vehicle.resolution.map, note=reporter.note))
    conditions = (None if engine is None else engine.conditions()) or vehicle.flight_conditions()
    if gauges is not None:
        faults.result_of(lambda: check_map_size(vehicle.map, gauges[vehicle.gauges.layout], len(conditions)))
        faults.result_of(lambda: check_noise(vehicle))
    faults.result_of(lambda: check_other_loads(vehicle))
    flies = vehicle.truth.manoeuvre is not None
    trajectory = faults.result_of(lambda: checked_manoeuvre(vehicle, conditions)) if flies else None
    faults.raise_if_any()  # before the flows, which take longest
    assert gauges is not None
    assert engine is not None
    faults.lines += [f"{path}: {line}" for line in _out_of_reach(vehicle, engine, conditions, reporter)]
    faults.raise_if_any()
    rows = _rows(vehicle, gauges, engine, conditions)
    return VehicleCheck(
        name=vehicle.name, rows=tuple(rows), lines=tuple(_warnings(vehicle, trajectory, conditions))
    )


def _out_of_reach(
    vehicle: Vehicle, engine: Engine, conditions: Sequence[FlightCondition], reporter: Reporter
) -> Iterator[str]:
    """Yield why extreme flows of the snapshots and of the flight model cannot be solved."""

    keys = [engine.flow_key(condition) for condition in extreme_conditions(conditions)]
    for line in flows_out_of_reach(engine, keys, reporter, "Flow: extreme conditions"):
        yield f"conditions: {line}"
    if not vehicle.has_flow_table:
        return
    of_truth = sorted(flow_keys(*truth_knots(vehicle.truth)))
    mach, incidence = ([key[axis] for key in of_truth] for axis in (0, 1))
    corners = [(m, a) for m in (min(mach), max(mach)) for a in (min(incidence), max(incidence))]
    for line in flows_out_of_reach(truth_engine(vehicle), corners, reporter, "Flow: corners of the flight model"):
        yield f"truth: {line}"


def _rows(
    vehicle: Vehicle, gauges: dict[str, int], engine: Engine, conditions: Sequence[FlightCondition]
) -> Iterator[tuple[str, str]]:
    """Yield what follows from the entries."""
    yield from _shape_rows(vehicle, engine)
    for name, count in gauges.items():
        in_use = " (in use)" if name == vehicle.gauges.layout else ""
        yield f"layout {name}{in_use}", f"{count} gauges"
    yield "sigma of a reading", reading_in_words(vehicle.recorder, vehicle.noise.std_um_per_m)
    flows = len({engine.flow_key(condition) for condition in conditions})
    yield "snapshots", f"{len(conditions)} conditions, {flows} distinct flows ({engine.name})"
    parameters = parameter_ranges(tuple(vehicle.conditions.parameters), conditions)
    of_map = flight_ranges(vehicle.map, conditions)
    ranges = condition_ranges(conditions) | {
        RECORDED_KEYS[ALTITUDE]: of_map["altitude_range"].tolist(),
        RECORDED_KEYS[DYNAMIC_PRESSURE]: of_map["dynamic_pressure_range"].tolist(),
    }
    for validity in (*valid_conditions(ranges), *valid_parameters(parameters)):
        yield f"valid over {validity.quantity}", validity.text


def _shape_rows(vehicle: Vehicle, engine: Engine) -> Iterator[tuple[str, str]]:
    """Yield what follows from the entries of the outer shape."""
    if not vehicle.has_meridian:
        low, high = engine.surface.point.min(axis=0), engine.surface.point.max(axis=0)
        spans = ", ".join(f"{axis} {a:.4g} to {b:.4g} m" for axis, a, b in zip("xyz", low, high, strict=True))
        yield f"shape, by {vehicle.shape_kind}", spans
        yield (
            "surface",
            f"{len(engine.surface.triangle)} triangles, {engine.surface.area.sum():.4g} m2 without base",
        )
        return
    body = vehicle.body()
    yield "length, base radius", f"{body.length:.4g} m, {body.base_radius:.4g} m"
    yield "tip half-angle", f"{degrees(body.tip_angle):.4g} deg"
    yield "slope breaks", ", ".join(f"{x:.4g} m" for x in body.slope_breaks) or "none"


def _warnings(
    vehicle: Vehicle, trajectory: Trajectory | None, conditions: Sequence[FlightCondition]
) -> Iterator[str]:
    """Yield the manoeuvre's length, where it leaves the snapshots, doubtful entries, commands that refuse."""

    if trajectory is None:
        yield "manoeuvre: none; `strainfmu demo` needs truth.manoeuvre, other commands do not"
    else:
        yield f"manoeuvre: {trajectory.stop_time:.4g} s"
    yield f"inertia: {inertia_in_words(vehicle)}"
    yield from (f"warning: {line}" for line in unused_entries(vehicle))
    yield from (f"warning: {line}" for line in doubtful_entries(vehicle, conditions))
    yield from (f"warning: {line}" for line in gauges_at_breaks(vehicle))
    of_revolution = (
        vehicle.is_axisymmetric and vehicle.aerodynamics.surface is None and vehicle.aerodynamics.engine != "table"
    )
    if trajectory is not None:
        yield from manoeuvre_warnings(vehicle, trajectory, conditions, of_revolution)
    if vehicle.is_axisymmetric:
        yield from other_physics(vehicle)
    yield from _refused_commands(vehicle)


def _refused_commands(vehicle: Vehicle) -> Iterator[str]:
    """Yield the commands that this vehicle cannot use, and why."""

    refusals: tuple[tuple[str, Callable[[], None]], ...] = (
        ("demo", lambda: refuse_without_demo(vehicle)),
        ("loadtest, calibrate", lambda: refuse_untestable(vehicle)),
        (
            "demo --as-built, trial ground_test",
            lambda: refuse_unheld(vehicle, vehicle.gauges.layout),
        ),
        ("place, review", lambda: check_model(vehicle)),
        ("compare, stress, study", lambda: refuse_without_independent_model(vehicle)),
    )
    for commands, refuse in refusals:
        try:
            refuse()
        except InputError as error:
            yield f"not for this vehicle: {commands}: {error}"
