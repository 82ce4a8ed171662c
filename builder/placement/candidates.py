"""Candidate gauges: a grid of stations and roll angles on the wall, directions at each point, and sites."""

from collections.abc import Callable
from dataclasses import dataclass
from math import degrees, radians

import numpy as np

from builder.structure.fourier.inner_surface import inner_surface_points
from builder.structure.gauge_placement import gauge_mesh
from builder.structure.solid.gauge_layouts import GaugeSurface
from builder.structure.solid.solid_mesh import SolidMesh
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.layout import GaugeLayout
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

ANGLES = {"axial": 0.0, "hoop": 90.0, "45": 45.0, "-45": -45.0}
"""Directions by name: angle from the meridian, aft, towards increasing roll angle [deg]."""

WORDS = {"45": "plus45", "-45": "minus45"}
"""Directions as they stand in names of gauges, where these differ."""

ROSETTE = "rosette"
IN_ROSETTE = ("axial", "45", "hoop")
"""Three gauges at one point, and their directions."""

EDGE = 0.02
"""Stations that are not stated keep this distance from the ends of the hollow part, in lengths of the body."""

STATIONS, ROLLS = 25, 24
"""Stations and roll angles where none are stated."""

MIRROR, OPPOSITE = "mirror", "opposite"
"""Pairs: at roll angles phi and -phi, or phi and phi + 180 deg."""

_SAME = 1e-6


@dataclass(frozen=True, kw_only=True)
class CandidateGrid:
    """What candidates there are.

    Attributes
    ----------
    stations : [m]; None for :data:`STATIONS` of the hollow part, evenly spaced.
    roll_angles : [deg]; None for :data:`ROLLS` all round.
    directions : names of :data:`ANGLES`, or "rosette".
    pairs : "mirror" or "opposite" to place gauges in such pairs; empty for single ones.
    """

    stations: tuple[float, ...] | None = None
    roll_angles: tuple[float, ...] | None = None
    directions: tuple[str, ...] = ("axial", "hoop")
    pairs: str = ""

    def __post_init__(self) -> None:
        known = (*ANGLES, ROSETTE)
        for name in self.directions:
            if name not in known:
                raise InputError(f"--directions: expected some of {', '.join(known)}, got '{name}'")
        if len(set(self.directions)) < len(self.directions):
            raise InputError(f"--directions: expected each once, got {','.join(self.directions)}")
        if self.pairs not in ("", MIRROR, OPPOSITE):
            raise InputError(f"--pairs: expected {MIRROR} or {OPPOSITE}, got '{self.pairs}'")


@dataclass(frozen=True, eq=False, kw_only=True)
class Candidates:
    """Gauges, and the sites of one or more of them that are placed together.

    Attributes
    ----------
    gauges : names, positions and directions of all gauges.
    x, roll_angle : (n,) stations [m] and roll angles [rad].
    kind : (n,) names of the directions; "" for a gauge of a file.
    sites : (n_a, b) gauges of each site, -1 where it has fewer than b.
    """

    gauges: GaugeLayout
    x: FloatArray
    roll_angle: FloatArray
    kind: tuple[str, ...]
    sites: IntArray

    @property
    def n_gauges(self) -> FloatArray:
        """(n_a,) number of gauges of each site."""
        return np.sum(self.sites >= 0, axis=1).astype(float)

    def gauges_of(self, sites: IntArray | list[int]) -> IntArray:
        """Return the gauges of ``sites``, one site after another."""
        gauges = self.sites[np.asarray(sites, dtype=np.int64)].ravel()
        return gauges[gauges >= 0]

    def layout(self, sites: IntArray | list[int]) -> GaugeLayout:
        """Return the gauges of ``sites`` by station, roll angle and direction."""
        gauges = self.gauges_of(sites)
        order = np.lexsort((gauges, self.roll_angle[gauges], self.x[gauges]))
        return layout_of(self.gauges, gauges[order])


def layout_of(layout: GaugeLayout, gauges: IntArray) -> GaugeLayout:
    """Return the gauges numbered ``gauges`` of a layout."""
    return GaugeLayout(
        tuple(layout.names[gauge] for gauge in gauges), layout.position[gauges], layout.direction[gauges]
    )


Frame = tuple[FloatArray, FloatArray, FloatArray]
"""A point of the wall (3,) [m], and unit vectors (3,) in the surface there: aft, and towards the roll angle."""


