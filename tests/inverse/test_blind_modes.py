"""Modes that the gauges do not observe: skipped, named, and counted with the truncated ones."""

import numpy as np
import pytest
from coarse_vehicle import with_paper_map

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import inverse_map_of
from builder.inverse.mode_choice import MIN_STRAIN_OVER_NOISE, mode_choice_lines
from builder.inverse.problem import inverse_problem
from builder.inverse.solution import ordered_modes
from builder.structure.fourier.fourier_model import StructuralModel
from builder.vehicle.file import Vehicle
from builder.vehicle.map_options import MapEntry


@pytest.mark.parametrize("form", ["absolute", "dynamic_pressure"])
@pytest.mark.parametrize("modes", [3, 4, 5])
def test_the_published_prior_builds_with_few_modes(
    modes: int, form: str, vehicle: Vehicle, prior_snapshots: Snapshots, structure: StructuralModel
) -> None:
    """P2, whose third mode has no strain: as many modes as requested, the blind ones in the provenance."""
    if form == "absolute":
        changed = with_paper_map(vehicle, modes=modes)
    else:
        noise = vehicle.noise.without_hardware_errors()
        changed = vehicle.model_copy(update={"map": MapEntry(modes=modes), "noise": noise})
    problem = inverse_problem(changed, prior_snapshots, structure)
    solution = problem.solution
    built = inverse_map_of(changed, prior_snapshots, structure, problem, solution)
    assert built.provenance["modes"] == modes
    skipped = built.provenance["modes_skipped"]
    # Of the listed flows the third is blind; of rolled ones the second phase of a harmonic is.
    assert skipped or (form, modes) == ("dynamic_pressure", 3)
    assert 3 in skipped or form == "dynamic_pressure"
    assert built.residual_degrees_of_freedom == 54 - modes
    left_out = [line.partition(",")[0] for line in mode_choice_lines(built.provenance)[1:]]
    assert left_out == [f"left out: mode {mode}" for mode in skipped]
    # What is skipped is in the noise, with its load.
    assert [term.name for term in solution.noise.terms] == ["gauge noise", "truncated modes"]
    ordered, _, states, _ = ordered_modes(problem)
    whole = problem.modes
    assert len(states) == modes
    kept = [mode for mode in range(modes + len(skipped)) if mode + 1 not in skipped]
    assert states == kept
    np.testing.assert_array_equal(ordered.modes[:, :modes], whole.modes[:, kept])
    assert ordered.singular_values.sum() == pytest.approx(whole.singular_values.sum(), rel=1e-12)
    std = np.sqrt(np.diag(problem.noise[0].covariance))
    new = _new_strain(problem.strain_operator @ (whole.modes * whole.coefficient_std) / std[:, None], kept)
    for mode, size in new.items():
        assert (size >= MIN_STRAIN_OVER_NOISE) == (mode in kept), mode


def _new_strain(whitened: np.ndarray, kept: list[int]) -> dict[int, float]:
    """Return the strain of each mode up to the last kept that the kept ones before it do not explain."""
    found = {}
    for mode in range(kept[-1] + 1):
        before = whitened[:, [k for k in kept if k < mode]]
        rest = whitened[:, mode]
        if before.shape[1]:
            rest = rest - before @ np.linalg.lstsq(before, rest, rcond=None)[0]
        found[mode] = float(np.linalg.norm(rest))
    return found
