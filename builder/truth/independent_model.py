"""Whether a vehicle has an independent model at all."""

from __future__ import annotations

from builder.structure.fourier.model import refuse_beyond_fourier
from builder.truth.shape.structure import refuse_without_other_model
from builder.vehicle.file import Vehicle


def refuse_without_independent_model(vehicle: Vehicle) -> None:
    """Refuse a vehicle that has no independent model, before anything is solved.

    Raises
    ------
    InputError
        Names the entry.
    """
    if vehicle.is_of_revolution:
        refuse_beyond_fourier(vehicle, [vehicle.gauges.layout])
    else:
        refuse_without_other_model(vehicle)
