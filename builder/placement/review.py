"""Review of a layout: what it does not observe, which load is weakest and why, which gauges matter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.aero.loads.operator import coefficient_scale
from builder.aero.surface.mesh import mesh_of
from builder.placement.design import Study
from builder.placement.flight_models import FlightParts, Kind, flight_states, pressure_of_unknowns
from builder.placement.gaussian_model import Posterior
from builder.placement.lost_gauge import LARGEST_RATIO, fault_sizes, loss_ratios
from builder.placement.selection import first_of_best, marginal_worth
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.flight_tables import MACH, U, W
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

DETECTED = 4.0
"""Standard deviations from the prediction by the other gauges at which an offset of a gauge counts as detected."""

OBSERVED = 1.0
"""Strain of a combination of unknowns in all gauges, over their noise, from which it counts as observed."""

SPARE = 0.01
"""What the criterion may rise by, in all, without the gauges that could go."""


AROUND = {
    0: "alike all round (axial load)",
    1: "on one side against the other (lateral load)",
    2: "on two opposite sides, which ovalises the wall (no load)",
}
"""Pressure by its harmonic in roll angle, with the load that it makes."""

SPOKEN = 0.15
"""Part of the square of a pressure from which a harmonic is named."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Review:
    """Findings on the layout in use of a study.

    Attributes
    ----------
    kind : estimator that is judged.
    names : (k,) of its gauges.
    sigma, prior : (5,) sigmas of the coefficients with the gauges and without any, over the flight states [1].
        Without gauges the linear estimator has the spread over the flows: least squares has no prior.
    unobserved, off : (5,) parts of the variance with the gauges that come from combinations of unknowns that they
        do not observe, and from pressure that hardly strains any gauge [1].
    blind : number of combinations, mean over the states, that are not observed, of how many.
    hidden : a line for each coefficient: the pressure that its unobserved part is made of.
    weakest : number of the coefficient with the largest sigma over prior.
    worth : (k,) what the criterion rises by without each gauge, over the criterion [1].
    spare : gauges that could go together, in the order to take them off.
    best : name of the candidate that would help most, and what the criterion would fall by [1].
    fault : (k,) offset of each gauge that the others detect, over its noise [1]: :data:`DETECTED` standard
        deviations of their prediction.
    loss : (k, 5) sigma without each gauge over the sigma with all [1].
    states : (n_s, 3) Mach number, total incidence [deg], aerodynamic roll angle [deg] of the flight states.
    state_sigma : (n_s, 5) sigmas there [1].
    """

    kind: Kind
    names: tuple[str, ...]
    sigma: FloatArray
    prior: FloatArray
    unobserved: FloatArray
    off: FloatArray
    blind: tuple[float, int]
    hidden: tuple[str, ...]
    weakest: int
    worth: FloatArray
    spare: tuple[str, ...]
    best: tuple[str, float]
    fault: FloatArray
    loss: FloatArray
    states: FloatArray | None
    state_sigma: FloatArray

    @property
    def weakest_line(self) -> str:
        """Which coefficient is weakest, and why."""
        k = self.weakest
        parts = {
            "combinations of unknowns that the gauges do not observe": self.unobserved[k],
            "pressure that hardly strains any candidate": self.off[k],
            "noise of the gauges and errors that they have in common": 1.0 - self.unobserved[k] - self.off[k],
        }
        reason = max(parts, key=lambda name: float(parts[name]))
        return (
            f"{COEFFICIENT_NAMES[k]}: sigma {1e4 * self.sigma[k]:.3g}e-4, "
            f"{self.sigma[k] / self.prior[k]:.2g} times the one without gauges; "
            f"{100.0 * parts[reason]:.0f} % of its variance is from {reason}"
        )

    @property
    def moved(self) -> FloatArray:
        """(k, 5) effect of an offset that the others just do not detect on the coefficients, over their sigmas."""
        return np.asarray(DETECTED * np.sqrt(np.maximum(self.loss**2 - 1.0, 0.0)))

    @property
    def weak_points(self) -> tuple[str, ...]:
        """Gauges whose loss raises a sigma beyond the limit, with the coefficient and by how much."""
        weak = []
        for name, ratio in zip(self.names, self.loss, strict=True):
            worst = int(np.argmax(ratio))
            if ratio[worst] > LARGEST_RATIO:
                weak.append(f"{name}: sigma of {COEFFICIENT_NAMES[worst]} rises to {ratio[worst]:.2f} times")
        return tuple(weak)