def grid_candidates(vehicle: Vehicle, grid: CandidateGrid) -> Candidates:
    """Return candidates on the inner surface of a body of revolution.

    Raises
    ------
    InputError
        A station is not within the hollow part, or a pair has no partner among the roll angles.
    """
    mesh = gauge_mesh(vehicle)
    inner = mesh.node[mesh.inner_edge.ravel(), 0]
    stations = _stations(grid, float(inner.min()), float(inner.max()), vehicle.body().length)
    free = ~np.any(
        [(stations > a) & (stations < b) for a, b in mesh.covered] or [np.zeros(len(stations), bool)], axis=0
    )
    stations = np.unique(stations[free])
    points = inner_surface_points(mesh, stations)

    def frame(number: int, angle: float) -> Frame:
        sine, cosine = np.sin(angle), np.cos(angle)
        radius, tangent = points.radius[number], points.tangent[number]
        return (
            np.array([stations[number], radius * sine, radius * cosine]),
            np.array([tangent[0], tangent[1] * sine, tangent[1] * cosine]),
            np.array([0, cosine, -sine]),
        )

    return _of_frames(grid, stations, frame)


def surface_candidates(mesh: SolidMesh, surface: str, grid: CandidateGrid) -> Candidates:
    """Return candidates on a ``surface`` of the mesh of any shape, seen from the axis at stations and roll angles.

    Of stations that are not stated, those without a surface at every roll angle are left out.

    Raises
    ------
    InputError
        A stated station has no surface at one of the roll angles, or a pair has no partner among these.
    """
    wall = GaugeSurface(mesh, surface)
    x = mesh.node[np.unique(mesh.named_surface(surface)), 0]
    stations = np.unique(_stations(grid, float(x.min()), float(x.max()), float(np.ptp(mesh.node[:, 0]))))
    frames: list[list[Frame]] = []
    with_surface = []
    for station in stations.tolist():
        try:
            feet = [wall.at_roll_angle(station, radians(angle), "--stations") for angle in _roll_angles(grid)]
            frames.append([(foot.point, *wall.axes(foot, "--stations")) for foot in feet])
        except InputError:
            if grid.stations is not None:
                raise
            continue
        with_surface.append(station)
    if not with_surface:
        raise InputError("--roll-angles: expected a surface at one station at least, got none; state --stations")
    of_angle = {round(angle, 6): k for k, angle in enumerate(_roll_angles(grid).tolist())}
    return _of_frames(
        grid, np.array(with_surface), lambda number, angle: frames[number][of_angle[round(degrees(angle), 6)]]
    )


def _stations(grid: CandidateGrid, first: float, last: float, length: float) -> FloatArray:
    """Return the stations of ``grid`` [m] on a wall from ``first`` to ``last`` of a body of ``length``."""
    if grid.stations is None:
        edge = EDGE * length
        return np.asarray(np.round(np.linspace(first + edge, last - edge, STATIONS), 3))
    stations = np.array(grid.stations)
    outside = stations[(stations <= first) | (stations >= last)]
    if len(outside):
        raise InputError(
            f"--stations: expected some within the hollow part, {first:.4g} to {last:.4g} m, got {outside[0]:g} m"
        )
    return stations


def _roll_angles(grid: CandidateGrid) -> FloatArray:
    """Return the roll angles of ``grid`` [deg], each once."""
    angles = np.arange(ROLLS) * 360.0 / ROLLS if grid.roll_angles is None else np.array(grid.roll_angles)
    return np.unique(np.round(angles % 360.0, 6))


def _of_frames(grid: CandidateGrid, stations: FloatArray, frame: Callable[[int, float], Frame]) -> Candidates:
    """Return the directions of ``grid`` at every station, by its number, and roll angle [rad] of ``frame``."""
    angles = _roll_angles(grid)
    kinds = [kind for name in grid.directions for kind in (IN_ROSETTE if name == ROSETTE else (name,))]
    names, position, direction, kind_of, x_of, roll_of = [], [], [], [], [], []
    for station, x in enumerate(stations):
        for angle in angles:
            point, along, around = frame(station, float(np.radians(angle)))
            for number, kind in enumerate(kinds):
                turn = np.radians(ANGLES[kind])
                again = kinds[:number].count(kind)
                names.append(
                    f"{WORDS.get(kind, kind)}_{angle:g}deg_{1e3 * x:.6g}mm" + ("_rosette" if again else "")
                )
                position.append(point)
                direction.append(np.cos(turn) * along + np.sin(turn) * around)
                kind_of.append(kind)
                x_of.append(x)
                roll_of.append(np.radians(angle))
    layout = GaugeLayout(tuple(names), np.array(position).reshape(-1, 3), np.array(direction).reshape(-1, 3))
    points_sites = _sites_of_points(grid.directions)
    n_points, per_point = len(stations) * len(angles), len(kinds)
    sites = [[per_point * point + leg for leg in site] for point in range(n_points) for site in points_sites]
    if grid.pairs:
        sites = _paired(sites, angles, len(points_sites), grid)
    return Candidates(
        gauges=layout,
        x=np.array(x_of),
        roll_angle=np.array(roll_of),
        kind=tuple(kind_of),
        sites=_padded(sites),
    )


