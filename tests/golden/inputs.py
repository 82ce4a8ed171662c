"""Inputs and results of golden streams, and the files that hold them; names as in ``kinds.py``."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache
from pathlib import Path

import numpy as np

DATA = Path(__file__).parent / "data"

PART = {
    **dict.fromkeys(("coefficients", "coefficients_std", "state", "state_std", "degrees_of_freedom"), 40),
    **{f"{name}{std}": 20 for name in ("other_loads", "other_coefficients") for std in ("", "_std")},
    "standardised_residual": 12,
}
"""How many of the first samples of a stream are kept of some fields; of all others it is all of them."""

Results = dict[str, np.ndarray]
"""Fields of k samples, (k,) or (k, n) each."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Inputs:
    """The samples of a stream, and what holds for all of them.

    Attributes
    ----------
    strain : (k, n_d) readings, of auxiliary sensors too.
    valid : (k, n_d) of bool, whether they may be used.
    time : (k,) [s].
    flow : (k,) each of air data, by name of the argument; NaN where not known.
    temperature : (k, n_t) [K]; n_t = 0 for none.
    thrust : (k,) [N].
    parameter, parameter_std : (k, n_p) flow parameters in the order of the map, n_p = 0 for none given.
    zero : (2 n_s + 1,) zero offsets of the strain gauges, their standard deviations and the one in common; (0,)
        for none.
    settings : of the estimator that are not the map's, by name.
    """

    strain: np.ndarray
    valid: np.ndarray
    time: np.ndarray
    flow: dict[str, np.ndarray] = field(default_factory=dict)
    temperature: np.ndarray
    thrust: np.ndarray
    parameter: np.ndarray
    parameter_std: np.ndarray
    zero: np.ndarray
    settings: dict[str, float] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.strain)

    def rows(self, rows: np.ndarray | slice) -> Inputs:
        """Return the samples ``rows``."""
        of_samples = (one.name for one in fields(self) if one.name not in ("flow", "zero", "settings"))
        changed = {name: getattr(self, name)[rows] for name in of_samples}
        return replace(self, flow={name: value[rows] for name, value in self.flow.items()}, **changed)


def rounded(inputs: Inputs) -> Inputs:
    """Return ``inputs`` of values that float32 holds, as the file does; settings stay."""
    changed = {
        one.name: _single(getattr(inputs, one.name))
        for one in fields(inputs)
        if one.name not in ("flow", "settings", "valid")
    }
    return replace(inputs, flow={name: _single(value) for name, value in inputs.flow.items()}, **changed)


def _single(values: np.ndarray) -> np.ndarray:
    with np.errstate(over="ignore"):
        return np.asarray(values).astype(np.float32).astype(np.float64)


@dataclass(frozen=True, eq=False, kw_only=True)
class Recorded:
    """A stream in its file: its inputs, and its results by mode."""

    inputs: Inputs
    results: Mapping[str, Results]


@cache
def recorded(kind: str) -> dict[str, Recorded]:
    """Return the streams of the file of ``kind``, by name; none where there is no file."""
    path = DATA / f"{kind}.npz"
    if not path.exists():
        return {}
    streams: dict[str, dict[str, np.ndarray]] = {}
    with np.load(path) as content:
        for key in content.files:
            stream, _, name = key.partition("/")
            streams.setdefault(stream, {})[name] = content[key]
    return {stream: _of_arrays(arrays) for stream, arrays in streams.items()}


def _of_arrays(arrays: Mapping[str, np.ndarray]) -> Recorded:
    inputs: dict[str, np.ndarray] = {}
    flow: dict[str, np.ndarray] = {}
    settings: dict[str, float] = {}
    results: dict[str, Results] = {}
    for name, values in arrays.items():
        group, _, rest = name.rpartition("/")
        if group == "":
            inputs[name] = values if name == "valid" else values.astype(np.float64)
        elif group == "flow":
            flow[rest] = values.astype(np.float64)
        elif group == "settings":
            settings[rest] = float(values)
        else:
            results.setdefault(group, {})[rest] = values
    return Recorded(inputs=Inputs(flow=flow, settings=settings, **inputs), results=results)


def write(kind: str, streams: Mapping[str, Recorded]) -> None:
    """Write the file of ``kind``. The same content gives the same bytes."""
    DATA.mkdir(exist_ok=True)
    with zipfile.ZipFile(DATA / f"{kind}.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for stream, one in streams.items():
            for name, values in _arrays(one).items():
                content = io.BytesIO()
                np.lib.format.write_array(content, np.asarray(values, order="C"), allow_pickle=False)
                entry = zipfile.ZipInfo(f"{stream}/{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
                entry.compress_type = zipfile.ZIP_DEFLATED
                archive.writestr(entry, content.getvalue())


def _arrays(one: Recorded) -> dict[str, np.ndarray]:
    inputs, found = one.inputs, dict[str, np.ndarray]()
    for entry in fields(inputs):
        if entry.name in ("flow", "settings"):
            continue
        values = getattr(inputs, entry.name)
        found[entry.name] = values if entry.name == "valid" else values.astype(np.float32)
    found |= {f"flow/{name}": values.astype(np.float32) for name, values in inputs.flow.items()}
    found |= {f"settings/{name}": np.float64(value) for name, value in inputs.settings.items()}
    for mode, results in one.results.items():
        found |= {f"{mode}/{name}": values for name, values in results.items()}
    return found
