"""The one list of errors that a map includes, each with the entry that states it, where it acts, and its role.

The role says what the gain may do about an error. Covariances and alarms have all errors alike.

``estimated``
    The gain may correct it: the residual determines it, or is free to.
``considered``
    The gain does not know it. So the estimate does not follow what looks like it, and gains nothing where other
    tolerances grow smaller.
``split``
    Estimated at :data:`ESTIMATED_PART` of its standard deviation, considered at the rest. Wholly estimated, errors
    of the flow cost as much again in moments on flows that have none; wholly considered, they cost as much in
    forces across on flows that have them.

With auxiliary sensors, as pressure ports, errors of the pressure on the surface are estimated: these measure it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from builder.inverse.noise.flow_models import FLOW_MODELS, LEEWARD_PRESSURE, LEVEL
from builder.inverse.noise.flows_between import BETWEEN
from builder.inverse.noise.inertia import MASSES, THEORY, VIBRATION_MODES
from builder.inverse.noise.inertia import NAME as INERTIA
from builder.inverse.noise.recorder import MISMATCH, PICKUP, SCAN
from builder.structure.as_built_kinds import IN_NOISE, Role
from builder.vehicle.model_form import ModelForm
from builder.vehicle.toml.toml_sections import Section
from strainfmu.arrays import FloatArray
from strainfmu.estimator.signal_names import TEMPERATURE

ESTIMATED_PART = 0.15
"""Part rho of the standard deviation of a split error that the gain may correct."""

PROCESS, SPREAD = "pressure off the tables", "fraction of the snapshots"
"""Names of the parts of the model-form error."""

INTERPOLATION, GRID_REFINEMENT = "interpolation", "grid of the flow"
"""Names of the numerical errors of the flow."""

OF_EACH_AFTER_TEST, IN_COMMON_AFTER_TEST = "ground test, of each gauge", "ground test, in common"
"""Names of what a ground test left unknown."""

GAUGE_NOISE, INSTALLATION, MODEL_FORM, INERTIA_GROUP = "gauge noise", "installation", "model form", "inertia"
TEMPERATURE_GROUP, NUMERICS_GROUP, OTHER_GROUP = TEMPERATURE, "numerics", "other"
"""Groups of errors in reports."""

_GAUGE, _ALL, _PRESSURE, _NUMERICS = "each gauge", "all gauges", "pressure on the surface", "numerics of the build"

_GROUP_OF_PLACE = {_PRESSURE: MODEL_FORM, _NUMERICS: NUMERICS_GROUP}
_GROUP_OF_SECTION = {
    "recorder": GAUGE_NOISE,
    "noise": INSTALLATION,
    "mass": INERTIA_GROUP,
    TEMPERATURE: TEMPERATURE_GROUP,
}


@dataclass(frozen=True, kw_only=True)
class MapError:
    """One error.

    Attributes
    ----------
    name : of its columns in the map.
    acts_on : what it changes.
    role : see above.
    entry : of the vehicle file that states its standard deviation, empty where the build determines it.
    unit : of the entry.
    size : attribute of :class:`~builder.vehicle.model_form.ModelForm` that has its size [1], where the entry
        may be left out.
    """

    name: str
    acts_on: str = _ALL
    role: Role = "estimated"
    entry: str = ""
    unit: str = ""
    size: str = ""

    @property
    def group(self) -> str:
        """Group of the error in reports."""
        if self.acts_on in _GROUP_OF_PLACE:
            return _GROUP_OF_PLACE[self.acts_on]
        if self.name == GAUGE_NOISE:
            return GAUGE_NOISE
        return _GROUP_OF_SECTION.get(self.entry.partition(".")[0], OTHER_GROUP)

    def stated_size(self, sections: Mapping[str, Section], sizes: ModelForm) -> float | None:
        """Return the standard deviation in the unit of the entry; None where no one number states it."""
        if self.size:
            value = getattr(sizes, self.size)
            return None if value is None else 100.0 * float(value)
        section, _, name = self.entry.partition(".")
        value = getattr(sections.get(section), name, None)
        return float(value) if isinstance(value, int | float) else None


def _of_pressure(name: str, entry: str, size: str, role: Role = "considered") -> MapError:
    return MapError(name=name, acts_on=_PRESSURE, role=role, entry=f"map.{entry}", unit="%", size=size)


ERRORS = {
    error.name: error
    for error in (
        MapError(name="gauge noise", acts_on=_GAUGE, entry="noise.std_um_per_m", unit="um/m"),
        MapError(name=PICKUP, entry="recorder.pickup_um_per_m", unit="um/m, amplitude"),
        MapError(name=SCAN, entry="recorder.channel_ms", unit="ms"),
        MapError(name=MISMATCH, entry="recorder.mismatch_um_per_m_per_K", unit="um/m/K, over recorder.gradient_K"),
        *(
            MapError(
                name=kind.column_name,
                acts_on=kind.acts_on,
                role=kind.role,
                entry=f"noise.{kind.entry}",
                unit=f"{kind.unit} of {kind.relative_to}" if kind.relative_to else kind.unit,
            )
            for kind in IN_NOISE
        ),
        MapError(name=OF_EACH_AFTER_TEST, acts_on=_GAUGE),
        MapError(name=IN_COMMON_AFTER_TEST, role="considered"),
        MapError(name="mesh, of each gauge", acts_on=_NUMERICS),
        MapError(name="mesh, in common", acts_on=_NUMERICS, role="considered"),
        MapError(name=INTERPOLATION, acts_on=_NUMERICS),
        MapError(name="tables", acts_on=_NUMERICS),
        MapError(name=BETWEEN, acts_on=_NUMERICS),
        MapError(name=GRID_REFINEMENT, acts_on=_NUMERICS, role="considered"),
        _of_pressure(PROCESS, "discrepancy_percent", "process"),
        _of_pressure(SPREAD, "discrepancy_of_prior_percent", "of_prior", role="split"),
        _of_pressure(LEVEL, "discrepancy_of_overpressure_percent", "of_overpressure"),
        _of_pressure(LEEWARD_PRESSURE, "discrepancy_of_leeward_percent", "of_leeward"),
        _of_pressure(FLOW_MODELS, "discrepancy_of_newtonian_percent", "of_newtonian"),
        MapError(name=INERTIA, entry="mass"),
        MapError(name=MASSES, entry="mass"),
        MapError(name=THEORY, entry="mass.inertia_strain_percent", unit="% in a held body"),
        MapError(name=VIBRATION_MODES, entry="mass.vibration_um_per_m", unit="um/m"),
        MapError(name=TEMPERATURE, entry=TEMPERATURE),
        MapError(name="modulus with temperature", entry=TEMPERATURE),
        MapError(name="apparent strain with temperature", acts_on=_GAUGE, entry=TEMPERATURE),
    )
}
"""All errors by name. What is not listed is estimated: modes of ``noise.nuisance_file``, flow parameters, errors
of the sensors of [sensors]."""


def error_named(name: str) -> MapError:
    """Return the error of columns ``name``."""
    return ERRORS.get(name, MapError(name=name))


def role_of(name: str, is_measured: bool = False) -> Role:
    """Return the role of the error ``name``; ``is_measured`` with auxiliary sensors."""
    error = error_named(name)
    return "estimated" if is_measured and error.acts_on == _PRESSURE else error.role


def parts_of(name: str, is_measured: bool = False) -> tuple[float, float]:
    """Return the parts of the standard deviation of ``name`` that are estimated and considered."""
    role = role_of(name, is_measured)
    part = ESTIMATED_PART if role == "split" else float(role == "estimated")
    return part, float(np.sqrt(1.0 - part * part))


def by_role(terms: Mapping[str, FloatArray], is_measured: bool = False) -> tuple[FloatArray, FloatArray]:
    """Return columns (n, k) of ``terms`` by name that are estimated, and those that are considered."""
    rows = len(next(iter(terms.values())))
    blocks: tuple[list[FloatArray], list[FloatArray]] = ([np.zeros((rows, 0))], [np.zeros((rows, 0))])
    for name, columns in terms.items():
        for block, part in zip(blocks, parts_of(name, is_measured), strict=True):
            if part > 0.0:
                block.append(part * columns)
    return np.hstack(blocks[0]), np.hstack(blocks[1])


def record_of(name: str, sections: Mapping[str, Section], sizes: ModelForm, is_measured: bool) -> dict[str, Any]:
    """Return what the provenance of a map says of the error ``name``, but how much it strains.

    ``sections`` of the vehicle file state sizes, ``sizes`` are the model-form error's, ``is_measured`` as of
    :func:`role_of`.
    """
    error = error_named(name)
    size = error.stated_size(sections, sizes)
    return {
        "name": name,
        **({"entry": error.entry} if error.entry else {}),
        **({} if size is None else {"size": size, "unit": error.unit}),
        "acts_on": error.acts_on,
        "role": role_of(name, is_measured),
    }
