"""Other ways to place gauges, to compare with: pivoted QR of the modes' strain, evenly spread rows, at random.

Source: Manohar, Brunton, Kutz and Brunton, Data-driven sparse sensor placement, IEEE Control Syst. 38 (2018) 63,
which PySensors implements.

Accuracy of the placement and of other layouts: against gauges, their noise, their position, and flush ports.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import qr

from builder.aero.surface.mesh import grid_of
from builder.placement.design import Aim, Study, aimed
from builder.placement.flight_models import FlightParts, flight_model
from builder.placement.gaussian_model import GaussianModel
from builder.placement.limits import Limits, rules_of
from builder.placement.lost_gauge import loss_ratios
from builder.placement.pressure_basis import counted_sensors
from builder.placement.selection import best_of_starts, greedy, rounded
from builder.reporting import Progress
from builder.vehicle.gauges.sensor_entries import Ports, Sensors
from strainfmu.arrays import FloatArray, IntArray

ROWS = (0.0, 90.0, 180.0, 270.0)
"""Roll angles of evenly spread rows [deg]: axial gauges on all, hoop gauges on the first and the third."""


def strain_modes(study: Study, count: int) -> FloatArray:
    """Return (n_a, count) the modes of the strain that the flows make at the first gauge of every offered site."""
    flown = study.parts.ensemble.responses(study.parts.basis.fields.T)
    first = study.candidates.sites[: study.offered, 0]
    modes, _, _ = np.linalg.svd(study.strain.strain[first] @ flown.T, full_matrices=False)
    return np.asarray(modes[:, :count])


def qr_sites(study: Study, count: int) -> list[int]:
    """Return ``count`` offered sites by QR with column pivoting of as many strain modes."""
    modes = strain_modes(study, count)
    _, _, pivots = qr(modes.T, mode="economic", pivoting=True)
    return [int(pivot) for pivot in pivots[:count]]


def even_sites(study: Study, count: int) -> list[int]:
    """Return ``count`` offered sites in rows of evenly spaced stations, or fewer where rows have no candidates."""
    candidates, sites = study.candidates, list[int]()
    first = candidates.sites[: study.offered, 0]
    x = candidates.x[first]
    roll = np.degrees(candidates.roll_angle[first]) % 360.0
    kind = np.array([candidates.kind[gauge] for gauge in first])
    stations = np.unique(x)
    per_row = max(1, -(-count // 6))
    wanted = stations[np.round(np.linspace(0, len(stations) - 1, min(per_row, len(stations)))).astype(int)]
    for station in wanted:
        for number, angle in enumerate(ROWS):
            for name in ("axial", "hoop") if number % 2 == 0 else ("axial",):
                apart = np.abs((roll - angle + 180.0) % 360.0 - 180.0)
                on_station = np.flatnonzero((x == station) & (kind == name))
                if len(on_station):
                    sites.append(int(on_station[np.argmin(apart[on_station])]))
    return sites[:count]


COUNTS = (6, 9, 12, 18, 24, 36, 54, 72)
"""Numbers of gauges that are drawn."""

NOISES = (0.5, 1.0, 2.0, 4.0)
"""Noise of the gauges over the noise of the vehicle file."""

POSITIONS = (0.0, 1.0, 2.0, 5.0)
"""Errors of a gauge's position, one standard deviation [mm]."""

PORTS = (0, 2, 4, 8)
"""Flush ports around one station."""

PORT_STATION, PORT_STD, PORT_GAIN = 0.05, 50.0, 0.5
"""Station over the length of the body, noise [Pa] and gain error [%] of ports where the vehicle file has none."""

PLACED, QR, EVEN = "placed", "pivoted QR", "evenly spread rows"


@dataclass(frozen=True, eq=False, kw_only=True)
class Sweep:
    """Sigmas of fixed layouts against one quantity.

    Attributes
    ----------
    label : the quantity with its unit, of an axis.
    values : (n,) of it.
    sigmas : (n, 5) by layout, over the sigmas of the layout in use as the vehicle file is.
    """

    label: str
    values: tuple[float, ...]
    sigmas: dict[str, FloatArray]


@dataclass(frozen=True, eq=False, kw_only=True)
class Curves:
    """Sigmas over the sigmas of the layout in use.

    Attributes
    ----------
    counts : (n,) numbers of gauges.
    placed : (n, 5) of placements.
    lost : (n, 5) of these after the loss of the gauge whose loss raises each sigma most.
    qr, even : (n, 5) of layouts by QR and of evenly spread rows.
    own_count : gauges of the layout in use, whose sigmas are 1.
    own_name : its name.
    sweeps : of the placement, the layout in use, and the others with as many gauges as the placement.
    """

    counts: tuple[int, ...]
    placed: FloatArray
    lost: FloatArray
    qr: FloatArray
    even: FloatArray
    own_count: int
    own_name: str
    sweeps: tuple[Sweep, ...]


