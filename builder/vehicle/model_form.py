"""Model-form error: what the equations of the flow leave out, such as viscosity, real gas and leeward separation.

No campaign of one flow model says how large it is. So it has an entry of its own, ``map.model_form_percent``,
apart from the numerical error, which the campaign itself shows (interpolation, grid of the flow).
"""

from dataclasses import dataclass

from builder.vehicle.map_options import MapEntry, Noise

MODEL_FORM_PERCENT = 10.0
"""Default of the entry, which the factors below belong to."""

OF_DYNAMIC_PRESSURE, OF_AMBIENT = 8e-4, 0.02
"""Size of the Gaussian process at that default: part of q_inf, and of p_inf at most.

Errors of a flow go with its dynamic pressure. A process of more than the second explains away what distinguishes
another flow.
"""

SPREAD_OF_SNAPSHOTS = 0.3
"""Fraction of the snapshots' spread over ``model_form_percent``.

The spread is the same at every incidence, while every flow model gives a symmetric flow at zero incidence. There
a larger part gives the lateral loads errors that no flow has. The difference of flow models grows with incidence.
"""

LEEWARD = 2.5
"""Fraction of the leeward difference over ``model_form_percent``."""


@dataclass(frozen=True, kw_only=True)
class ModelForm:
    """Sizes of the model-form error, one standard deviation each [1].

    Attributes
    ----------
    of_prior : of the difference of the snapshots from their mean.
    of_overpressure : of the overpressure without incidence.
    of_leeward : of the difference between two leeward sides of newtonian flow.
    of_newtonian : of the difference between newtonian flow and the snapshots.
    process : of the Gaussian process over p_inf; None where it follows q_inf.
    scale : of the process that follows q_inf, over its default.
    """

    of_prior: float
    of_overpressure: float
    of_leeward: float
    of_newtonian: float
    process: float | None
    scale: float

    def process_at(self, dynamic_pressure: float) -> float:
        """Return the standard deviation of the process over p_inf, at a mean ``dynamic_pressure`` over p_inf."""
        if self.process is not None:
            return self.process
        return self.scale * min(OF_DYNAMIC_PRESSURE * dynamic_pressure, OF_AMBIENT)


def model_form(entry: MapEntry, noise: Noise) -> ModelForm:
    """Return the sizes by the sections [map] and [noise]: those stated, the others by ``model_form_percent``.

    With ``noise.model`` "paper" what is not stated is 0.
    """
    percent = model_form_percent(entry, noise)

    def size(stated: float | None, factor: float = 1.0) -> float:
        return 0.01 * (factor * percent if stated is None else stated)

    process = entry.discrepancy_percent
    return ModelForm(
        of_prior=size(entry.discrepancy_of_prior_percent, SPREAD_OF_SNAPSHOTS),
        of_overpressure=size(entry.discrepancy_of_overpressure_percent),
        of_leeward=min(1.0, size(entry.discrepancy_of_leeward_percent, LEEWARD)),
        of_newtonian=size(entry.discrepancy_of_newtonian_percent),
        process=None if process is None else 0.01 * process,
        scale=percent / MODEL_FORM_PERCENT,
    )


def model_form_percent(entry: MapEntry, noise: Noise) -> float:
    """Return the entry, 0 with ``noise.model`` "paper"."""
    return 0.0 if noise.model == "paper" else entry.model_form_percent
