"""Review of a layout: what it does not observe, which gauges matter, and which would help."""

from dataclasses import dataclass

import numpy as np

from builder.aero.surface.mesh import mesh_of
from builder.placement.design import Study
from builder.placement.flight_models import Kind, pressure_of_unknowns
from builder.placement.gaussian_model import Posterior
from builder.placement.selection import first_of_best, marginal_worth
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.flight_tables import N_STATES
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

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
    """Findings on the layout in use of a study, next to the layouts that could be placed.

    Attributes
    ----------
    kind : estimator that is judged.
    names : (k,) of its gauges.
    unobserved, off : (5,) parts of the variance of the coefficients that come from combinations of unknowns that
        the gauges do not observe, and from pressure that hardly strains any candidate [1].
    unobserved_combinations : number of combinations, mean over the states, that are not observed, of how many.
    hidden : a line for each coefficient: what its unobserved part is made of.
    worth : (k,) what the criterion rises by without each gauge, over the criterion [1].
    spare : gauges that could go together, in the order to take them off.
    best : name of the candidate that would help most, and what the criterion would fall by [1].
    """

    kind: Kind
    names: tuple[str, ...]
    unobserved: FloatArray
    off: FloatArray
    unobserved_combinations: tuple[float, int]
    hidden: tuple[str, ...]
    worth: FloatArray
    spare: tuple[str, ...]
    best: tuple[str, float]


def review_of(study: Study) -> Review:
    """Return the review of the layout in use of ``study``, its candidates being those that could be added."""
    model, layout_sites = study.model, list(study.layout_sites)
    names = study.candidates.gauges.names
    variance = model.weight @ model.goal_variance(layout_sites)
    unobserved, by_state, count = np.zeros(5), np.zeros(5), 0.0
    pressure = pressure_of_unknowns(study.parts, study.strain, study.kind)
    # An error of the flight state changes all of the pressure, most of it in ways that make no load.
    of_state = slice(0, N_STATES if study.kind == "nonlinear" else 0)
    pressure[..., of_state] = 0.0
    shapes = np.zeros((5, len(study.parts.basis.fields.T), len(model.weight)))
    for s, weight in enumerate(model.weight):
        rows = model.gauge_rows(layout_sites)[s]
        size, vector = np.linalg.eigh(rows.T @ rows)
        hidden = vector[:, size < OBSERVED**2]
        count += weight * hidden.shape[1]
        within = hidden.T @ np.linalg.solve(model.precision_with(layout_sites)[s], hidden)
        of_goals = model.goals[s] @ hidden
        unobserved += weight * np.einsum("gk,kl,gl->g", of_goals, within, of_goals)
        goals_of_state = model.goals[s][:, of_state] @ hidden[of_state]
        by_state += weight * np.einsum("gk,kl,gl->g", of_goals, within, goals_of_state)
        shapes[:, :, s] = np.sqrt(weight) * of_goals @ within @ (pressure[s] @ hidden).T
    value = model.value(layout_sites)
    gains = Posterior(model, layout_sites).gains(np.arange(study.offered))
    best = first_of_best(gains)
    return Review(
        kind=study.kind,
        names=tuple(names[gauge] for gauge in study.candidates.gauges_of(layout_sites)),
        unobserved=unobserved / variance,
        off=np.asarray(model.weight @ model.fixed) / variance,
        unobserved_combinations=(count, model.rows.shape[-1]),
        hidden=tuple(
            f"{name}: {100.0 * part:.0f} % of its variance is not observed; behind it "
            + _in_words(study, shape, part_of_state / of_all if of_all > 0.0 else 0.0)
            for name, part, shape, part_of_state, of_all in zip(
                COEFFICIENT_NAMES, unobserved / variance, shapes, by_state, unobserved, strict=True
            )
        ),
        worth=marginal_worth(model, layout_sites) / value,
        spare=tuple(names[study.candidates.sites[site][0]] for site in _spare(study, layout_sites, value)),
        best=(", ".join(names[gauge] for gauge in study.candidates.gauges_of([best])), float(gains[best]) / value),
    )


def _in_words(study: Study, shape: FloatArray, part_of_state: float) -> str:
    """Return what an unobserved variance is made of: for a part the flight state, and pressure."""
    if part_of_state >= 1.0 - SPOKEN:
        return "is the flight state within the air data"
    pressure = _pressure_in_words(study, shape)
    if part_of_state < SPOKEN:
        return pressure
    return f"is for {100.0 * part_of_state:.0f} % the flight state within the air data; the rest {pressure}"


def _pressure_in_words(study: Study, shape: FloatArray) -> str:
    """Return which pressure ``shape`` (K, n_s) is, over the states: around the body, and where along it."""
    basis, square = study.parts.basis, np.sum(shape * shape, axis=1)
    if not square.any():
        return "are errors that the gauges have in common"
    mesh = mesh_of(study.parts.structure.surface)
    x, at_node = mesh.point[:, 0], mesh.node_area * np.sum((basis.fields @ shape) ** 2, axis=1)
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
