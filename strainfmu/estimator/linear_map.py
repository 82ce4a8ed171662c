"""The inverse map of the paper from arrays: strain per pressure, snapshots, noise in; gains, covariances out.

A gauge reads d = Z (p - p_i) + noise, noise ~ N(0, Gamma) (Pham et al., eq. p2o). With the mean p_mean of N
snapshots, F = (P - p_mean) / sqrt(N - 1), so that Gamma_pr = F F^T (eq. prior_cov) is never formed, Gamma = L L^T
and L^-1 Z F = U S V^T, lambda = S^2:

Case 2, more pressures than gauges: p = p_mean + F q, q ~ N(0, I),

    q = V diag(S / (lambda + gamma)) U^T L^-1 (d - m),      m = Z (p_mean - p_i),
    H^-1 = F V diag(1 / (lambda + gamma)) V^T F^T           (eq. p2o-ls-solution; no digits lost to Woodbury).

Case 1, at most as many states as gauges: p = p_mean + V_r q with r POD modes (eq. pod), A = Z V_r,

    q = (A^T Gamma^-1 A)^-1 A^T Gamma^-1 (d - m),           cov q = (A^T Gamma^-1 A)^-1   (eq. sls-cov).

Modes beyond r strain the gauges too. As noise they have the covariance Gamma_e = A_t A_t^T, with A_t their strain
per standard deviation; without it they alias into q, and the stated sigma is too small.

Loads are f = G (p - p_i), the first five axial, normal and side force [N], pitching and yawing moment [N m].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from os import PathLike
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.inverse_map_checks import check_covariance
from strainfmu.estimator.numerics.whitening import inverse_root
from strainfmu.estimator.regularisation import RULES, Rule, expected_data, select_gamma
from strainfmu.files import write_bytes_atomically

N_LOADS = 5
"""Loads that an :class:`~strainfmu.InverseMap` has at least."""

MOST_NODES = 5000
"""Nodes up to which the posterior covariance (n_p, n_p) is formed."""

MAX_CONDITION_NUMBER = 1e10
"""Of the whitened, scaled A in Case 1: above it the gauges do not identify the modes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PressureModes:
    """Proper orthogonal decomposition of the snapshots, the first r modes: p = p_mean + V_r q (eq. pod).

    Attributes
    ----------
    modes : (n_p, r) V_r [1], V_r^T W V_r = I.
    singular_values : (r,) of the centred snapshots, falling [Pa].
    energy : (r,) fraction of the energy of all modes in the first 1, 2, .. r.
    coefficient_std : (r,) standard deviation of q over the snapshots [Pa].
    right : (N, r) W_r, the snapshots' coordinates: (P - p_mean) W_r = V_r diag(singular_values).
    """

    modes: FloatArray
    singular_values: FloatArray
    energy: FloatArray
    coefficient_std: FloatArray
    right: FloatArray


