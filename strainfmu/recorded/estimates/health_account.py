"""Account of the health of many samples: how many were not OK, by cause, and which gauge was to blame."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from strainfmu.arrays import BoolArray, IntArray
from strainfmu.cosim.estimators.step import health_name
from strainfmu.estimator.health import HealthState
from strainfmu.interface.enumerations import HEALTH_ITEMS
from strainfmu.recorded.estimates.block_estimates import BlockEstimates

_MISSING = (HealthState.DEGRADED, HealthState.UNIDENTIFIED, HealthState.INVALID)
_MISFIT = (HealthState.INCONSISTENT, HealthState.SUSPECT)


@dataclass(kw_only=True)
class HealthAccount:
    """Numbers of samples by state of health.

    Attributes
    ----------
    samples : number of samples by state.
    blamed : by state, in how many of its samples a gauge was to blame: it was missing where gauges are missing,
        and a suspect, or else the one of the largest residual, where the strains do not fit; of INCONSISTENT,
        first an input that contradicts the loads. Of OUTSIDE, a flow
        parameter of the flow that left its range; of DEGRADED, a quantity of navigation that is left out, too.
    beyond : number of samples OUTSIDE because of the estimated coefficients; None where that is not known.
    """

    samples: Counter[str] = field(default_factory=Counter)
    blamed: dict[str, Counter[str]] = field(default_factory=dict)
    beyond: int | None = None

    def add(
        self,
        found: BlockEstimates,
        gauge_names: Sequence[str],
        envelope_score_limit: float,
        dropped: Mapping[str, BoolArray],
    ) -> None:
        """Count the samples of a block; ``dropped`` is navigation that is left out, by
        :func:`~strainfmu.recorded.estimates.block_estimates.dropped_navigation`."""
        for state in np.unique(found.health[np.isfinite(found.health)]):
            rows = np.flatnonzero(found.health == state)
            name = health_name(int(state))
            self.samples[name] += len(rows)
            counts = np.zeros(len(gauge_names), dtype=int)
            if state in _MISSING:
                missing = ~found.valid[rows]
                counts += missing[~missing.all(axis=1)].sum(
                    axis=0
                )  # where all are missing, none of them is to blame
            elif state in _MISFIT:
                for row in rows.tolist():
                    counts[list(_misfits(found, row))] += 1
            elif state == HealthState.OUTSIDE and np.isfinite(envelope_score_limit):
                beyond = int((found.envelope_score[rows] > envelope_score_limit).sum())
                self.beyond = beyond + (self.beyond or 0)
            blamed = {gauge: int(k) for gauge, k in zip(gauge_names, counts, strict=True) if k}
            if state == HealthState.INCONSISTENT:
                blamed = _counted(found.contradicted, rows) | blamed
            if state == HealthState.DEGRADED:
                blamed |= _counted(dropped, rows)
            if state == HealthState.OUTSIDE:
                blamed = _counted(found.outside, rows)
            self.blamed.setdefault(name, Counter()).update(blamed)

    def lines(self) -> list[str]:
        """Return a line for each state other than OK, the most frequent first."""
        total = sum(self.samples.values())
        texts = {state.name: text for state, text in HEALTH_ITEMS}
        lines = []
        for name, number in self.samples.most_common():
            if name == HealthState.OK.name:
                continue
            text = f"{name}: {number} of {total} samples ({100.0 * number / total:.3g} %)"
            if name in texts:
                text += f": {texts[name][0].lower()}{texts[name][1:]}"
            if name == HealthState.OUTSIDE.name and self.beyond is not None:
                by_flow = number - self.beyond
                text += f"; by the estimated coefficients in {self.beyond}, by the flow alone in {by_flow}"
            worst = next(iter(self.blamed[name].most_common(1)), None)
            if worst is not None:
                text += f"; most often to blame: '{worst[0]}' (in {worst[1]})"
            lines.append(text)
        return lines


def _counted(inputs: Mapping[str, BoolArray], rows: IntArray) -> dict[str, int]:
    """Return in how many of the ``rows`` each input is to blame, where in any."""
    return {name: int(k) for name, blamed in inputs.items() if (k := blamed[rows].sum())}


def _misfits(found: BlockEstimates, row: int) -> tuple[int, ...]:
    """Return the gauges that do not fit in a sample, by index; none if nothing shows them."""
    worst = int(found.worst[row])
    return found.suspects[row] or ((worst,) if worst >= 0 else ())
