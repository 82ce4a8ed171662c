"""Surface pressure in files: ``strainfmu snapshots`` and ``surface``."""

from collections.abc import Sequence
from pathlib import Path

from builder.aero.cfd.formats.surface_files import write_surface
from builder.aero.engines.registry import make_engine
from builder.campaign.campaign_run import CampaignResult, campaign_notes, run_campaign, vehicle_campaign
from builder.campaign.scheduling import Scheduling
from builder.campaign.snapshot_fit import replaced_line
from builder.pipeline.map_files import snapshot_inputs
from builder.pipeline.pipeline import SNAPSHOTS
from builder.pipeline.progress_bars import AnyProgress, reporter_of
from builder.vehicle.file import load_vehicle
from builder.vehicle.flight_conditions import condition_set, count_repeated
from builder.workspace import Cache


def snapshots(
    vehicle: str | Path,
    output: str | Path = "snapshots.h5",
    *,
    sets: Sequence[str] = (),
    engine: str | None = None,
    grid: str | None = None,
    scheduler: str | None = None,
    workers: int | None = None,
    progress: AnyProgress = None,
) -> CampaignResult:
    """Solve the flow at many flight conditions: surface pressure in one HDF5 file.

    Every distinct flow is solved once and kept: an interrupted run continues, a finished file is reused, also the
    one that another command left in the cache next to the vehicle file.
    Conditions outside the reach of the flow model are listed and left out, with exit code 3. Another run tries
    them again.

    On the command line::

        strainfmu snapshots my_vehicle.toml -o snapshots.h5
        strainfmu snapshots my_vehicle.toml --set P1 --set P2 --grid medium
        strainfmu snapshots my_vehicle.toml --set conditions.csv --scheduler tcp://cluster:8786

    Parameters
    ----------
    vehicle : vehicle file (TOML).
    output : file to write.
    sets : flight conditions: sets "P1" and "P2" of the source, or CSV files. Default: the vehicle file's.
    engine : "euler", "newtonian" or "table". Default: the vehicle file's.
    grid : cells of the euler engine: "coarse", "medium" or "fine". Default: the vehicle file's.
    scheduler : Dask scheduler whose workers solve, tcp://host:port.
    workers : local worker processes; 0: threads of this process. Default: one per core.
    progress : True for progress bars.

    Raises
    ------
    InputError
        The vehicle file, or a file it names, is wrong, or every condition is outside the solver's reach.
    """
    output, reporter, scheduling = Path(output), reporter_of(progress), Scheduling(scheduler, workers)
    loaded = load_vehicle(vehicle)
    chosen = [condition_set(name) for name in sets]
    source = make_engine(loaded, engine, loaded.resolution.map, grid, reporter.note)
    entries = {"set": list(sets), "engine": engine, "grid": grid}
    campaign = vehicle_campaign(loaded, source, chosen, {name: value for name, value in entries.items() if value})
    repeated = count_repeated(campaign.conditions)
    if repeated:
        reporter.note(f"{repeated} conditions are in the sets more than once: kept in each, solved once")
    replaced = replaced_line(output, campaign)
    if replaced:
        reporter.note(replaced)
    cache, inputs = Cache(loaded.beside(".")), snapshot_inputs(loaded, campaign)
    if not output.exists() and (folder := cache.take(SNAPSHOTS, inputs, output)):
        reporter.note(f"{output}: {folder}, reused")
    result = run_campaign(campaign, output, scheduling, reporter)
    if not (result.up_to_date or result.failed):
        cache.add(SNAPSHOTS, inputs, output)
    for note in campaign_notes(result):
        reporter.note(note)
    return result


def surface(vehicle: str | Path, output: str | Path, *, closed: bool = False) -> None:
    """Write a vehicle's aerodynamic surface, in body axes (x aft, y starboard, z up) and metres.

    On the command line::

        strainfmu surface my_vehicle.toml -o body.stl --closed
        strainfmu surface my_vehicle.toml -o body.tri

    Parameters
    ----------
    vehicle : vehicle file (TOML).
    output : file to write: .stl, .tri, .vtp or .vtu.
    closed : cover the open base, as volume meshers need.
    """
    loaded = load_vehicle(vehicle)
    # Imported results need this surface before they exist, so it is never theirs that is asked for.
    engine = "euler" if loaded.aerodynamics.surface is None else "newtonian"
    write_surface(Path(output), make_engine(loaded, engine, loaded.resolution.map).surface, closed)