def review_of(study: Study) -> Review:
    """Return the review of the layout in use of ``study``, its candidates being those that could be added."""
    model, layout_sites = study.model, list(study.layout_sites)
    names = study.candidates.gauges.names
    variance = model.weight @ model.goal_variance(layout_sites)
    prior = np.sqrt(model.weight @ model.goal_variance([])) * study.own_sigma
    if study.kind == "linear":
        prior = _spread_of_flows(study.parts)
    unobserved, blind = np.zeros(5), 0.0
    pressure = pressure_of_unknowns(study.parts, study.strain, study.kind)
    shapes = np.zeros((5, len(study.parts.basis.fields.T), len(model.weight)))
    for s, weight in enumerate(model.weight):
        rows = model.gauge_rows(layout_sites)[s]
        size, vector = np.linalg.eigh(rows.T @ rows)
        hidden = vector[:, size < OBSERVED**2]
        blind += weight * hidden.shape[1]
        within = hidden.T @ np.linalg.solve(model.precision_with(layout_sites)[s], hidden)
        of_goals = model.goals[s] @ hidden
        unobserved += weight * np.einsum("gk,kl,gl->g", of_goals, within, of_goals)
        shapes[:, :, s] = np.sqrt(weight) * of_goals @ within @ (pressure[s] @ hidden).T
    value = model.value(layout_sites)
    gains = Posterior(model, layout_sites).gains(np.arange(study.offered))
    best = first_of_best(gains)
    states = flight_states(study.parts) if study.kind == "nonlinear" else None
    if states is not None:
        u, w = states[:, U], states[:, W]
        states = np.column_stack(
            [states[:, MACH], np.degrees(np.hypot(u, w)), np.degrees(np.arctan2(w, u)) % 360.0]
        )
    return Review(
        kind=study.kind,
        names=tuple(names[gauge] for gauge in study.candidates.gauges_of(layout_sites)),
        sigma=study.own_sigma,
        prior=prior,
        unobserved=unobserved / variance,
        off=np.asarray(model.weight @ model.fixed) / variance,
        blind=(blind, model.rows.shape[-1]),
        hidden=tuple(
            f"{name}: {100.0 * part:.0f} % of its variance is not observed; behind it {_in_words(study, shape)}"
            for name, part, shape in zip(COEFFICIENT_NAMES, unobserved / variance, shapes, strict=True)
        ),
        weakest=int(np.argmax(study.own_sigma / prior)),
        worth=marginal_worth(model, layout_sites) / value,
        spare=tuple(names[study.candidates.sites[site][0]] for site in _spare(study, layout_sites, value)),
        best=(", ".join(names[gauge] for gauge in study.candidates.gauges_of([best])), float(gains[best]) / value),
        fault=DETECTED * fault_sizes(model, layout_sites),
        loss=loss_ratios(model, layout_sites),
        states=states,
        state_sigma=np.sqrt(model.goal_variance(layout_sites)) * study.own_sigma,
    )


def _spread_of_flows(parts: FlightParts) -> FloatArray:
    """Return (5,) standard deviation of the coefficients over the flows [1]."""
    ensemble, weight = parts.ensemble, parts.ensemble.member_weight
    scale = coefficient_scale(ensemble.nominal_dynamic_pressure, parts.vehicle.reference_quantities())
    value = ensemble.responses(parts.loads) * scale
    return np.asarray(np.sqrt(weight @ (value - weight @ value) ** 2))


def _in_words(study: Study, shape: FloatArray) -> str:
    """Return which pressure ``shape`` (K, n_s) is, over the states: around the body, and where along it."""
    basis, square = study.parts.basis, np.sum(shape * shape, axis=1)
    if not square.any():
        return "are errors that the gauges have in common"
    x = mesh_of(study.parts.structure.surface).point[:, 0]
    at_node = np.sum((basis.fields @ shape) ** 2, axis=1)
    order = np.argsort(x, kind="stable")
    reached = np.cumsum(at_node[order]) / at_node.sum()
    first, last = (x[order[np.searchsorted(reached, part)]] for part in (0.1, 0.9))
    along = f"from x = {first:.2f} to {last:.2f} m"
    if basis.harmonic is None:
        return f"is pressure {along}"
    energy = np.bincount(basis.harmonic, square / square.sum())
    largest = [m for m in np.argsort(-energy, kind="stable").tolist() if energy[m] >= SPOKEN]
    words = (f"{100.0 * energy[m]:.0f} % {AROUND.get(m, f'in {m} waves around')}" for m in largest)
    return f"is pressure {along}, {', '.join(words)}"


def _spare(study: Study, layout_sites: list[int], value: float) -> list[int]:
    """Return the sites that can go one after another before the criterion has risen by :data:`SPARE`."""
    remaining, gone = list(layout_sites), list[int]()
    while len(remaining) > 1:
        rise = marginal_worth(study.model, remaining)
        least = int(np.argmin(rise))
        without = remaining[:least] + remaining[least + 1 :]
        if study.model.value(without) > (1.0 + SPARE) * value:
            break
        gone.append(remaining[least])
        remaining = without
    return gone
