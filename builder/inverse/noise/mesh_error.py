"""Error of strain by the mesh, in units of the gauges' sigma: what a map's sigmas hold of it, and what not.

What a second mesh says of the same gauges differs from the first by a pattern that follows the pressure. A third
would differ by about as much, in a pattern that is partly the same. So half of the variance counts as one error
that all gauges have in common, half as an error of each gauge on its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from builder.inverse.noise.hardware_errors import HardwareError
from strainfmu.arrays import FloatArray

COUNTED = 0.03
"""Root mean square in sigma from which the error is a term of the noise; below it adds 1e-3 of a variance."""

TRUSTED = 1.0
"""Root mean square in sigma up to which a map's sigmas are to be trusted."""


@dataclass(frozen=True, eq=False, kw_only=True)
class MeshError:
    """Error of the gauges' strain by the mesh.

    Attributes
    ----------
    against : what it was measured against.
    operator : (n_d, n_p) strain error per pressure [1/Pa].
    strain : (n, n_d) at the members of the ensemble [m/m].
    in_sigma : (n_d,) root mean square over the members, over each gauge's own noise.
    """

    against: str
    operator: FloatArray
    strain: FloatArray
    in_sigma: FloatArray

    @property
    def rms(self) -> float:
        """Root mean square over the gauges, in sigma."""
        return float(np.sqrt(np.mean(self.in_sigma**2)))

    @property
    def trusted(self) -> bool:
        """Whether sigmas that hold this error are to be trusted."""
        return self.rms <= TRUSTED

    def terms(self) -> list[HardwareError]:
        """Return the errors that the noise holds; none where they are too small to count."""
        if self.rms < COUNTED:
            return []
        half = np.sqrt(0.5)
        return [
            HardwareError(
                name=name, operator=half * self.operator, strain=half * self.strain, common=common, of_mesh=True
            )
            for name, common in (("mesh, of each gauge", False), ("mesh, in common", True))
        ]

    def record(self, names: tuple[str, ...]) -> dict[str, Any]:
        """Return what a map's provenance says of it."""
        worst = int(self.in_sigma.argmax())
        return {
            "against": self.against,
            "rms_sigma": float(f"{self.rms:.4g}"),
            "largest_sigma": float(f"{self.in_sigma[worst]:.4g}"),
            "largest_at": names[worst],
            "sigmas_trusted": self.trusted,
        }


def mesh_error_notes(provenance: Mapping[str, Any]) -> list[str]:
    """Return in lines what a map's provenance says of the mesh's error: its size, and a warning above 1 sigma."""
    mesh_error = provenance.get("mesh_error")
    if mesh_error is None:
        return []
    lines = [
        f"mesh error {mesh_error['rms_sigma']:.2g} sigma of gauge noise (rms), {mesh_error['largest_sigma']:.2g} "
        f"at {mesh_error['largest_at']}, against {mesh_error['against']}"
    ]
    if not mesh_error["sigmas_trusted"]:
        lines.append(
            f"warning: the mesh's error is above {TRUSTED:g} sigma of gauge noise: the sigmas of this map are not "
            "to be trusted; take a finer mesh"
        )
    return lines
