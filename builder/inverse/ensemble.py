"""The pressure fields that a map is built on: snapshots at one pressure level, at every roll angle they are valid
at.

Surface pressure over p_inf depends on Mach number and incidence alone. In form "dynamic_pressure" every snapshot
is taken to the nominal dynamic pressure; with the internal pressure ambient, it is p - p_inf that scales. A flow
round a body of revolution is valid at every roll angle, and its mirror image is one of these. The members of a
rolled ensemble are the distinct flows at some 24 roll angles; means and modes are taken over all roll angles.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from builder.aero.load_operator import coefficient_scale
from builder.campaign.snapshots import Snapshots
from builder.vehicle.file import Vehicle
from builder.vehicle.flight_conditions import flow_key
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import ComplexArray, FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition
from strainfmu.linear.pressure_modes import PressureModes, signs

ROLLS = 24
"""Roll angles at least at which strain and coefficients of a rolled ensemble are taken; the angles of the nodes
if fewer."""

MIN_ROLLS = 12
"""Fewer roll angles than this, 30 degrees apart, leave gaps in the disc of total incidence."""

ROWS_AT_ONCE = 64
"""Rows of an operator, or gauges, whose response stays in the cache."""

_NO_HARMONIC = 1e-15
"""Part of the largest harmonic of an operator below which one is rounding."""

_NEGLIGIBLE = 3e-4
"""Standard deviation, relative to the largest, below which a mode is left out: together 1e-5 of the variance."""


_SAME = 1e-9
"""Relative difference of standard deviations up to which modes count as a pair."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Ensemble:
    """N flows on n_p nodes.

    Attributes
    ----------
    pressure : (N, n_p) pressure of the flows less what of the internal pressure scales with it [Pa].
    fixed_pressure : internal pressure that does not scale and is not taken off ``pressure`` [Pa].
    conditions : N flight conditions.
    scale : (N, 5) coefficient per load of ``pressure`` less ``fixed_pressure``, at the references of the vehicle.
    fixed_scale : (N, 5) coefficient per load of ``fixed_pressure`` at each flow's own dynamic pressure.
    ambient_pressure : (N,) p_inf at the level of ``pressure`` [Pa].
    nominal_dynamic_pressure : q_inf of that level; in form "absolute" the mean of the snapshots [Pa].
    grid : nodes that the flows are rolled on; None where they stay as listed.
    """

    pressure: FloatArray
    fixed_pressure: float
    conditions: tuple[FlightCondition, ...]
    scale: FloatArray
    fixed_scale: FloatArray
    ambient_pressure: FloatArray
    nominal_dynamic_pressure: float
    grid: SurfaceGrid | None

    @cached_property
    def rolls(self) -> int:
        """Number of roll angles that members are taken at; 1 as listed."""
        return 1 if self.grid is None else rolls_of(self.grid.n_roll)

    @property
    def mean_ambient_pressure(self) -> float:
        """Mean p_inf of the flows at the level of ``pressure`` [Pa]."""
        return float(np.average(self.ambient_pressure, weights=self.weight))

    @cached_property
    def weight(self) -> FloatArray:
        """(N,) roll angles that a flow stands for: 1 where the wind is along the axis."""
        if self.grid is None:
            return np.ones(len(self.conditions))
        inclined = np.array([condition.total_incidence > 1e-9 for condition in self.conditions])
        return np.where(inclined, float(self.rolls), 1.0)

    @cached_property
    def member_weight(self) -> FloatArray:
        """(n,) weight of each member in a mean over all of them; adds up to 1."""
        if self.grid is None:
            return np.full(len(self.conditions), 1.0 / len(self.conditions))
        share = self.weight / self.rolls
        return np.tile(share, self.rolls) / (self.rolls * share.sum())

    def members(self) -> Iterator[FloatArray]:
        """Return the members' pressure in blocks (N, n_p) [Pa], as ``pressure``: one block, or one per roll
        angle."""
        if self.grid is None:
            yield self.pressure
            return
        n_roll = self.grid.n_roll
        rings = self.pressure.reshape(len(self.pressure), -1, n_roll)
        for roll in range(self.rolls):
            yield np.roll(rings, roll * n_roll // self.rolls, axis=2).reshape(self.pressure.shape)

    def responses(self, operator: FloatArray) -> FloatArray:
        """Return (n, m) ``operator`` (m, n_p) times the pressure less ``fixed_pressure`` of every member."""
        if self.grid is None:
            return self.pressure @ operator.T - self.fixed_pressure * operator.sum(axis=1)
        responses = np.empty((len(self.member_weight), len(operator)))
        for first in range(0, len(operator), ROWS_AT_ONCE):
            some = slice(first, first + ROWS_AT_ONCE)
            rings = operator[some].reshape(-1, len(self.grid.x), self.grid.n_roll)
            spectrum = np.moveaxis(np.fft.rfft(rings, axis=2), 2, 0)  # n_m, some, n_x
            largest = np.abs(spectrum).max(axis=(1, 2))
            n_m = 1 + np.flatnonzero(largest >= _NO_HARMONIC * largest.max())[-1]
            amplitudes = np.conj(spectrum[:n_m]) @ self.harmonics[:n_m].transpose(0, 2, 1)
            responses[:, some] = self.of_amplitudes(amplitudes.transpose(1, 2, 0))
        return responses

    def of_amplitudes(self, amplitudes: ComplexArray) -> FloatArray:
        """Return (n, m) the responses of the members of a rolled ensemble, whose flows have ``amplitudes``.

        These (m, N, n_m) are sums over the stations of :attr:`harmonics` times the conjugate harmonics of
        an operator. To roll a flow turns the phase of each.
        """
        assert self.grid is not None
        n_roll, m = self.grid.n_roll, np.arange(amplitudes.shape[2])
        weight = np.where((m == 0) | (2 * m == n_roll), 1.0, 2.0) / n_roll
        phase = 2.0 * np.pi * np.outer(np.arange(self.rolls) * (n_roll // self.rolls), m) / n_roll
        turns = np.hstack([weight * np.cos(phase), weight * np.sin(phase)])
        by_harmonic = amplitudes.transpose(2, 1, 0)
        parts = np.concatenate([by_harmonic.real, by_harmonic.imag])
        return (turns @ parts.reshape(len(parts), -1)).reshape(-1, len(amplitudes))

    @cached_property
    def harmonics(self) -> ComplexArray:
        """(n_m, N, n_x) the flows' harmonics round the body, of the pressure less ``fixed_pressure`` [Pa]."""
        assert self.grid is not None
        rings = (self.pressure - self.fixed_pressure).reshape(len(self.pressure), -1, self.grid.n_roll)
        return np.ascontiguousarray(np.moveaxis(np.fft.rfft(rings, axis=2), 2, 0))

    def columns_by_harmonic(self, responses: FloatArray) -> list[FloatArray]:
        """Return blocks of columns (m, k), whose covariances add up to the mean one of ``responses`` (n, m).

        As listed they are the responses themselves. Over the roll angles of a flow, harmonics do not correlate:
        each is a block, of its real and its imaginary part (Parseval), and of few significant columns.
        """
        if self.grid is None:
            return [(responses * np.sqrt(self.member_weight)[:, None]).T]
        n = len(self.pressure)
        root = np.sqrt(self.rolls * self.member_weight[:n])[:, None]
        spectrum = np.fft.rfft(responses.reshape(self.rolls, n, -1), axis=0, norm="forward")
        blocks = []
        for harmonic, of_flow in enumerate(spectrum * root):
            alone = 2 * harmonic in (0, self.rolls)
            parts = [of_flow.real] if alone else [np.sqrt(2.0) * of_flow.real, np.sqrt(2.0) * of_flow.imag]
            blocks.append(np.concatenate(parts).T)
        return blocks

    def coefficients(self, loads: FloatArray) -> FloatArray:
        """Return (n, 5) coefficients of every member; ``loads`` is the load operator (5, n_p)."""
        fixed = self.fixed_pressure * self.fixed_scale * loads.sum(axis=1)
        return np.concatenate([block @ loads.T * self.scale - fixed for block in self.members()])

    def mean(self) -> FloatArray:
        """Return the mean pressure (n_p,) over all roll angles [Pa]."""
        mean = self.weight @ self.pressure / self.weight.sum()
        if self.grid is None:
            return np.asarray(mean)
        return np.repeat(mean.reshape(-1, self.grid.n_roll).mean(axis=1), self.grid.n_roll)


def rolls_of(n_roll: int) -> int:
    """Return the smallest divisor of ``n_roll`` from :data:`ROLLS` on, ``n_roll`` itself if that is smaller."""
    return next((count for count in range(ROLLS, n_roll + 1) if n_roll % count == 0), n_roll)


def ensemble_of(vehicle: Vehicle, snapshots: Snapshots) -> Ensemble:
    """Return the pressure fields of ``snapshots`` as the sections [map] and [structure] want them used.

    Raises
    ------
    InputError
        In form "absolute", the snapshots' altitudes differ and so does the pressure inside.
    """
    entry, conditions = vehicle.map, snapshots.conditions()
    grid, rows = None, np.arange(len(conditions))
    if entry.symmetry == "full" and snapshots.grid is not None and rolls_of(snapshots.grid.n_roll) >= MIN_ROLLS:
        grid = snapshots.grid
        rows = _distinct_flows(conditions, entry.form == "absolute")
    chosen = tuple(conditions[row] for row in rows)
    pressure = snapshots.pressure[rows]
    dynamic = np.array([condition.dynamic_pressure for condition in chosen])
    ambient = np.array([condition.ambient_pressure for condition in chosen])
    inside = vehicle.structure.internal_pressure_Pa
    nominal = float(np.mean([condition.dynamic_pressure for condition in conditions]))
    ratio = np.ones(len(rows))
    if entry.form == "absolute":
        fixed = _one_internal_pressure(vehicle.structure.internal_pressure(conditions).tolist())
    else:
        ratio = nominal / dynamic
        pressure = ratio[:, None] * (pressure - ambient[:, None] if inside == "ambient" else pressure)
        fixed = 0.0 if inside == "ambient" else float(inside)
    reference = vehicle.reference_quantities()
    scales = np.array([coefficient_scale(value, reference) for value in dynamic])
    return Ensemble(
        pressure=pressure,
        fixed_pressure=fixed,
        conditions=chosen,
        scale=scales / ratio[:, None],
        fixed_scale=scales,
        ambient_pressure=ratio * ambient,
        nominal_dynamic_pressure=nominal,
        grid=grid,
    )


def rolled_modes(ensemble: Ensemble, weights: FloatArray | None) -> PressureModes:
    """Return the POD of a rolled ensemble over all roll angles.

    Averaged over the roll angle, harmonics of the pressure are independent of each other, and of each the two
    phases have the same variance. So every harmonic is decomposed on its own: its modes are a shape along x times
    the cosine and the sine of m phi.

    Parameters
    ----------
    ensemble : the flows, with a grid.
    weights : (n_p,) of the inner product, the same round a ring; None for the Euclidean one.

    Raises
    ------
    InputError
        Fewer than two flows.
    """
    grid = ensemble.grid
    assert grid is not None
    if len(ensemble.pressure) < 2:
        raise InputError(f"{len(ensemble.pressure)} flow found, at least 2 are needed")
    n_roll, n, mean = grid.n_roll, len(ensemble.pressure), ensemble.mean()
    rings = (ensemble.pressure - mean).reshape(n, -1, n_roll)
    spectrum = np.fft.rfft(rings, axis=2) / n_roll
    share = np.sqrt(ensemble.weight / ensemble.weight.sum())[:, None]
    of_ring = np.ones(rings.shape[1]) if weights is None else weights.reshape(-1, n_roll)[:, 0]
    root, roll_angle = np.sqrt(of_ring)[:, None], grid.roll_angle
    shapes, deviations = [], []
    parts = [
        np.linalg.svd(root * (share * of_m).T, full_matrices=False)[:2] for of_m in np.moveaxis(spectrum, 2, 0)
    ]
    # A mode's deviation is in proportion to its singular value: what is far below the limit is not expanded.
    least = 0.5 * _NEGLIGIBLE * max(float(deviation[0]) for _, deviation in parts)
    for m, (vectors, deviation) in enumerate(parts):
        phases = np.exp(1j * m * roll_angle)
        alone = m == 0 or 2 * m == n_roll
        for shape, std in zip(vectors.T[deviation > least], deviation[deviation > least], strict=True):
            field = (shape / root[:, 0])[:, None] * phases
            # p = 2 Re(c e^(i m phi)); the real and the imaginary part of c each have half of its variance.
            for part in (field.real,) if alone else (field.real, field.imag):
                size = np.sqrt(np.sum(of_ring[:, None] * part**2))
                if size > 0.0:
                    shapes.append((part / size).ravel())
                    deviations.append(std * size * (1.0 if alone else np.sqrt(2.0)))
    order = np.argsort(-np.array(deviations), kind="stable")
    std = np.array(deviations)[order]
    significant = order[std > _NEGLIGIBLE * std[0]]
    modes = np.array(shapes)[significant].T
    return PressureModes(
        mean=mean,
        modes=modes * signs(modes),
        singular_values=np.array(deviations)[significant] * np.sqrt(n - 1),
        n_snapshots=n,
        weights=weights,
    )


def turned_to_gauges(modes: PressureModes, whitened_strain: FloatArray) -> PressureModes:
    """Return the modes of a rolled ensemble, each pair turned so that the gauges observe its first mode best.

    The two phases of a harmonic have the same variance, so the POD leaves their common roll angle open. Gauges
    often observe one phase alone, such as cos(2 phi) with four rows. At any other roll angle both modes would have
    its strain, and the one that becomes a state would stand for pressure that it does not hold.

    Parameters
    ----------
    whitened_strain : (n_d, k) L^-1 Z_p V of the modes V [1/Pa], with the root L of the gauges' noise.
    """
    std, turned, first = modes.coefficient_std, modes.modes.copy(), 0
    while first < len(std):
        last = first + int(np.sum(std[first:] >= (1.0 - _SAME) * std[first]))
        if last - first > 1:
            pair = turned[:, first:last]
            turned[:, first:last] = pair @ np.linalg.svd(whitened_strain[:, first:last], full_matrices=False)[2].T
        first = last
    return replace(modes, modes=turned * signs(turned))


def _distinct_flows(conditions: list[FlightCondition], by_altitude: bool) -> IntArray:
    """Return the first condition of each Mach number and total incidence: at every roll angle they are one flow.

    At one pressure level altitude does not matter; ``by_altitude`` distinguishes altitudes where it does.
    """
    first: dict[tuple[float, ...], int] = {}
    for row, condition in enumerate(conditions):
        key = (*flow_key(condition), condition.altitude if by_altitude else 0.0)
        first.setdefault(key, row)
    return np.array(sorted(first.values()), dtype=np.int64)


def _one_internal_pressure(inside: list[float]) -> float:
    """Return the p_internal [Pa] that all snapshots have.

    Raises
    ------
    InputError
        The snapshots' altitudes differ and so does the pressure inside.
    """
    if min(inside) != max(inside):
        raise InputError(
            f"map.form 'absolute': expected one internal pressure, got {min(inside):.6g} to {max(inside):.6g} Pa; "
            "give one altitude, structure.internal_pressure_Pa as a number, or form 'dynamic_pressure'"
        )
    return inside[0]
