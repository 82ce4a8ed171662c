"""Estimates of the nonlinear estimator: loads as of every estimator, with air data and the flight state."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.air_data import AirData
from strainfmu.estimator.estimates.load_estimate import LoadEstimate, LoadEstimates
from strainfmu.estimator.estimates.pressure_field import FieldInputs, PressureField


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class FlightEstimate(LoadEstimate):
    """The estimate of one sample, with the flight state that it follows from.

    Attributes
    ----------
    air_data : angle of attack, sideslip, total incidence, aerodynamic roll angle, Mach number, p_inf and q_inf,
        with standard deviations, see :class:`~strainfmu.estimator.air_data.AirData`.
    state, state_covariance : (4,), (4, 4) flight state (M, u, w, ln p_inf).
    navigation_residual : (3,) standardised difference of each of ``NAVIGATION`` from all else; 0 if not known.
    navigation_used : (3,) which of them were used: those that are known and not dropped as inconsistent; none
        without a gauge.
    shape_residual : (n_s,) standardised sizes of the shapes of pressure off the tables that the map tests, each
        what those before it leave.
    fits : whether strain and navigation fit the tables.
    is_linear : whether loads and coefficients are those of the linear map, because strain does not fit the tables.
    """

    air_data: AirData
    state: FloatArray
    state_covariance: FloatArray
    navigation_residual: FloatArray
    navigation_used: BoolArray
    shape_residual: FloatArray
    fits: bool
    is_linear: bool

    @property
    def air_data_used(self) -> BoolArray:
        """(3,) :attr:`navigation_used`, by the name of :class:`~strainfmu.estimator.estimate.Estimate`."""
        return self.navigation_used

    def pressure(self, with_std: bool = True) -> PressureField:
        """Return absolute pressure and standard deviation at every node of the map's surface, off the deadline.

        Of strain that does not fit the tables it is the linear map's, over p_inf of navigation, or of the flight
        state where navigation has none. ``with_std`` false leaves the standard deviation NaN, at a fraction of the
        cost.

        Raises
        ------
        InputError
            The map holds no pressure field.
        """
        from strainfmu.estimator.estimates.flight_pressure import pressure_of

        return pressure_of(self, with_std)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class FlightEstimates(LoadEstimates):
    """The estimates of k samples; row i of every array is the :class:`FlightEstimate` of sample i."""

    air_data: AirData
    state: FloatArray
    state_covariance: FloatArray
    navigation_residual: FloatArray
    navigation_used: BoolArray
    shape_residual: FloatArray
    fits: BoolArray
    is_linear: BoolArray

    def __getitem__(self, sample: int) -> FlightEstimate:
        """Return the estimate of one sample."""
        of_loads = super().__getitem__(sample)
        return FlightEstimate(
            **{entry.name: getattr(of_loads, entry.name) for entry in fields(LoadEstimate)},
            air_data=self.air_data.of_sample(sample),
            state=self.state[sample],
            state_covariance=self.state_covariance[sample],
            navigation_residual=self.navigation_residual[sample],
            navigation_used=self.navigation_used[sample],
            shape_residual=self.shape_residual[sample],
            fits=bool(self.fits[sample]),
            is_linear=bool(self.is_linear[sample]),
        )


def joined(blocks: list[FlightEstimates]) -> FlightEstimates:
    """Return the estimates of all ``blocks``, one after another."""
    if len(blocks) == 1:
        return blocks[0]
    parts: dict[str, Any] = {}
    for entry in fields(FlightEstimates):
        values = [getattr(block, entry.name) for block in blocks]
        if entry.name == "field_inputs":
            parts[entry.name] = _joined_inputs(values)
        elif entry.name == "section_station":
            parts[entry.name] = values[0]
        elif entry.name == "air_data":
            parts[entry.name] = AirData(
                **{
                    one.name: np.concatenate([getattr(value, one.name) for value in values])
                    for one in fields(AirData)
                }
            )
        else:
            parts[entry.name] = np.concatenate(values)
    return FlightEstimates(**parts)


def _joined_inputs(blocks: list[FieldInputs | None]) -> FieldInputs | None:
    held = [block for block in blocks if block is not None]
    if not held:
        return None
    arrays: dict[str, Any] = {
        entry.name: np.concatenate([getattr(one, entry.name) for one in held])
        for entry in fields(FieldInputs)
        if entry.name != "inverse_map"
    }
    return replace(held[0], **arrays)
