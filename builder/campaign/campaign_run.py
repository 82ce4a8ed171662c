"""A campaign from its conditions to ``snapshots.h5``: reuse what is known, solve the rest, keep it as it comes.

One process, this one, writes. A finished flow goes to the journal at once; when all are there the result is
written whole, flows included, and the journal removed. The result depends on conditions and engine alone: not on
what was reused, on the order in which flows came, or on who solved them. A flow outside the engine's reach ends
nothing: its conditions are named in the result, and a campaign started again tries them again.

Campaign of a vehicle file: its engine, conditions and settings.
"""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from builder.aero.engine import Engine, Flow, FlowKey, cap_line
from builder.aero.surface.mesh import mesh_of_grid
from builder.campaign.dask_workers import FailedFlow
from builder.campaign.failures import FailedCondition, failed_conditions, failure_lines, missing_line
from builder.campaign.journal import Journal
from builder.campaign.scheduling import Scheduling, solve_flows
from builder.campaign.snapshots import KeptFlows, Snapshots, load_flows, load_snapshots, save_snapshots
from builder.reporting import Reporter
from builder.vehicle.file import Vehicle
from builder.vehicle.flight_conditions import ConditionSet
from builder.vehicle.shape.geometry import SurfaceGrid, surface_grid
from builder.vehicle.shape.profile_entries import profile_record
from builder.vehicle.shape.shape_entries import ReferenceQuantities
from strainfmu.arrays import FloatArray
from strainfmu.errors import FlowReachError, InputError, StrainfmuError
from strainfmu.files import fingerprint
from strainfmu.flight_condition import FlightCondition
from strainfmu.version import __version__


class CampaignInterrupted(StrainfmuError):
    """The user stopped a campaign; what it had finished is kept."""

    exit_code = 130


@dataclass(frozen=True, eq=False, kw_only=True)
class Campaign:
    """The flows to solve and what to make of them.

    Attributes
    ----------
    vehicle : its name.
    engine : the source of pressure.
    conditions : N flight conditions; some may be equal.
    internal_pressure : (N,) pressure inside the body [Pa].
    reference : what coefficients are referred to.
    grid : the vehicle's own surface nodes, stored as such where the engine's surface is made of them.
    settings : more entries for the file's ``settings``.
    """

    vehicle: str
    engine: Engine
    conditions: tuple[FlightCondition, ...]
    internal_pressure: FloatArray
    reference: ReferenceQuantities
    grid: SurfaceGrid | None
    settings: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class Tally:
    """Where the flows came from.

    Attributes
    ----------
    solved, reused : flows solved by this run, and known from earlier ones.
    seconds : wall time of solving [s].
    seconds_per_flow : mean time that one worker took for one flow [s]; NaN if none was solved.
    """

    solved: int
    reused: int
    seconds: float
    seconds_per_flow: float


@dataclass(frozen=True, eq=False)
class CampaignResult:
    """The result of a run.

    Attributes
    ----------
    snapshots : the conditions that could be solved, in the order of the campaign.
    tally : where their flows came from.
    up_to_date : whether the file already held this, equal in every entry.
    """

    snapshots: Snapshots
    tally: Tally
    up_to_date: bool

    @property
    def failed(self) -> tuple[FailedCondition, ...]:
        """The conditions that could not be solved."""
        return failed_conditions(self.snapshots)


def run_campaign(campaign: Campaign, path: Path, scheduling: Scheduling, reporter: Reporter) -> CampaignResult:
    """Make ``path`` hold the snapshots of ``campaign``.

    Flows are taken from ``path`` as it is and from its journal where key and engine inputs are the same. The
    result names the conditions that could not be solved.

    Raises
    ------
    FlowReachError
        Every condition is outside the engine's reach.
    CampaignInterrupted
        Ctrl-C; the same.
    StrainfmuError
        Another campaign is writing ``path``, a file cannot be written, or the scheduler is lost.
    """
    engine = campaign.engine
    if path.is_dir():
        raise InputError(f"{path}: is a folder, must be a file")
    with Journal(path) as journal:
        known = _flows_of_file(path, fingerprint(engine.inputs()))
        keys = map(engine.flow_key, campaign.conditions)
        failed: dict[FlowKey, str] = {}
        flows, tally = complete_flows(
            engine=engine,
            keys=keys,
            journal=journal,
            known=known,
            scheduling=scheduling,
            reporter=reporter,
            title="Flow: snapshots",
            failed=failed,
        )
        snapshots = snapshots_of_flows(campaign, flows, failed)
        kept_flows = KeptFlows(fingerprint(engine.inputs()), tuple(flows[key] for key in sorted(flows)))
        up_to_date = _holds(path, snapshots, kept_flows)
        if not up_to_date:
            save_snapshots(snapshots, path, kept_flows)
        journal.remove()
    return CampaignResult(snapshots, tally, up_to_date)


