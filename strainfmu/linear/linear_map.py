"""The inverse map of the paper from arrays: strain per pressure, snapshots, noise in; gains, covariances out.

A gauge reads d = Z (p - p_i) + noise, noise ~ N(0, Gamma) (Pham et al., eq. p2o). What snapshots say of the
pressure is in :mod:`strainfmu.linear.pressure_modes`, the map to its states q in
:mod:`strainfmu.linear.state_map`.

Case 2, more pressures than gauges: p = p_mean + F q, q ~ N(0, I), F of the snapshots, so that

    p = T d + k,    T = F T_q,    H^-1 = F V diag(1 / (lambda + gamma)) V^T F^T           (eq. p2o-ls-solution).

Case 1, at most as many states as gauges: p = p_mean + V_r q with r POD modes; T and k give q.

Loads are f = G (p - p_i), the first five axial, normal and side force [N], pitching and yawing moment [N m].
Strain and loads of the modes beyond r are errors with one cause, columns A_t and B_t: noise A_t A_t^T, of which
the residual reveals the loads, B_t A_t^T Gamma^-1.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import FloatArray, lower_factor
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.files import write_bytes_atomically
from strainfmu.linear.pressure_modes import PressureModes, leading_modes, prior_of_snapshots
from strainfmu.linear.regularisation import Rule, expected_data, select_gamma
from strainfmu.linear.state_map import (
    GaussianMap,
    LeastSquaresMap,
    RelativeCondition,
    check_covariance,
    gaussian_map,
    least_squares_map,
    relative_condition,
    whitened_spectrum,
)
from strainfmu.records import brief

N_LOADS = 5
"""Loads that an :class:`~strainfmu.InverseMap` has at least."""

MOST_NODES = 5000
"""Nodes up to which the posterior covariance (n_p, n_p) is formed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearMap:
    """The affine map of n_d strains d to pressure or modes, T d + k, and to n_f loads, load_gain d + load_offset.

    Made by :func:`linear_map`. Case 2 has ``pod`` None, Case 1 has gamma 0 and T, k for the r POD coefficients.

    Attributes
    ----------
    T, k : (n_p, n_d) [Pa] and (n_p,) [Pa] in Case 2, (r, n_d) [Pa] and (r,) [Pa] in Case 1.
    load_gain, load_offset : (n_f, n_d) [N, N m] and (n_f,) [N, N m]; None without loads.
    load_covariance : (n_f, n_f) of the loads' error [(N, N m)^2], Joseph's form, which holds for any gamma.
    mean_pressure : (n_p,) p_mean [Pa].
    states : the map to the states q, with their strain operator A, the mean strain m and the covariance Gamma that
        weights the data, truncated modes included.
    pod : modes of Case 1.

    Examples
    --------
    >>> import numpy as np
    >>> import strainfmu
    >>> random = np.random.default_rng(1)
    >>> Z, snapshots = 1e-9 * random.normal(size=(12, 500)), 5e3 + 100.0 * random.normal(size=(500, 40))
    >>> found = strainfmu.linear_map(Z, snapshots, noise_std=1e-7)
    >>> d = Z @ snapshots[:, 0]  # measured strain [m/m]
    >>> np.allclose(found.estimate(d), found.T @ d + found.k)
    True
    """

    T: FloatArray
    k: FloatArray
    load_gain: FloatArray | None
    load_offset: FloatArray | None
    load_covariance: FloatArray | None
    mean_pressure: FloatArray
    states: GaussianMap | LeastSquaresMap
    pod: PressureModes | None
    _fields: FloatArray  # (n_p, n_q) F, or V_r
    _noise: FloatArray  # (n_d, n_d) covariance of the gauges' noise alone
    _errors: tuple[FloatArray, FloatArray]  # (n_d, t) A_t and (n_f, t) B_t
    _load_per_state: FloatArray  # (n_f, n_q)
    _load_of_mean: FloatArray  # (n_f,)
    _largest_strain: FloatArray  # (n_d,) over the snapshots
    _load_range: FloatArray  # (n_f, 2) over the snapshots

    __repr__ = brief

    @property
    def case(self) -> int:
        """1, least squares on POD modes, or 2, the snapshots as a Gaussian prior."""
        return 2 if self.pod is None else 1

    @property
    def gamma(self) -> float:
        """Weight of the prior [1], 0 in Case 1."""
        return self.states.regularisation

    def estimate(self, d: ArrayLike) -> FloatArray:
        """Return T d + k, (.., n_p) or (.., r) [Pa], of strains ``d`` (.., n_d) [m/m].

        Raises
        ------
        InputError
            Another number of gauges, or a strain that is not finite.
        """
        strain, n_d = np.asarray(d, dtype=float), len(self.states.mean_strain)
        if strain.ndim == 0 or strain.shape[-1] != n_d:
            raise InputError(f"d: expected {n_d} gauges in the last axis, got shape {strain.shape}")
        if not np.isfinite(strain).all():
            raise InputError("d: expected finite strains; an Estimator of to_map(..) takes lost gauges as NaN")
        return np.asarray(strain @ self.T.T + self.k)

    @cached_property
    def posterior_factor(self) -> FloatArray:
        """R with H^-1 = R R^T: (n_p, N) [Pa] of the pressure in Case 2, (r, r) [Pa] of the modes in Case 1."""
        if isinstance(self.states, LeastSquaresMap):
            return self.states.covariance_factor
        return self._fields @ self.states.inverse_hessian_factor()

    @property
    def posterior_covariance(self) -> FloatArray:
        """H^-1 [Pa^2], (n_p, n_p) in Case 2, (r, r) in Case 1: the covariance of the error where gamma is 1 or 0.

        Raises
        ------
        InputError
            There are too many nodes to form it.
        """
        n = len(self.k)
        if n > MOST_NODES:
            raise InputError(
                f"posterior_covariance: {n} x {n} numbers, at most {MOST_NODES} nodes; "
                "use posterior_factor R, H^-1 = R R'"
            )
        return np.asarray(self.posterior_factor @ self.posterior_factor.T)

    @property
    def eigenvalues(self) -> FloatArray:
        """(k,) lambda [1], falling, of the prior-preconditioned Hessian Gamma_pr Z^T Gamma^-1 Z (eq. eigproblem).

        Raises
        ------
        InputError
            The map is of Case 1.
        """
        return self._case_2("eigenvalues").spectrum.eigenvalues

    @cached_property
    def eigenvectors(self) -> FloatArray:
        """(n_p, k) b_k [Pa] of these eigenvalues, of unit size under the prior (b^T Gamma_pr^+ b = 1)."""
        spectrum = self._case_2("eigenvectors").spectrum
        return self._fields @ spectrum.right_vectors[:, : len(spectrum.singular_values)]

    def recoverable(self, gamma: float | None = None) -> int:
        """Return how many modes have lambda >= ``gamma``, of which data outweigh the prior; None for the map's."""
        eigenvalues = self._case_2("recoverable").spectrum.eigenvalues
        return int(np.sum(eigenvalues >= (self.gamma if gamma is None else gamma)))

    def _case_2(self, name: str) -> GaussianMap:
        if isinstance(self.states, LeastSquaresMap):
            raise InputError(f"{name}: expected a map of Case 2 (modes=None), got Case 1")
        return self.states

    @property
    def condition_number(self) -> float:
        """kappa of the whitened A, its columns scaled by the states' spread; of Case 1 [1]."""
        return self._case_1("condition_number").condition_number

    def relative_condition(
        self, strain_norm: float, state_norm: float, state_scale: float = 1.0
    ) -> RelativeCondition:
        """Return K = |d| / (sigma_min(A) |q|) of a map of Case 1; it depends on the units of d and q.

        Parameters
        ----------
        strain_norm : |d| [m/m]; the published numbers have 100e-6 sqrt(n_d).
        state_norm : |q| in multiples of ``state_scale``.
        state_scale : unit of the states [Pa]; the published numbers follow with |q| = 1 in units of the root mean
            square of |q| over the snapshots, ``np.linalg.norm(found.pod.coefficient_std)``.

        Raises
        ------
        InputError
            A norm or the scale is not positive, the gauges do not observe every mode, or the map is of Case 2.
        """
        operator = self._case_1("relative_condition").state_operator
        return relative_condition(operator, strain_norm, state_norm, state_scale)

    def _case_1(self, name: str) -> LeastSquaresMap:
        if isinstance(self.states, GaussianMap):
            raise InputError(
                f"{name}: expected a map of Case 1 (modes=r), got Case 2; eigenvalues say what it sees"
            )
        return self.states

    def to_map(
        self,
        *,
        reference_area: float,
        reference_length: float,
        dynamic_pressure: float,
        gauge_names: Sequence[str] | None = None,
        gauge_position: ArrayLike | None = None,
        gauge_direction: ArrayLike | None = None,
        vehicle: str = "from arrays",
    ) -> InverseMap:
        """Return an :class:`~strainfmu.InverseMap` for estimators, FMUs, recordings and the bus.

        Its loads are load_gain d + load_offset. The map holds for the pressure level of its snapshots (form
        "absolute").

        Parameters
        ----------
        reference_area, reference_length : S [m2] and L [m] of the coefficients.
        dynamic_pressure : mean q_inf of the snapshots [Pa].
        gauge_names : n_d unique names; G1, G2, .. by default.
        gauge_position, gauge_direction : (n_d, 3) [m] and unit vectors, for reports; the origin and the x axis
            where they are not known.
        vehicle : name of the vehicle.

        Raises
        ------
        InputError
            The map has no loads, or a number or shape is wrong.
        """
        states, n_d = self.states, len(self.states.mean_strain)
        if self.load_gain is None or len(self.load_gain) < N_LOADS:
            got = "none" if self.load_gain is None else str(len(self.load_gain))
            raise InputError(f"to_map: expected linear_map(.., loads=G) with {N_LOADS} loads at least, got {got}")
        for name, value in (
            ("reference_area", reference_area),
            ("reference_length", reference_length),
            (DYNAMIC_PRESSURE, dynamic_pressure),
        ):
            if not 0.0 < value < np.inf:
                raise InputError(f"{name}: expected a positive number, got {value}")
        five = slice(N_LOADS)
        scale = dynamic_pressure * reference_area * np.array([1.0, 1.0, 1.0, reference_length, reference_length])
        ahead = np.tile([1.0, 0.0, 0.0], (n_d, 1))
        return InverseMap(
            vehicle=vehicle,
            case=self.case,
            gauge_names=tuple(gauge_names or (f"G{i + 1}" for i in range(n_d))),
            gauge_position=np.zeros((n_d, 3)) if gauge_position is None else np.asarray(gauge_position, float),
            gauge_direction=ahead if gauge_direction is None else np.asarray(gauge_direction, float),
            noise_std=np.sqrt(np.diag(self._noise)),
            state_operator=states.state_operator,
            gauge_covariance=self._noise,
            error_strain=self._errors[0],
            error_load=self._errors[1][five],
            regularisation=self.gamma,
            load_per_state=self._load_per_state[five],
            load_of_mean=self._load_of_mean[five],
            mean_strain=states.mean_strain,
            strain_range=self._largest_strain,
            coefficient_range=self._load_range[five] / scale[:, None],
            reference_area=reference_area,
            reference_length=reference_length,
            nominal_dynamic_pressure=dynamic_pressure,
            provenance={
                "made_by": "strainfmu.linear_map",
                "gamma": self.gamma,
                "modes": self._load_per_state.shape[1],
            },
        )

    def save_npz(self, path: str | PathLike[str]) -> None:
        """Write T, k, mean_pressure, mean_strain, noise_covariance, gamma and, with loads, their gain, offset and
        covariance as a NumPy archive, for other programs.

        Raises
        ------
        StrainfmuError
            The file cannot be written; what was there before is untouched.
        """
        of_loads = () if self.load_gain is None else ("load_gain", "load_offset", "load_covariance")
        content = {name: getattr(self, name) for name in ("T", "k", "gamma", "mean_pressure", *of_loads)}
        content |= {name: getattr(self.states, name) for name in ("mean_strain", "noise_covariance")}
        stream = BytesIO()
        np.savez_compressed(stream, **content)
        write_bytes_atomically(path, stream.getvalue())