@dataclass(frozen=True, kw_only=True)
class RelativeCondition:
    """K = |d| / (sigma_min(A) |q|), the relative condition number of the paper, with the scaling it depends on.

    Attributes
    ----------
    value : K [1].
    strain_norm : |d| [m/m].
    state_norm : |q| [1], in multiples of ``state_scale``.
    state_scale : unit of the states [Pa].
    smallest_singular_value : sigma_min of A times ``state_scale`` [m/m].
    kappa : sigma_max / sigma_min of A.
    """

    value: float
    strain_norm: float
    state_norm: float
    state_scale: float
    smallest_singular_value: float
    kappa: float

    @property
    def scaling(self) -> str:
        """The scaling in words, printed with K."""
        return (
            f"|d| = {1e6 * self.strain_norm:.6g} um/m, |q| = {self.state_norm:g} in units of "
            f"{self.state_scale:.6g} Pa, sigma_min(A) = {1e6 * self.smallest_singular_value:.6g} um/m"
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearMap:
    """The affine map of n_d strains d to pressure or modes, T d + k, and to n_f loads, load_gain d + load_offset.

    Made by :func:`linear_map`. Case 2 has ``pod`` None, Case 1 has gamma 0 and T, k for the r POD coefficients.

    Attributes
    ----------
    T, k : (n_p, n_d) [Pa] and (n_p,) [Pa] in Case 2, (r, n_d) [Pa] and (r,) [Pa] in Case 1.
    gamma : weight of the prior [1].
    load_gain, load_offset : (n_f, n_d) [N, N m] and (n_f,) [N, N m]; None without loads.
    load_covariance : (n_f, n_f) of the loads' error [(N, N m)^2], Joseph's form, which holds for any gamma.
    mean_pressure : (n_p,) p_mean [Pa].
    mean_strain : (n_d,) m [m/m].
    state_operator : (n_d, n_q) A: Z F [1] in Case 2, Z V_r [1/Pa] in Case 1.
    noise_covariance : (n_d, n_d) Gamma that weights the data, truncated modes included [(m/m)^2].
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
    gamma: float
    load_gain: FloatArray | None
    load_offset: FloatArray | None
    load_covariance: FloatArray | None
    mean_pressure: FloatArray
    mean_strain: FloatArray
    state_operator: FloatArray
    noise_covariance: FloatArray
    pod: PressureModes | None
    _fields: FloatArray  # (n_p, n_q) F in Case 2
    _right: FloatArray  # (n_q, n_q) V in Case 2
    _singular_values: FloatArray  # (k,) S in Case 2
    _noise: FloatArray  # (n_d, n_d) covariance of the gauges' noise alone
    _error_strain: FloatArray  # (n_d, t) strain of the truncated modes per standard deviation
    _error_load: FloatArray  # (n_f, t) their loads
    _load_per_state: FloatArray  # (n_f, n_q)
    _load_of_mean: FloatArray  # (n_f,)
    _largest_strain: FloatArray  # (n_d,) over the snapshots
    _load_range: FloatArray  # (n_f, 2) over the snapshots

    @property
    def case(self) -> int:
        """1, least squares on POD modes, or 2, the snapshots as a Gaussian prior."""
        return 2 if self.pod is None else 1

    def estimate(self, d: ArrayLike) -> FloatArray:
        """Return T d + k, (.., n_p) or (.., r) [Pa], of strains ``d`` (.., n_d) [m/m].

        Raises
        ------
        InputError
            Another number of gauges, or a strain that is not finite.
        """
        strain, n_d = np.asarray(d, dtype=float), len(self.mean_strain)
        if strain.ndim == 0 or strain.shape[-1] != n_d:
            raise InputError(f"d: expected {n_d} gauges in the last axis, got shape {strain.shape}")
        if not np.isfinite(strain).all():
            raise InputError("d: expected finite strains; an Estimator of to_map(..) takes lost gauges as NaN")
        return np.asarray(strain @ self.T.T + self.k)

    @cached_property
    def posterior_factor(self) -> FloatArray:
        """R with H^-1 = R R^T: (n_p, N) [Pa] of the pressure in Case 2, (r, r) [Pa] of the modes in Case 1."""
        if self.pod is not None:
            left = inverse_root(self.noise_covariance) @ self.state_operator
            return np.asarray(np.linalg.inv(np.linalg.qr(left, mode="r")))
        weight = 1.0 / np.sqrt(self._all_eigenvalues + self.gamma)
        return np.asarray(self._fields @ (self._right * weight))

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

    @cached_property
    def eigenvalues(self) -> FloatArray:
        """(k,) lambda [1], falling, of the prior-preconditioned Hessian Gamma_pr Z^T Gamma^-1 Z (eq. eigproblem).

        Raises
        ------
        InputError
            The map is of Case 1.
        """
        self._refuse_case_1("eigenvalues")
        return self._singular_values**2

    @cached_property
    def eigenvectors(self) -> FloatArray:
        """(n_p, k) b_k [Pa] of these eigenvalues, of unit size under the prior (b^T Gamma_pr^+ b = 1)."""
        self._refuse_case_1("eigenvectors")
        return np.asarray(self._fields @ self._right[:, : len(self._singular_values)])

    def recoverable(self, gamma: float | None = None) -> int:
        """Return how many modes have lambda >= ``gamma``, of which data outweigh the prior; None for the map's."""
        self._refuse_case_1("recoverable")
        return int(np.sum(self.eigenvalues >= (self.gamma if gamma is None else gamma)))

    @property
    def _all_eigenvalues(self) -> FloatArray:
        none = np.zeros(len(self._right) - len(self._singular_values))
        return np.concatenate([self._singular_values**2, none])

    def _refuse_case_1(self, name: str) -> None:
        if self.pod is not None:
            raise InputError(f"{name}: expected a map of Case 2 (modes=None), got Case 1")

    @cached_property
    def condition_number(self) -> float:
        """kappa of the whitened A, its columns scaled by the states' spread; of Case 1 [1]."""
        self._refuse_case_2("condition_number")
        return _condition_number(self.state_operator, self.noise_covariance, cast(PressureModes, self.pod))

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
        self._refuse_case_2("relative_condition")
        return relative_condition(self.state_operator, strain_norm, state_norm, state_scale)

    def _refuse_case_2(self, name: str) -> None:
        if self.pod is None:
            raise InputError(
                f"{name}: expected a map of Case 1 (modes=r), got Case 2; eigenvalues say what it sees"
            )

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
        n_d = len(self.mean_strain)
        if self.load_gain is None or len(self.load_gain) < N_LOADS:
            got = "none" if self.load_gain is None else str(len(self.load_gain))
            raise InputError(f"to_map: expected linear_map(.., loads=G) with {N_LOADS} loads at least, got {got}")
        for name, value in (
            ("reference_area", reference_area),
            ("reference_length", reference_length),
            ("dynamic_pressure", dynamic_pressure),
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
            state_operator=self.state_operator,
            gauge_covariance=self._noise,
            error_strain=self._error_strain,
            error_load=self._error_load[five],
            regularisation=self.gamma,
            load_per_state=self._load_per_state[five],
            load_of_mean=self._load_of_mean[five],
            mean_strain=self.mean_strain,
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
        names = ("T", "k", "gamma", "mean_pressure", "mean_strain", "noise_covariance")
        of_loads = () if self.load_gain is None else ("load_gain", "load_offset", "load_covariance")
        content = {name: getattr(self, name) for name in (*names, *of_loads)}

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
        :func:`strainfmu.estimator.regularisation.select_gamma` on the data that prior and noise lead to expect;
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
    n_p, n_snapshots = pressure.shape
    mean = pressure.mean(axis=1)
    if not np.isfinite(mean).all():
        raise InputError("snapshots: expected finite pressures [Pa]")
    fields = pressure - mean[:, None]
    fields /= np.sqrt(n_snapshots - 1)
    net_mean = mean - np.asarray(internal_pressure, dtype=float)
    strain, mean_strain = np.asarray(operator @ fields), np.asarray(operator @ net_mean)
    if not (np.isfinite(strain).all() and np.isfinite(mean_strain).all()):
        raise InputError("Z: expected finite strain per pressure [1/Pa]")
    G = np.zeros((0, n_p)) if loads is None else np.asarray(loads, dtype=float)
    if G.ndim != 2 or G.shape[1] != n_p or not np.isfinite(G).all():
        raise InputError(f"loads: expected (n_f, {n_p}) finite numbers, got shape {G.shape}")
    load, load_of_mean = G @ fields, G @ net_mean
    if modes is None:
        if weights is not None:
            raise InputError("weights: expected none in Case 2 (modes=None), whose prior needs no inner product")
        made = _case_2(fields, strain, noise, load, gamma)
    else:
        if gamma not in (None, 0):
            raise InputError(f"gamma: expected none with modes={modes}: Case 1 has no prior, got {gamma!r}")
        pod = _pressure_modes(fields, modes, weights)
        made = _case_1(pod, strain, noise, load, truncated_noise)
    k = -made["T"] @ mean_strain + (mean if modes is None else 0.0)
    root = np.sqrt(n_snapshots - 1)
    of_snapshots = load_of_mean[:, None] + root * load
    gain = made.pop("load_gain")
    return LinearMap(
        **made,
        k=k,
        load_gain=None if loads is None else gain,
        load_offset=None if loads is None else load_of_mean - gain @ mean_strain,
        mean_pressure=mean,
        mean_strain=mean_strain,
        _noise=noise,
        _load_of_mean=load_of_mean,
        _largest_strain=np.abs(mean_strain[:, None] + root * strain).max(axis=1),
        _load_range=np.column_stack([of_snapshots.min(axis=1), of_snapshots.max(axis=1)]),
    )


def _checked(
    Z: Any, snapshots: ArrayLike, noise_std: ArrayLike | None, noise_covariance: ArrayLike | None
) -> tuple[Any, FloatArray, FloatArray]:
    """Return Z, the snapshots and the covariance of the noise."""
    operator = Z if hasattr(Z, "shape") and hasattr(Z, "__matmul__") else np.asarray(Z, dtype=float)
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


def _case_2(
    fields: FloatArray, strain: FloatArray, noise: FloatArray, load: FloatArray, gamma: float | Rule | None
) -> dict[str, Any]:
    """Return the fields of a map whose states are standard normal under the prior F."""
    n_d, n_q = strain.shape
    if not fields.any():
        raise InputError("snapshots: expected different ones, got all equal: no prior")
    whitening = inverse_root(noise)
    left, singular, right = np.linalg.svd(whitening @ strain, full_matrices=True)
    values = singular**2
    if isinstance(gamma, str):
        weight = select_gamma(gamma, expected_data(values, n_d))
    else:
        weight = 1.0 if gamma is None else float(gamma)
        if not 0.0 < weight < np.inf:
            raise InputError(f"gamma: expected a positive number or one of {', '.join(RULES)}, got {gamma!r}")
    k = len(singular)
    gain = (right[:k].T * (singular / (values + weight))) @ (left[:, :k].T @ whitening)
    every = np.concatenate([values, np.zeros(n_q - k)])
    # Joseph's form: noise that passes the gain, and states that it does not resolve, together in one factor.
    of_loads = load @ right.T * (np.sqrt(every + weight**2) / (every + weight))
    return {
        "T": fields @ gain,
        "gamma": weight,
        "load_gain": load @ gain,
        "load_covariance": of_loads @ of_loads.T if len(load) else None,
        "state_operator": strain,
        "noise_covariance": noise,
        "pod": None,
        "_fields": fields,
        "_right": right.T,
        "_singular_values": singular,
        "_error_strain": np.zeros((n_d, 0)),
        "_error_load": np.zeros((len(load), 0)),
        "_load_per_state": load,
    }


def _case_1(
    pod: PressureModes, strain: FloatArray, noise: FloatArray, load: FloatArray, truncated_noise: bool
) -> dict[str, Any]:
    """Return the fields of a map whose states are the coefficients of ``pod`` [Pa]."""
    n_d, r = len(strain), pod.modes.shape[1]
    if r > n_d:
        raise InputError(f"modes: expected at most {n_d} with {n_d} gauges, got {r}")
    # F W_r = V_r diag(std): strain and load of the modes follow from those of the snapshots.
    kept = pod.right / pod.coefficient_std
    operator, per_state = strain @ kept, load @ kept
    error_strain, error_load = np.zeros((n_d, 0)), np.zeros((len(load), 0))
    if truncated_noise:
        joint = np.vstack([strain, load])
        joint -= (joint @ pod.right) @ pod.right.T
        joint = _fewer_columns(joint)
        error_strain, error_load = joint[:n_d], joint[n_d:]
    covariance = noise + error_strain @ error_strain.T
    condition = _condition_number(operator, covariance, pod)
    if not condition < MAX_CONDITION_NUMBER:
        raise InputError(
            f"modes: the {n_d} gauges do not identify {r} modes (condition number {condition:.1e}); keep "
            "fewer modes or place gauges elsewhere"
        )
    # Normal equations by QR of the whitened A; then what the residual reveals of loads outside the modes.
    whitening = inverse_root(covariance)
    q, upper = np.linalg.qr(whitening @ operator)
    gain = np.linalg.solve(upper, q.T @ whitening)
    of_residual = (whitening.T @ (whitening @ error_strain @ error_load.T)).T
    load_gain = (per_state - of_residual @ operator) @ gain + of_residual
    of_noise = load_gain @ np.linalg.cholesky(noise)
    of_truncated = load_gain @ error_strain - error_load
    return {
        "T": gain,
        "gamma": 0.0,
        "load_gain": load_gain,
        "load_covariance": of_noise @ of_noise.T + of_truncated @ of_truncated.T if len(load) else None,
        "state_operator": operator,
        "noise_covariance": covariance,
        "pod": pod,
        "_fields": pod.modes,
        "_right": np.zeros((0, 0)),
        "_singular_values": np.zeros(0),
        "_error_strain": error_strain,
        "_error_load": error_load,
        "_load_per_state": per_state,
    }


def _fewer_columns(joint: FloatArray) -> FloatArray:
    """Return columns, as many as rows at most, with the covariance of the columns of ``joint`` (n, k)."""
    if joint.shape[1] <= len(joint):
        return joint
    size = np.linalg.norm(
        joint, axis=1, keepdims=True
    )  # rows of one size: strain and newtons differ by many orders
    size[size == 0.0] = 1.0
    upper = np.asarray(np.linalg.qr((joint / size).T, mode="r"))
    return np.asarray(size * upper.T)


def _pressure_modes(fields: FloatArray, r: int, weights: ArrayLike | None) -> PressureModes:
    """Return the first ``r`` POD modes of ``fields`` F (n_p, N).

    The method of snapshots (Sirovich 1987): eigenvectors of F^T W F (N, N). Squaring costs weak
    modes digits: modes and singular values are solved again within the leading ones (Rayleigh and Ritz).
    """
    n_p, n_snapshots = fields.shape
    area = np.ones(n_p) if weights is None else np.asarray(weights, dtype=float)
    if area.shape != (n_p,) or not (np.isfinite(area).all() and (area > 0.0).all()):
        raise InputError(f"weights: expected ({n_p},) positive node areas [m2], got shape {area.shape}")
    if isinstance(r, bool) or int(r) != r or not 1 <= r < n_snapshots:
        raise InputError(f"modes: expected 1 to {n_snapshots - 1} with {n_snapshots} snapshots, got {r}")
    root = np.sqrt(area)[:, None]
    gram = fields.T @ (fields if weights is None else fields * area[:, None])
    values, vectors = np.linalg.eigh(gram)
    leading = vectors[:, ::-1][:, : min(2 * r + 10, n_snapshots)]
    basis, _ = np.linalg.qr(root * (fields @ leading))
    left, std, right = np.linalg.svd((root * basis).T @ fields, full_matrices=False)
    if not std[r - 1] > 1e-10 * std[0]:
        count = int(np.sum(std > 1e-10 * std[0]))
        raise InputError(f"modes: expected at most {count}, the modes that the snapshots have, got {r}")
    modes = (basis @ left[:, :r]) / root
    sign = np.sign(modes[np.abs(modes).argmax(axis=0), np.arange(r)])
    return PressureModes(
        modes=modes * sign,
        singular_values=std[:r] * np.sqrt(n_snapshots - 1),
        energy=np.cumsum(std[:r] ** 2) / values.sum(),
        coefficient_std=std[:r],
        right=right[:r].T * sign,
    )


def _condition_number(operator: FloatArray, covariance: FloatArray, pod: PressureModes) -> float:
    # Columns are scaled by the states' spread: the condition number then depends on gauges, not on units.
    return float(np.linalg.cond(inverse_root(covariance) @ (operator * pod.coefficient_std)))


def relative_condition(
    state_operator: FloatArray, strain_norm: float, state_norm: float, state_scale: float
) -> RelativeCondition:
    """Return K of ``state_operator`` A (n_d, r) [1/Pa]; arguments as of :meth:`LinearMap.relative_condition`.

    Raises
    ------
    InputError
        A norm or the scale is not positive, or A lacks full rank.
    """
    for name, value in (("strain norm", strain_norm), ("state norm", state_norm), ("state scale", state_scale)):
        if not 0.0 < value < np.inf:
            raise InputError(f"relative condition: {name}: expected a positive number, got {value}")
    singular_values = state_scale * np.linalg.svd(state_operator, compute_uv=False)
    largest, smallest = float(singular_values[0]), float(singular_values[-1])
    if not smallest > 1e-14 * largest or len(state_operator) < state_operator.shape[1]:
        raise InputError("relative condition: the gauges do not observe every state, K is infinite")
    return RelativeCondition(
        value=strain_norm / (smallest * state_norm),
        strain_norm=strain_norm,
        state_norm=state_norm,
        state_scale=state_scale,
        smallest_singular_value=smallest,
        kappa=largest / smallest,
    )