def with_gauges(candidates: Candidates, added: GaugeLayout) -> tuple[Candidates, list[int]]:
    """Return the candidates with gauges of a file, each a site of its own, and the numbers of these sites.

    A gauge of the file that is a candidate already is that one.
    """
    known, gauges = candidates.gauges, candidates.gauges
    first, n_sites = len(known.names), len(candidates.sites)
    names = set(known.names)
    for name in added.names:
        if name in names:
            number = known.names.index(name)
            if np.abs(known.position[number] - added.position[added.names.index(name)]).max() > _SAME:
                raise InputError(f"--keep: gauge '{name}' has the name of a candidate elsewhere; rename it")
    fresh = [k for k, name in enumerate(added.names) if name not in names]
    gauges = GaugeLayout(
        known.names + tuple(added.names[k] for k in fresh),
        np.concatenate([known.position, added.position[fresh]]),
        np.concatenate([known.direction, added.direction[fresh]]),
    )
    roll = np.arctan2(added.position[fresh, 1], added.position[fresh, 2]) % (2.0 * np.pi)
    width = candidates.sites.shape[1]
    added_sites = [[gauges.names.index(name)] for name in added.names]
    sites = np.full((len(added_sites), width), -1, dtype=np.int64)
    sites[:, 0] = np.array(added_sites).ravel()
    extended = Candidates(
        gauges=gauges,
        x=np.concatenate([candidates.x, added.position[fresh, 0]]),
        roll_angle=np.concatenate([candidates.roll_angle, roll]),
        kind=candidates.kind + ("",) * len(fresh),
        sites=np.concatenate([candidates.sites, sites]),
    )
    assert len(extended.x) == first + len(fresh)
    return extended, list(range(n_sites, n_sites + len(added_sites)))


def _sites_of_points(directions: tuple[str, ...]) -> list[list[int]]:
    """Return the sites at a point by the gauges there."""
    sites, first = [], 0
    for name in directions:
        size = 3 if name == ROSETTE else 1
        sites.append(list(range(first, first + size)))
        first += size
    return sites


def _paired(sites: list[list[int]], angles: FloatArray, per_point: int, grid: CandidateGrid) -> list[list[int]]:
    """Return pairs of sites; one on the plane of symmetry is alone. A mirrored 45 is a -45."""
    partner = (-angles if grid.pairs == MIRROR else angles + 180.0) % 360.0
    place = {round(float(angle), 5) % 360.0: k for k, angle in enumerate(angles)}
    other_kind = list(range(per_point))
    if grid.pairs == MIRROR:
        swap = {"45": "-45", "-45": "45"}
        for k, name in enumerate(grid.directions):
            if name == ROSETTE or (name in swap and swap[name] not in grid.directions):
                raise InputError(f"--pairs: a mirrored {name} needs 45 and -45 among the directions")
            other_kind[k] = grid.directions.index(swap.get(name, name))
    paired, n = [], len(angles)
    for number, site in enumerate(sites):
        point, kind = divmod(number, per_point)
        station, roll = divmod(point, n)
        partner_roll = place.get(round(float(partner[roll]), 5) % 360.0)
        if partner_roll is None:
            raise InputError(
                f"--pairs: roll angle {angles[roll]:g} deg has no partner at {partner[roll]:g} deg; add it"
            )
        partner_site = (station * n + partner_roll) * per_point + other_kind[kind]
        if partner_site == number:
            paired.append(site)
        elif partner_site > number:
            paired.append(site + sites[partner_site])
    return paired


def _padded(sites: list[list[int]]) -> IntArray:
    width = max(map(len, sites), default=1)
    return np.array([site + [-1] * (width - len(site)) for site in sites], dtype=np.int64).reshape(-1, width)