def linear_map(
    Z: Any,
    snapshots: ArrayLike,
    noise_std: ArrayLike | None = None,
    *,
    noise_covariance: ArrayLike | None = None,
    loads: ArrayLike | None = None,
    modes: int | None = None,
    gamma: float | Rule | None = None,
    weights: ArrayLike | None = None,
    internal_pressure: ArrayLike = 0.0,
    truncated_noise: bool = True,
) -> LinearMap:
    """Return the inverse map of strains d = Z (p - p_i) + noise.

    Parameters
    ----------
    Z : (n_d, n_p) strain per pressure [1/Pa]: an array, sparse matrix or ``scipy.sparse.linalg.LinearOperator``.
    snapshots : (n_p, N) absolute pressures, a column for each [Pa].
    noise_std : sigma of the gauges' noise [m/m], one number or (n_d,); this or ``noise_covariance``.
    noise_covariance : (n_d, n_d) Gamma_n [(m/m)^2].
    loads : (n_f, n_p) G [N/Pa, N m/Pa], f = G (p - p_i); the first five are axial (aft), normal (up) and side
        force (starboard), pitching moment (nose up) and yawing moment (nose to starboard).
    modes : number r of POD modes, Case 1; None for Case 2.
    gamma : weight of the prior in Case 2 [1], a positive number, or a rule of
        :func:`strainfmu.linear.regularisation.select_gamma` on the data that prior and noise lead to expect;
        None for 1, the Bayesian value.
    weights : (n_p,) node areas [m2], the inner product of the POD, V^T W V = I; None for W = I. Case 1 alone.
    internal_pressure : p_i [Pa], one number or (n_p,).
    truncated_noise : whether modes beyond r count as noise that is correlated with their loads; the paper's Case 1
        leaves them out, and its sigma is too small.

    Raises
    ------
    InputError
        A shape or number is wrong, or the gauges do not identify r modes.

    Examples
    --------
    >>> import numpy as np
    >>> import strainfmu
    >>> random = np.random.default_rng(1)
    >>> Z, snapshots = 1e-9 * random.normal(size=(12, 500)), 5e3 + 100.0 * random.normal(size=(500, 40))
    >>> found = strainfmu.linear_map(Z, snapshots, noise_std=1e-7, modes=3)
    >>> found.T.shape, found.k.shape
    ((3, 12), (3,))
    """
    operator, pressure, noise = _checked(Z, snapshots, noise_std, noise_covariance)
    prior, root = prior_of_snapshots(pressure.T), np.sqrt(pressure.shape[1] - 1)
    if not np.isfinite(prior.mean).all():
        raise InputError("snapshots: expected finite pressures [Pa]")
    net_mean = prior.mean - np.asarray(internal_pressure, dtype=float)
    G = _load_operator(loads, len(net_mean))
    # F is large: Z, G and, in Case 1, the basis of the modes are multiplied with it in one product.
    dense = isinstance(operator, np.ndarray)
    rows = [operator, G] if dense else [G]
    if modes is None:
        if weights is not None:
            raise InputError("weights: expected none in Case 2 (modes=None), whose prior needs no inner product")
        pod, product = None, np.vstack(rows) @ prior.factor
    else:
        if gamma not in (None, 0):
            raise InputError(f"gamma: expected none with modes={modes}: Case 1 has no prior, got {gamma!r}")
        areas = _node_areas(weights, len(net_mean))
        pod, coefficients, product = leading_modes(prior, modes, areas, rows)
    strain, load = np.split(product, [len(noise)]) if dense else (np.asarray(operator @ prior.factor), product)
    mean_strain, load_of_mean = np.asarray(operator @ net_mean), G @ net_mean
    if not (np.isfinite(strain).all() and np.isfinite(mean_strain).all()):
        raise InputError("Z: expected finite strain per pressure [1/Pa]")
    errors = np.zeros((len(strain) + len(load), 0))
    if pod is None:
        fields, per_state = prior.factor, load
        states: GaussianMap | LeastSquaresMap = _gaussian(strain, mean_strain, noise, gamma)
        T, k = fields @ states.strain_gain, prior.mean + fields @ states.state_offset
    else:
        fields, of_modes, per_state = pod.modes, np.asarray(operator @ pod.modes), G @ pod.modes
        if truncated_noise:
            explained = np.vstack([of_modes, per_state]) @ coefficients
            errors = lower_factor(np.vstack([strain, load]) - explained)
        covariance = noise + errors[: len(strain)] @ errors[: len(strain)].T
        states = least_squares_map(of_modes, mean_strain, covariance, pod.coefficient_std)
        T, k = states.strain_gain, states.state_offset
    of_errors, load_of_errors = np.split(errors, [len(strain)])
    gain = _load_gain(states, per_state, of_errors, load_of_errors)
    # Joseph's form: noise and errors that pass the gain, and states that it does not resolve, in one factor.
    unresolved = [] if pod is not None else [gain @ strain - load]
    factor = np.hstack([gain @ np.linalg.cholesky(noise), gain @ of_errors - load_of_errors, *unresolved])
    of_snapshots = load_of_mean[:, None] + root * load
    return LinearMap(
        T=T,
        k=k,
        load_gain=None if loads is None else gain,
        load_offset=None if loads is None else load_of_mean - gain @ mean_strain,
        load_covariance=None if loads is None else factor @ factor.T,
        mean_pressure=prior.mean,
        states=states,
        pod=pod,
        _fields=fields,
        _noise=noise,
        _errors=(of_errors, load_of_errors),
        _load_per_state=per_state,
        _load_of_mean=load_of_mean,
        _largest_strain=np.abs(mean_strain[:, None] + root * strain).max(axis=1),
        _load_range=np.column_stack([of_snapshots.min(axis=1), of_snapshots.max(axis=1)]),
    )


