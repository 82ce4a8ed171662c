"""Arguments of the estimators, of one sample or of several, checked and as arrays over the samples."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypedDict

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import QSource
from strainfmu.estimator.signal_names import STRAIN


class SampleInputs(TypedDict, total=False):
    """Inputs of a sample in addition to strain and dynamic pressure: arguments of ``estimate`` and ``track``.

    Each is one value for all samples, or one of each; NaN or left out where it is not known.
    """

    valid: ArrayLike | None
    dynamic_pressure_std: ArrayLike
    mach_number: ArrayLike
    mach_number_std: ArrayLike
    altitude: ArrayLike
    static_pressure: ArrayLike
    static_pressure_std: ArrayLike
    total_temperature: ArrayLike
    total_temperature_std: ArrayLike
    q_source: QSource | str | ArrayLike
    measured_angle_of_attack: ArrayLike
    measured_angle_of_attack_std: ArrayLike
    measured_sideslip_angle: ArrayLike
    measured_sideslip_angle_std: ArrayLike
    temperature: ArrayLike | None
    thrust: ArrayLike
    parameters: Mapping[str, ArrayLike] | None
    parameters_std: Mapping[str, ArrayLike] | None
    specific_force_x: ArrayLike
    specific_force_y: ArrayLike
    specific_force_z: ArrayLike
    angular_rate_x: ArrayLike
    angular_rate_y: ArrayLike
    angular_rate_z: ArrayLike
    angular_acceleration_y: ArrayLike
    angular_acceleration_z: ArrayLike
    vibration: ArrayLike


def real_numbers(name: str, values: ArrayLike) -> FloatArray:
    """Return ``values`` as an array of real numbers.

    Raises
    ------
    InputError
        They are complex, of which a part would be lost, or are no numbers, or rows of unequal length.
    """
    try:
        array = np.asarray(values)
        if array.dtype.kind != "c":
            return np.asarray(array, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: expected real numbers: {error}") from error
    raise InputError(f"{name}: expected real numbers, got {array.dtype}")


def is_series(strain: ArrayLike) -> bool:
    """Return whether ``strain`` has two axes, samples and sensors.

    Raises
    ------
    InputError
        It is complex, no numbers, or rows of unequal length.
    """
    return (strain if type(strain) is np.ndarray else real_numbers(STRAIN, strain)).ndim == 2


def strain_of_samples(strain: ArrayLike, n_gauges: int) -> FloatArray:
    """Return ``strain`` of k samples (k, n_d), or of one (n_d,), as (k, n_d) [m/m].

    Raises
    ------
    InputError
        It has another shape, or holds something else than real numbers.
    """
    d = real_numbers(STRAIN, strain)
    if d.ndim not in (1, 2) or d.shape[-1] != n_gauges:
        raise InputError(
            f"strain: expected {f'(k, {n_gauges})' if d.ndim == 2 else n_gauges} values, got {d.shape}"
        )
    return np.atleast_2d(d)


def checked_mask(valid: ArrayLike, n_gauges: int, samples: int | None = None) -> BoolArray:
    """Return a copy of ``valid`` as an array: (n_d,), or for a number of ``samples`` also (k, n_d).

    Raises
    ------
    InputError
        It has another shape, or is not of bool.
    """
    mask = np.array(valid)
    shapes = [(n_gauges,)] if samples is None else [(n_gauges,), (samples, n_gauges)]
    if mask.shape not in shapes or mask.dtype != np.bool_:
        expected = " or ".join(str(shape) for shape in shapes)
        raise InputError(f"valid: expected {expected} values of bool, got {mask.shape} of {mask.dtype}")
    return mask


def given(values: FloatArray) -> FloatArray:
    """Return ``values`` of Mach number, altitude or a pressure, NaN where not given: where they are 0 or below."""
    return np.asarray(np.where(values > 0.0, values, np.nan))


def per_sample(name: str, value: ArrayLike, samples: int) -> FloatArray:
    """Return ``value``, one number or one of each sample, as (samples,).

    Raises
    ------
    InputError
        It holds something else than numbers, or another number of them.
    """
    values = None
    try:
        array = np.asarray(value)
        if value is not None and array.dtype.kind != "c":
            values = np.asarray(array, dtype=float)
    except (TypeError, ValueError):
        pass
    if values is None or values.shape not in ((), (samples,)):
        expected = "a number" if samples == 1 else f"a number or {samples} numbers"
        got = str(value.dtype) if isinstance(value, np.ndarray) else repr(value)
        got = got if values is None else f"shape {values.shape}"
        raise InputError(f"{name}: expected {expected}, got {got}")
    return np.full(samples, values) if values.ndim == 0 else values
