"""Estimates of the pressure states by a map, of the builder or finished: q = T d + k."""

from typing import Protocol

import numpy as np

from strainfmu.estimator.reference.gain import nominal, state_model


class StateModel(Protocol):
    """What the gain of states follows from."""

    @property
    def state_operator(self) -> np.ndarray: ...
    @property
    def noise_covariance(self) -> np.ndarray: ...
    @property
    def regularisation(self) -> float: ...
    @property
    def mean_strain(self) -> np.ndarray: ...


def state_gain(state: StateModel) -> np.ndarray:
    """(n_q, n_d) T."""
    model = state_model(state.state_operator, state.noise_covariance, state.regularisation)
    return nominal(model).gain


def state_offset(model: StateModel) -> np.ndarray:
    """(n_q,) k = -T m."""
    return np.asarray(-state_gain(model) @ model.mean_strain)


def precision_of(model: StateModel) -> np.ndarray:
    """(n_d, n_d) P of d - m, whatever gamma: the prior of states is standard normal, or they are free."""
    of_prior = float(model.regularisation > 0.0)
    return nominal(state_model(model.state_operator, model.noise_covariance, of_prior)).precision


def load_gain_of(model: StateModel, load_per_state: np.ndarray, cross: np.ndarray | None = None) -> np.ndarray:
    """(n_f, n_d) G of loads per state (n_f, n_q), ``cross`` (n_d, n_f) their covariance with strain."""
    operator, noise = model.state_operator, model.noise_covariance
    return nominal(state_model(operator, noise, model.regularisation, load_per_state, cross)).gain