def _load_operator(loads: ArrayLike | None, n_p: int) -> FloatArray:
    """Return G (n_f, n_p), without rows where there are no loads."""
    G = np.zeros((0, n_p)) if loads is None else np.asarray(loads, dtype=float)
    if G.ndim != 2 or G.shape[1] != n_p or not np.isfinite(G).all():
        raise InputError(f"loads: expected (n_f, {n_p}) finite numbers, got shape {G.shape}")
    return G


def _load_gain(
    states: GaussianMap | LeastSquaresMap, per_state: FloatArray, of_errors: FloatArray, load_of_errors: FloatArray
) -> FloatArray:
    """Return the gain (n_f, n_d) to loads: of the states, and of what the residual reveals of loads outside them.

    ``per_state`` (n_f, n_q) are loads of the states, ``of_errors`` A_t and ``load_of_errors`` B_t.
    """
    of_residual = np.linalg.solve(states.noise_covariance, of_errors @ load_of_errors.T).T
    return np.asarray((per_state - of_residual @ states.state_operator) @ states.strain_gain + of_residual)


def _checked(
    Z: Any, snapshots: ArrayLike, noise_std: ArrayLike | None, noise_covariance: ArrayLike | None
) -> tuple[Any, FloatArray, FloatArray]:
    """Return Z, the snapshots and the covariance of the noise."""
    dense = isinstance(Z, np.ndarray) or not (hasattr(Z, "shape") and hasattr(Z, "__matmul__"))
    operator = np.asarray(Z, dtype=float) if dense else Z
    pressure = np.asarray(snapshots, dtype=float)
    if len(operator.shape) != 2:
        raise InputError(f"Z: expected (n_d, n_p), got shape {operator.shape}")
    n_d, n_p = operator.shape
    if pressure.ndim != 2 or pressure.shape[0] != n_p or pressure.shape[1] < 2:
        hint = "; a column is a snapshot" if pressure.ndim == 2 and pressure.shape[1] == n_p else ""
        raise InputError(f"snapshots: expected ({n_p}, N), N at least 2, got shape {pressure.shape}{hint}")
    if (noise_std is None) == (noise_covariance is None):
        raise InputError("noise_std, noise_covariance: expected exactly one of them")
    if noise_covariance is not None:
        covariance = np.asarray(noise_covariance, dtype=float)
        if covariance.shape != (n_d, n_d):
            raise InputError(f"noise_covariance: expected ({n_d}, {n_d}), got shape {covariance.shape}")
    else:
        std = np.asarray(noise_std, dtype=float)
        if std.shape not in ((), (n_d,)) or not (np.isfinite(std).all() and (std > 0.0).all()):
            raise InputError(
                f"noise_std: expected one positive number or ({n_d},) of them [m/m], got {noise_std!r}"
            )
        covariance = np.diag(np.broadcast_to(std**2, n_d))
    check_covariance(covariance)
    return operator, pressure, covariance


def _gaussian(
    strain: FloatArray, mean_strain: FloatArray, noise: FloatArray, gamma: float | Rule | None
) -> GaussianMap:
    """Return the map of Case 2 with ``gamma``, or by its rule."""
    spectrum = whitened_spectrum(strain, noise)
    if isinstance(gamma, str):
        weight = select_gamma(gamma, expected_data(spectrum.eigenvalues, len(strain)))
    else:
        weight = 1.0 if gamma is None else float(gamma)
    return gaussian_map(strain, mean_strain, noise, weight, spectrum)


def _node_areas(weights: ArrayLike | None, n_p: int) -> FloatArray | None:
    if weights is None:
        return None
    area = np.asarray(weights, dtype=float)
    if area.shape != (n_p,) or not (np.isfinite(area).all() and (area > 0.0).all()):
        raise InputError(f"weights: expected ({n_p},) positive node areas [m2], got shape {area.shape}")
    return area