def snapshots_in_memory(
    campaign: Campaign, scheduling: Scheduling, reporter: Reporter, title: str
) -> CampaignResult:
    """Return the snapshots of ``campaign`` without a file; conditions beyond the engine's reach are left out.

    Raises
    ------
    FlowReachError
        Every condition is.
    """
    failed: dict[FlowKey, str] = {}
    keys = map(campaign.engine.flow_key, campaign.conditions)
    flows, tally = complete_flows(campaign.engine, keys, reporter, title, scheduling=scheduling, failed=failed)
    return CampaignResult(snapshots_of_flows(campaign, flows, failed), tally, up_to_date=False)


def complete_flows(
    engine: Engine,
    keys: Iterable[FlowKey],
    reporter: Reporter,
    title: str,
    *,
    journal: Journal | None = None,
    known: Mapping[FlowKey, Flow] | None = None,
    scheduling: Scheduling | None = None,
    failed: dict[FlowKey, str] | None = None,
) -> tuple[dict[FlowKey, Flow], Tally]:
    """Return the flow of every key: from ``known``, from the journal, or solved and added to the journal.

    Without a journal the flows stay in memory. ``failed`` takes the causes of flows that are outside the engine's
    reach, which are then left out; without it the first one is an error.

    Raises
    ------
    FlowReachError
        A flow is outside the engine's reach, and there is no ``failed``; the flows finished before are kept.
    CampaignInterrupted, StrainfmuError
        As :func:`run_campaign`.
    """
    engine_hash = fingerprint(engine.inputs())
    needed, known, scheduling = set(keys), known or {}, scheduling or Scheduling()
    at_hand = {**known, **(journal.flows(engine_hash) if journal else {})}
    flows = {key: at_hand[key] for key in needed & at_hand.keys()}
    reused = len(flows)
    start, times = perf_counter(), []
    missing = needed - flows.keys()

    def note_failure(failure: FailedFlow) -> None:
        if failed is None:
            raise FlowReachError(failure.cause)
        failed[failure.key] = failure.cause

    if missing:
        try:
            with (
                reporter.stage(title) as progress,
                closing(solve_flows(engine, missing, scheduling, reporter.note, failed=note_failure)) as solving,
            ):
                progress(reused, len(needed))
                for solved in solving:
                    if journal:
                        journal.append(engine_hash, solved.flow)
                    flows[solved.flow.key] = solved.flow
                    times.append(solved.seconds)
                    progress(len(flows), len(needed))
        except KeyboardInterrupt as error:
            if journal is None:
                raise
            journal.reread()
            saved = needed & {**known, **journal.flows(engine_hash)}.keys()
            where = f"are kept in {journal.path}" if saved else "are finished"
            raise CampaignInterrupted(f"interrupted; {len(saved)} of {len(needed)} flows {where}") from error
    if (line := cap_line(flows.values())) is not None:
        reporter.note(line)
    mean = float(np.mean(times)) if times else float("nan")
    return flows, Tally(solved=len(times), reused=reused, seconds=perf_counter() - start, seconds_per_flow=mean)


def snapshots_of_flows(
    campaign: Campaign, flows: Mapping[FlowKey, Flow], failed: Mapping[FlowKey, str] | None = None
) -> Snapshots:
    """Return the pressures, each condition's flow turned to its wind; its first condition counts as solved.

    Conditions of the flows ``failed``, by cause, are left out and named in the settings.

    Raises
    ------
    FlowReachError
        No condition is left.
    """
    engine, failed = campaign.engine, failed or {}
    all_keys = [engine.flow_key(condition) for condition in campaign.conditions]
    left_out = [
        FailedCondition(number, campaign.conditions[number], failed[key])
        for number, key in enumerate(all_keys)
        if key in failed
    ]
    rows = [number for number, key in enumerate(all_keys) if key not in failed]
    if not rows:
        raise FlowReachError(missing_line(left_out, 0))
    conditions, keys = [campaign.conditions[number] for number in rows], [all_keys[number] for number in rows]
    first: dict[FlowKey, int] = {}
    for number, key in enumerate(keys):
        first.setdefault(key, number)
    origin = np.array([first[key] for key in keys], dtype=np.int64)
    surface, grid = engine.surface, campaign.grid
    if grid is not None and not np.array_equal(surface.point, mesh_of_grid(grid).point):
        grid = None
    pressure = np.empty((len(conditions), surface.n_nodes))
    for i, (condition, key) in enumerate(zip(conditions, keys, strict=True)):
        pressure[i] = condition.ambient_pressure * engine.pressure_ratio(flows[key], condition)
    reference = campaign.reference
    mass_error = np.array([flows[key].mass_error for key in keys])
    return Snapshots(
        vehicle=campaign.vehicle,
        engine=engine.name,
        settings={
            **campaign.settings,
            "inputs": dict(engine.inputs()),
            **({"failed": [failure.as_entry() for failure in left_out]} if left_out else {}),
        },
        condition=np.array([condition.as_row() for condition in conditions]),
        pressure=pressure,
        internal_pressure=campaign.internal_pressure[rows],
        reference=np.array([reference.area, reference.length, reference.moment_station]),
        point=surface.point,
        triangle=surface.triangle,
        station=None if grid is None else grid.x,
        radius=None if grid is None else grid.radius,
        meridian_angle=None if grid is None else grid.angle,
        solved=origin == np.arange(len(conditions)),
        flow=origin,
        momentum_error=np.array([flows[key].momentum_error for key in keys]),
        repairs=np.array([flows[key].repairs for key in keys], dtype=np.int64),
        mass_error=mass_error if np.isfinite(mass_error).any() else None,
    )


