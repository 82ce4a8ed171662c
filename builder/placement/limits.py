"""Limits of a placement, as a user states them, and as rules for sites.

Rules are cost and budget, sites that exclude each other, and sites that are forced.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.spatial import cKDTree

from builder.placement.candidates import Candidates
from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.errors import InputError

_SLACK = 1e-9


@dataclass(frozen=True, eq=False, kw_only=True)
class Rules:
    """Limits of a choice among n_a sites.

    Attributes
    ----------
    cost : (n_a,) of each site; the number of its gauges where gauges are counted.
    budget : largest cost of all chosen sites.
    excludes : (n_a, n_a) sparse, 1 where two sites must not both be chosen.
    forced : sites that are chosen in any case, in their order.
    """

    cost: FloatArray
    budget: float
    excludes: csr_array
    forced: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        spent = float(self.cost[list(self.forced)].sum())
        if spent > self.budget + _SLACK:
            raise InputError(
                f"placement: expected a budget of {spent:g} for the forced gauges at least, got {self.budget:g}"
            )

    @cached_property
    def free(self) -> IntArray:
        """Sites that may be chosen in addition to the forced ones."""
        return np.flatnonzero(self.allowed(self.forced, whole_budget=True))

    def excluded_by(self, chosen: Iterable[int]) -> BoolArray:
        """Return (n_a,) which sites are chosen, or excluded by one that is."""
        is_excluded = np.zeros(len(self.cost), dtype=bool)
        pointer, index = self.excludes.indptr, self.excludes.indices
        for site in chosen:
            is_excluded[site] = True
            is_excluded[index[pointer[site] : pointer[site + 1]]] = True
        return is_excluded

    def remaining_budget(self, chosen: Iterable[int]) -> float:
        """Return what is left of the budget."""
        return self.budget - float(self.cost[list(chosen)].sum())

    def allowed(self, chosen: Iterable[int], whole_budget: bool = False) -> BoolArray:
        """Return (n_a,) which sites may be chosen next."""
        chosen = list(chosen)
        within = self.cost <= (self.budget if whole_budget else self.remaining_budget(chosen)) + _SLACK
        return within & ~self.excluded_by(chosen)

    def of_sites(self, sites: IntArray) -> Rules:
        """Return the same for these sites alone; all forced ones must be among them."""
        place = {int(site): number for number, site in enumerate(sites)}
        return Rules(
            cost=self.cost[sites],
            budget=self.budget,
            excludes=csr_array(self.excludes[sites][:, sites]),
            forced=tuple(place[site] for site in self.forced),
        )


SAME_POINT = 1e-4
"""Gauges nearer than this are at one point, as the legs of a rosette are, and need no distance [m]."""


@dataclass(frozen=True, kw_only=True)
class Zone:
    """Part of the wall without gauges: stations ``first`` to ``last`` [m], roll angles ``start`` to ``end`` [deg].

    The roll angles go from ``start`` up to ``end``, through 0 where ``end`` is the smaller one.
    """

    first: float
    last: float
    start: float = 0.0
    end: float = 360.0

    def holds(self, x: FloatArray, roll_deg: FloatArray) -> BoolArray:
        """Return (n,) which points are in the zone, its ends included."""
        within = (x >= self.first - 1e-9) & (x <= self.last + 1e-9)
        span = (self.end - self.start) % 360.0 or 360.0
        return np.asarray(within & ((roll_deg - self.start) % 360.0 <= span + 1e-9))


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits of a placement.

    Attributes
    ----------
    gauges : how many; None where ``budget`` limits them.
    budget : largest cost of all; None where ``gauges`` is given.
    costs : of a gauge by the name of its direction; 1 where none is stated.
    spacing : smallest distance of gauges that are not at one point [m].
    zones : without gauges.
    kinds : how many directions may be used; None for all.
    directions : that may be used; None for all.
    cable : cost of a metre of cable, and the station that all cables run to along the body [m].
    """

    gauges: int | None = None
    budget: float | None = None
    costs: dict[str, float] = field(default_factory=dict)
    spacing: float = 0.0
    zones: tuple[Zone, ...] = ()
    kinds: int | None = None
    directions: tuple[str, ...] | None = None
    cable: tuple[float, float] = (0.0, 0.0)


