"""Candidate gauges as rows of linear Gaussian models, one model per flight state, and their posterior.

At a flight state the unknowns are z ~ N(0, 1): departures of the state within the air data, pressure off the
tables, errors that gauges have in common. A candidate reads h'z plus noise of its own, both divided by the noise's
standard deviation. The goals, such as the five coefficients, are G z. With gauges S the covariance of the goals is

    G P G',    P = (P_0^-1 + sum over S of h h')^-1,

and one more gauge lowers its trace by |G P h|^2 / (1 + h' P h). So a gauge costs one product with the rows of all
candidates, and no inverse.

Source: Chaloner and Verdinelli, Bayesian experimental design, Statist. Sci. 10 (1995) 273; Krause, Singh and
Guestrin, J. Mach. Learn. Res. 9 (2008) 235.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from strainfmu.arrays import FloatArray, IntArray

Criterion = Literal["trace", "determinant"]
"""What a selection minimises: variance of the goals, or the volume of the posterior of all unknowns."""


@dataclass(frozen=True, eq=False, kw_only=True)
class GaussianModel:
    """n_s flight states, n_a sites of up to b gauges, m unknowns, n_g goals.

    A site is what is placed together: a gauge, a pair, a rosette. Sites of fewer gauges have rows of zeros.

    Attributes
    ----------
    rows : (n_s, n_a, b, m) of the candidates, over the noise of each.
    precision : (n_s, m, m) of the unknowns without any gauge.
    goals : (n_s, n_g, m) over the unknowns.
    fixed : (n_s, n_g) variance of the goals that no gauge lowers.
    weight : (n_s,) of the states, adding up to 1.
    criterion : what a selection minimises.
    """

    rows: FloatArray
    precision: FloatArray
    goals: FloatArray
    fixed: FloatArray
    weight: FloatArray
    criterion: Criterion = "trace"

    @property
    def n_sites(self) -> int:
        """Number of sites n_a."""
        return int(self.rows.shape[1])

    def of_sites(self, sites: Sequence[int] | IntArray) -> GaussianModel:
        """Return the model with these sites alone, in this order."""
        return replace(self, rows=self.rows[:, np.asarray(sites, dtype=np.int64)])

    def of_states(self, states: slice) -> GaussianModel:
        """Return the model of some of the flight states."""
        weight = self.weight[states]
        return replace(
            self,
            rows=self.rows[states],
            precision=self.precision[states],
            goals=self.goals[states],
            fixed=self.fixed[states],
            weight=weight / weight.sum(),
        )

    def joined(self, second: GaussianModel, part: float) -> GaussianModel:
        """Return the model of the flight states of both; ``part`` of the criterion is this one's."""
        m = max(self.rows.shape[-1], second.rows.shape[-1])
        both = [model.of_unknowns(m) for model in (self, second)]
        return replace(
            self,
            rows=np.concatenate([model.rows for model in both]),
            precision=np.concatenate([model.precision for model in both]),
            goals=np.concatenate([model.goals for model in both]),
            fixed=np.concatenate([model.fixed for model in both]),
            weight=np.concatenate([part * self.weight, (1.0 - part) * second.weight]),
        )

    def of_unknowns(self, count: int) -> GaussianModel:
        """Return the same model with ``count`` unknowns: those added are neither read nor part of a goal."""
        more = count - self.rows.shape[-1]
        precision = np.pad(self.precision, ((0, 0), (0, more), (0, more)))
        added = np.arange(self.rows.shape[-1], count)
        precision[:, added, added] = 1.0
        return replace(
            self,
            rows=np.pad(self.rows, ((0, 0), (0, 0), (0, 0), (0, more))),
            precision=precision,
            goals=np.pad(self.goals, ((0, 0), (0, 0), (0, more))),
        )

    def with_known(self, sites: Sequence[int] | IntArray) -> GaussianModel:
        """Return the model whose unknowns have been read by these sites already."""
        return replace(self, precision=self.precision_with(sites))

    def gauge_rows(self, sites: Sequence[int] | IntArray) -> FloatArray:
        """Return (n_s, k, m) the rows of the gauges of ``sites``, one after another."""
        n_s, _, _, m = self.rows.shape
        return self.rows[:, np.asarray(sites, dtype=np.int64)].reshape(n_s, -1, m)

    def precision_with(self, sites: Sequence[int] | IntArray, weight: FloatArray | None = None) -> FloatArray:
        """Return (n_s, m, m) with gauges at ``sites``, each counted ``weight`` (k,) times if given."""
        h = self.gauge_rows(sites)
        if weight is None:
            return self.precision + np.swapaxes(h, 1, 2) @ h
        count = np.repeat(weight, self.rows.shape[2])
        return self.precision + np.swapaxes(h * count[:, None], 1, 2) @ h

    def goal_variance(self, sites: Sequence[int] | IntArray) -> FloatArray:
        """Return (n_s, n_g) variance of the goals with gauges at ``sites``."""
        solved = np.linalg.solve(self.precision_with(sites), np.swapaxes(self.goals, 1, 2))
        return self.fixed + np.einsum("sgm,smg->sg", self.goals, solved)

    def value(self, sites: Sequence[int] | IntArray, weight: FloatArray | None = None) -> float:
        """Return the criterion with gauges at ``sites``: mean trace less ``fixed``, or minus log determinant."""
        return self.value_of(self.precision_with(sites, weight))

    def value_of(self, precision: FloatArray) -> float:
        """Return the criterion where the unknowns have ``precision`` (n_s, m, m)."""
        if self.criterion == "determinant":
            return -float(self.weight @ np.linalg.slogdet(precision)[1])
        solved = np.linalg.solve(precision, np.swapaxes(self.goals, 1, 2))
        return float(self.weight @ np.einsum("sgm,smg->s", self.goals, solved))