def accuracy_curves(
    study: Study, limits: Limits, aim: Aim, sites: tuple[int, ...], progress: Progress | None = None
) -> Curves:
    """Return the curves of a study with the placement at ``sites``.

    Each placement of another number is the best of exchanges from greedy choice, QR and rows. Gauges are counted
    whatever ``limits`` counts. Numbers that its distances and zones leave no room for, and those below the gauges
    that are kept, are left out.
    """
    free = replace(limits, budget=None, gauges=max(1, len(study.kept_sites)), costs={}, cable=(0.0, 0.0))
    offered = [*range(study.offered), *study.kept_sites]
    forced = list(range(study.offered, len(offered)))
    candidates = replace(study.candidates, sites=study.candidates.sites[offered])
    offered_candidates, rules = rules_of(candidates, free, forced)
    number = {tuple(site): k for k, site in reversed(list(enumerate(study.candidates.sites.tolist())))}
    of_study = np.array([number[tuple(site)] for site in offered_candidates.sites.tolist()], dtype=np.int64)
    counts = [count for count in COUNTS if len(study.kept_sites) <= count <= offered_candidates.n_gauges.sum()]
    placed, lost = np.full((len(counts), 5), np.nan), np.full((len(counts), 5), np.nan)
    inside = aimed(study, aim).of_sites(of_study)
    steps = len(counts) + len(NOISES) + len(POSITIONS) + len(PORTS)
    for k, count in enumerate(counts):
        allowed = replace(rules, budget=float(count))
        starts = [greedy(inside, allowed, allowed.forced)]
        for rival in (qr_sites(study, count), even_sites(study, count)):
            starts.append(rounded(_by_rank(of_study, rival), allowed))
        chosen = best_of_starts(inside, allowed, starts)
        if float(rules.cost[chosen].sum()) == count:
            chosen_sites = of_study[chosen].tolist()
            placed[k] = _ratio(study.model, chosen_sites)
            lost[k] = placed[k] * loss_ratios(study.model, chosen_sites).max(axis=0)
        if progress is not None:
            progress(k + 1, steps)
    own_name = study.parts.vehicle.gauges.layout
    n_placed = int(study.candidates.n_gauges[list(sites)].sum())
    layouts = {
        PLACED: list(sites),
        own_name: list(study.layout_sites),
        QR: qr_sites(study, n_placed),
        EVEN: even_sites(study, n_placed),
    }
    return Curves(
        counts=tuple(counts),
        placed=placed,
        lost=lost,
        qr=np.array([_ratio(study.model, qr_sites(study, count)) for count in counts]),
        even=np.array([_ratio(study.model, even_sites(study, count)) for count in counts]),
        own_count=int(study.candidates.n_gauges[list(study.layout_sites)].sum()),
        own_name=own_name,
        sweeps=_sweeps(study, layouts, progress, len(counts), steps),
    )


def _sweeps(
    study: Study, layouts: dict[str, list[int]], progress: Progress | None, done: int, steps: int
) -> tuple[Sweep, ...]:
    parts, noise = study.parts, study.parts.vehicle.noise
    positions = [
        replace(parts, vehicle=parts.vehicle.model_copy(update={"noise": entry}))
        for entry in (noise.model_copy(update={"gauge_position_mm": value}) for value in POSITIONS)
    ]
    asked: list[tuple[str, tuple[float, ...], list[FlightParts]]] = [
        ("gauge noise over the stated one [1]", NOISES, [_with_noise(parts, factor) for factor in NOISES]),
        ("error of position [mm]", POSITIONS, positions),
    ]
    if grid_of(parts.structure.surface) is not None:
        asked.append(("flush ports [1]", tuple(map(float, PORTS)), [_with_ports(parts, count) for count in PORTS]))
    sweeps = []
    for label, values, changed in asked:
        sigmas: dict[str, list[FloatArray]] = {name: [] for name in layouts}
        for changed_parts in changed:
            for name, sigma in _sigmas(study, changed_parts, layouts).items():
                sigmas[name].append(sigma)
            done += 1
            if progress is not None:
                progress(done, steps)
        sweeps.append(
            Sweep(label=label, values=values, sigmas={name: np.array(rows) for name, rows in sigmas.items()})
        )
    return tuple(sweeps)


def _sigmas(study: Study, parts: FlightParts, layouts: dict[str, list[int]]) -> dict[str, FloatArray]:
    """Return (5,) sigmas of each layout with ``parts``, over the sigmas of the layout in use with the study's."""
    used = np.unique(np.concatenate([np.array(sites, dtype=np.int64) for sites in layouts.values()]))
    place_of = {int(site): k for k, site in enumerate(used)}
    model = flight_model(parts, study.strain, study.candidates.sites[used], study.kind)
    return {
        name: _ratio(model, [place_of[site] for site in sites]) / study.own_sigma
        for name, sites in layouts.items()
    }


def _with_noise(parts: FlightParts, factor: float) -> FlightParts:
    return replace(parts, noise_std=factor * parts.noise_std)


def _with_ports(parts: FlightParts, count: int) -> FlightParts:
    """Return ``parts`` with ``count`` ports evenly around, instead of the ports of the vehicle file."""
    entry, grid = parts.vehicle.sensors, grid_of(parts.structure.surface)
    assert grid is not None
    ports = None if entry is None else entry.ports
    if ports is None:
        x = max(float(grid.x[0]), PORT_STATION * float(grid.x[-1]))
        ports = Ports(x_m=x, roll_deg=[0.0], std_Pa=PORT_STD, range_Pa=1e6, gain_percent=PORT_GAIN)
    angles = [360.0 * k / count for k in range(count)]
    new = ports.model_copy(update={"roll_deg": angles}) if count else None
    changed = Sensors.model_construct(ports=new) if entry is None else entry.model_copy(update={"ports": new})
    return replace(parts, sensors=counted_sensors(changed, grid, parts.basis))


def _by_rank(of_study: IntArray, sites: list[int]) -> FloatArray:
    """Return (n,) weights that fall along ``sites``, 0 for all others of ``of_study``."""
    rank = {site: number for number, site in enumerate(sites)}
    return np.array([1.0 / (1.0 + rank[index]) if index in rank else 0.0 for index in of_study.tolist()])


def _ratio(model: GaussianModel, sites: list[int]) -> FloatArray:
    return np.asarray(np.sqrt(model.weight @ model.goal_variance(sites)))