def _flows_of_file(path: Path, engine_hash: str) -> dict[FlowKey, Flow]:
    """Return the flows in a finished file that are still valid; none in one that cannot be read."""
    try:
        file_flows = load_flows(path)
    except InputError:
        return {}
    return {flow.key: flow for flow in file_flows.flows} if file_flows.fingerprint == engine_hash else {}


def _holds(path: Path, snapshots: Snapshots, kept_flows: KeptFlows) -> bool:
    """Return whether the file at ``path`` already holds exactly this."""
    try:
        return _equal(load_snapshots(path), snapshots) and _equal(load_flows(path), kept_flows)
    except InputError:
        return False


def _equal(a: Any, b: Any) -> bool:
    """Return whether two values are the same in every entry, NaN equal to NaN."""
    if is_dataclass(a):
        return all(_equal(getattr(a, entry.name), getattr(b, entry.name)) for entry in fields(a))
    if isinstance(a, Mapping):
        return a.keys() == b.keys() and all(_equal(a[key], b[key]) for key in a)
    if isinstance(a, tuple | list):
        return len(a) == len(b) and all(map(_equal, a, b))
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.dtype == b.dtype and np.array_equal(a, b, equal_nan=True)
    return bool(a == b or (a != a and b != b))


def vehicle_campaign(
    vehicle: Vehicle,
    engine: Engine,
    sets: Sequence[ConditionSet] = (),
    options: Mapping[str, Any] | None = None,
) -> Campaign:
    """Return the campaign of ``engine`` over ``sets`` one after the other.

    Without sets, over the engine's own conditions if it has only those, else over the vehicle file's.

    A condition of several sets is in the file once for each; its flow is solved once. ``options`` are those by
    which the user set entries of the vehicle file aside (``set``, ``engine``, ``grid``); the file keeps them.
    """
    chosen = list(sets)
    if not chosen:
        listed, where = engine.conditions(), f"{engine.name} engine"
        if listed is None:
            listed, where = vehicle.flight_conditions(), "vehicle file"
        chosen = [ConditionSet(where, tuple(listed))]
    body = vehicle.body() if vehicle.has_meridian else None
    conditions = tuple(condition for chosen_set in chosen for condition in chosen_set.conditions)
    return Campaign(
        vehicle=vehicle.name,
        engine=engine,
        conditions=conditions,
        internal_pressure=vehicle.structure.internal_pressure(conditions),
        reference=vehicle.reference_quantities(),
        grid=None if body is None else surface_grid(body, *vehicle.resolution.map.surface_nodes),
        settings={
            "strainfmu_version": __version__,
            "sets": [{"name": chosen_set.name, "conditions": len(chosen_set.conditions)} for chosen_set in chosen],
            "options": dict(options or {}),
            **({"parameters": list(vehicle.conditions.parameters)} if vehicle.conditions.parameters else {}),
            **({} if body is None else {"profile": profile_record(body)}),
        },
    )


def campaign_notes(result: CampaignResult) -> list[str]:
    """Return in a few lines what a campaign did and how accurate its flows are."""
    snapshots, tally = result.snapshots, result.tally
    conditions, flows = len(snapshots.condition), int(snapshots.solved.sum())
    notes = [
        f"{conditions} conditions: {flows} flows, {conditions - flows} rolled from them; "
        f"{tally.solved} solved now, {tally.reused} reused"
    ]
    if np.isfinite(snapshots.momentum_error).any():
        balance = f"force and momentum agree within {100.0 * np.nanmax(snapshots.momentum_error):.2g} %"
        if snapshots.mass_error is not None:
            balance += f", mass is conserved within {100.0 * np.nanmax(snapshots.mass_error):.2g} %"
        notes.append(balance)
    repaired = int(np.sum(snapshots.solved & (snapshots.repairs > 0)))
    if repaired:
        notes.append(f"{repaired} flows needed states repaired, {snapshots.repairs.max()} at most in one")
    if tally.solved:
        notes.append(f"{tally.seconds:.1f} s for the flows, {tally.seconds_per_flow:.2g} s for one on one worker")
    failed = failed_conditions(snapshots)
    if failed:
        notes.append(f"warning: {len(failed)} of {conditions + len(failed)} conditions are not in the result")
    return notes + failure_lines(failed)