def rules_of(candidates: Candidates, limits: Limits, forced: Sequence[int] = ()) -> tuple[Candidates, Rules]:
    """Return the candidates outside the zones and near no forced gauge, and the rules of a choice among them.

    ``forced`` are sites that are chosen in any case.

    Raises
    ------
    InputError
        No choice keeps the limits; the message has the limit and the largest number that can be placed.
    """
    is_forced = np.zeros(len(candidates.sites), dtype=bool)
    is_forced[list(forced)] = True
    of_gauge = np.zeros(len(candidates.x), dtype=bool)
    for zone in limits.zones:
        of_gauge |= zone.holds(candidates.x, np.degrees(candidates.roll_angle) % 360.0)
    is_gauge = candidates.sites >= 0
    in_zone = np.any(of_gauge[candidates.sites] & is_gauge, axis=1)
    if np.any(in_zone & is_forced):
        site = int(np.flatnonzero(in_zone & is_forced)[0])
        raise InputError(f"--keep: gauge '{_name(candidates, site)}' is in a zone of --forbid; take it out of one")
    near, alone = _too_near(candidates, limits.spacing)
    has_unused = np.zeros(len(candidates.sites), dtype=bool)
    if limits.directions is not None:
        unused = np.array([kind not in (*limits.directions, "") for kind in candidates.kind])
        has_unused = np.any(unused[candidates.sites] & is_gauge, axis=1)
    allowed = np.flatnonzero((~in_zone & ~alone & ~has_unused) | is_forced)
    if not len(allowed):
        options = "--forbid, --spacing" if limits.directions is None else "--forbid, --spacing, --kinds"
        raise InputError(f"{options}: expected candidates that they allow, got none of {len(candidates.sites)}")
    place = np.full(len(candidates.sites), -1)
    place[allowed] = np.arange(len(allowed))
    chosen = Candidates(
        gauges=candidates.gauges,
        x=candidates.x,
        roll_angle=candidates.roll_angle,
        kind=candidates.kind,
        sites=candidates.sites[allowed],
    )
    excludes = csr_array(near[allowed][:, allowed])
    fixed = [int(place[forced_site]) for forced_site in forced]
    _check_forced(chosen, excludes, fixed, limits.spacing)
    cost = _cost(chosen, limits)
    spent = float(cost[fixed].sum())
    if limits.budget is not None:
        if spent + float(np.min(cost, initial=np.inf, where=~is_forced[allowed])) > limits.budget and not fixed:
            raise InputError(f"--budget: {limits.budget:g} found, the cheapest candidate costs {cost.min():g}")
        return chosen, Rules(cost=cost, budget=limits.budget, excludes=excludes, forced=tuple(fixed))
    assert limits.gauges is not None
    if spent > limits.gauges:
        raise InputError(f"--gauges: {limits.gauges} found, --keep holds {spent:g}")
    rules = Rules(cost=cost, budget=float(limits.gauges), excludes=excludes, forced=tuple(fixed))
    _check_count(rules, limits)
    return chosen, rules


def _name(candidates: Candidates, site: int) -> str:
    return candidates.gauges.names[candidates.sites[site][0]]


def _cost(candidates: Candidates, limits: Limits) -> FloatArray:
    """Return (n_a,) cost of each site: its number of gauges where these are counted."""
    if limits.budget is None:
        return candidates.n_gauges
    for name, value in limits.costs.items():
        if name not in candidates.kind:
            raise InputError(f"--costs: expected directions of the candidates, got '{name}'")
        if not value > 0.0:
            raise InputError(f"--costs: expected a positive cost of {name}, got {value:g}")
    rate, station = limits.cable
    of_gauge = np.array([*(limits.costs.get(kind, 1.0) for kind in candidates.kind), 0.0])
    of_gauge[:-1] += rate * np.abs(candidates.x - station)
    return np.asarray(of_gauge[candidates.sites].sum(axis=1))


def _too_near(candidates: Candidates, spacing: float) -> tuple[csr_array, BoolArray]:
    """Return (n_a, n_a) which sites exclude each other, and (n_a,) which exclude themselves.

    Sites exclude each other that have gauges within ``spacing``, or a gauge in common.
    """
    n = len(candidates.sites)
    of_site = np.repeat(np.arange(n), candidates.sites.shape[1])
    gauge = candidates.sites.ravel()
    of_site, gauge = of_site[gauge >= 0], gauge[gauge >= 0]
    position, direction = candidates.gauges.position[gauge], candidates.gauges.direction[gauge]
    pair = cKDTree(position).query_pairs(max(spacing * (1.0 - 1e-9), SAME_POINT), output_type="ndarray")
    distance = np.linalg.norm(position[pair[:, 0]] - position[pair[:, 1]], axis=1)
    unit = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    same = np.abs(np.sum(unit[pair[:, 0]] * unit[pair[:, 1]], axis=1)) > 1.0 - 1e-6
    first, second = of_site[pair[(distance > SAME_POINT) | same]].T
    alone = np.zeros(n, dtype=bool)
    alone[first[first == second]] = True
    between = first != second
    a, b = first[between], second[between]
    links = np.ones(2 * len(a))
    near = coo_array((links, (np.concatenate([a, b]), np.concatenate([b, a]))), shape=(n, n))
    return csr_array(near), alone


def _check_forced(candidates: Candidates, excludes: csr_array, forced: list[int], spacing: float) -> None:
    for number, site in enumerate(forced):
        excluded = set(excludes.indices[excludes.indptr[site] : excludes.indptr[site + 1]].tolist())
        for earlier in forced[:number]:
            if earlier in excluded:
                first, second = _name(candidates, earlier), _name(candidates, site)
                raise InputError(
                    f"--keep: gauges '{first}' and '{second}' are nearer than --spacing, {1e3 * spacing:g} mm"
                )


def _check_count(rules: Rules, limits: Limits) -> None:
    """Refuse a number of gauges that a choice by falling number of neighbours does not reach."""
    chosen = list(rules.forced)
    blocked, remaining = rules.excluded_by(chosen), rules.remaining_budget(chosen)
    order = np.argsort(np.diff(rules.excludes.indptr), kind="stable")
    for largest_first in (-rules.cost[order], rules.cost[order]):
        count, out, rest = len(chosen), blocked.copy(), remaining
        for site in order[np.argsort(largest_first, kind="stable")].tolist():
            if rest < rules.cost[site] - 1e-9 or out[site]:
                continue
            out[site], rest, count = True, rest - float(rules.cost[site]), count + 1
            out[rules.excludes.indices[rules.excludes.indptr[site] : rules.excludes.indptr[site + 1]]] = True
        if rest < 0.5:
            return
    reached = rules.budget - rest
    reason = f"--spacing of {1e3 * limits.spacing:g} mm" if rules.excludes.nnz else "the candidates"
    if rules.cost.min() > 1.0 and rest < rules.cost.min():
        reason = f"sites of {rules.cost.min():g} gauges each"
    raise InputError(f"--gauges: {rules.budget:g} found, {reason} and the zones leave room for {reached:g}")
