"""What a choice of sites must keep: cost and budget, sites that exclude each other, sites that are forced."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

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