class Posterior:
    """The posterior of a growing set of gauges, and what each further site is worth.

    Worths are brought up to date for those sites that they are asked for.
    """

    def __init__(self, model: GaussianModel, chosen: Sequence[int] | IntArray = ()) -> None:
        self.model = model
        self.covariance: FloatArray = np.asarray(np.linalg.inv(model.precision_with(chosen)), dtype=np.float64)
        n_s, n_a, b, _ = model.rows.shape
        self._of_goals = np.empty((n_s, n_a, b, model.goals.shape[1]))
        self._own = np.empty((n_s, n_a, b, b))
        for s, (rows, covariance) in enumerate(zip(model.rows, self.covariance, strict=True)):
            row_covariance = rows @ covariance
            self._of_goals[s] = row_covariance @ model.goals[s].T
            self._own[s] = row_covariance @ np.swapaxes(rows, 1, 2)
        self._updates: list[tuple[FloatArray, FloatArray, FloatArray]] = []
        self._seen = np.zeros(n_a, dtype=np.int64)

    def add(self, site: int) -> None:
        """Take the gauges of ``site``."""
        self._change(site, 1.0)

    def remove(self, site: int) -> None:
        """Take the gauges of ``site``, one of those taken before, away."""
        self._change(site, -1.0)

    def gains(self, sites: IntArray | None = None) -> FloatArray:
        """Return (k,) what the criterion falls by with one of ``sites`` more, all of them by default."""
        sites = np.arange(self.model.n_sites) if sites is None else sites
        self._bring_up_to_date(sites)
        return self._worth(self._of_goals[:, sites], self._own[:, sites])

    def gains_without(self, site: int) -> FloatArray:
        """Return (n_a,) the same of all sites, were ``site`` taken away."""
        everything = np.arange(self.model.n_sites)
        self._bring_up_to_date(everything)
        of_goals, between = self._of_goals.copy(), self._own.copy()
        for update in self._updates_by(site, -1.0)[0]:
            _apply(self.model.rows, update, of_goals, between)
        return self._worth(of_goals, between)

    def _worth(self, of_goals: FloatArray, between: FloatArray) -> FloatArray:
        b = between.shape[-1]
        if self.model.criterion == "determinant":
            gain = np.log1p(between[..., 0, 0]) if b == 1 else np.linalg.slogdet(np.eye(b) + between)[1]
            return np.asarray(self.model.weight @ gain)
        if b == 1:
            lowered = np.sum(of_goals[:, :, 0] ** 2, axis=2) / (1.0 + between[..., 0, 0])
        else:
            lowered = np.sum(of_goals * np.linalg.solve(np.eye(b) + between, of_goals), axis=(2, 3))
        return np.asarray(self.model.weight @ lowered)

    def _change(self, site: int, sign: float) -> None:
        updates, self.covariance = self._updates_by(site, sign)
        self._updates += updates

    def _updates_by(
        self, site: int, sign: float
    ) -> tuple[list[tuple[FloatArray, FloatArray, FloatArray]], FloatArray]:
        """Return the updates by the gauges of ``site``, one by one, and the covariance after them."""
        covariance: FloatArray = self.covariance
        updates: list[tuple[FloatArray, FloatArray, FloatArray]] = []
        for k in range(self.model.rows.shape[2]):
            h = self.model.rows[:, site, k]
            if not h.any():
                continue
            column = np.einsum("smn,sn->sm", covariance, h)
            factor = sign / (1.0 + sign * np.einsum("sm,sm->s", h, column))
            updates.append((column, np.einsum("sgm,sm->sg", self.model.goals, column), factor))
            outer = column[:, :, None] * column[:, None, :]
            covariance = np.asarray(covariance - factor[:, None, None] * outer, dtype=np.float64)
        return updates, covariance

    def _bring_up_to_date(self, sites: IntArray) -> None:
        old = sites[self._seen[sites] < len(self._updates)]
        if not len(old):
            return
        for first in np.unique(self._seen[old]):
            rows = old[self._seen[old] == first]
            is_all = len(rows) == self.model.n_sites
            h = self.model.rows if is_all else self.model.rows[:, rows]
            of_goals, between = self._of_goals[:, rows], self._own[:, rows]
            for update in self._updates[first:]:
                _apply(h, update, of_goals, between)
            self._of_goals[:, rows], self._own[:, rows] = of_goals, between
        self._seen[old] = len(self._updates)


def _apply(
    rows: FloatArray, update: tuple[FloatArray, FloatArray, FloatArray], of_goals: FloatArray, between: FloatArray
) -> None:
    """Update ``of_goals`` (n_s, k, b, n_g) and ``between`` (n_s, k, b, b) of ``rows`` in place."""
    column, of_column, factor = update
    n_s, k, b, m = rows.shape
    along = (rows.reshape(n_s, k * b, m) @ column[:, :, None]).reshape(n_s, k, b)
    scaled = along * factor[:, None, None]
    of_goals -= scaled[..., None] * of_column[:, None, None, :]
    between -= scaled[..., :, None] * along[..., None, :]
