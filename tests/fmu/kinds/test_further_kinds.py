"""FMUs of every kind whose maps have a rolling moment and section loads: valid, and the numbers of numpy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from fmu_host import OPTIONS, exported_kinds, loaded
from further_maps import with_further
from scaled_maps import NOMINAL, scaled_map

from strainfmu.estimator.linear.estimator import Estimator
from strainfmu.fmu.checks.crosscheck import write_crosscheck
from strainfmu.interface.further_variables import further_outputs

pytestmark = pytest.mark.fast

N = 18


@pytest.fixture(scope="module")
def paths(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return exported_kinds(with_further(scaled_map(2, seed=4)), tmp_path_factory.mktemp("further"))


@pytest.mark.parametrize("kind", OPTIONS)
def test_no_faults_and_units(paths: dict[str, Path], kind: str) -> None:
    assert validate_fmu(str(paths[kind])) == []
    variables = {one.name: one for one in read_model_description(str(paths[kind])).modelVariables}
    index = "" if kind == "native_3" else "[1]"
    for name, unit in (
        ("M_R", "1"),
        ("moment.roll", "N.m"),
        (f"section.axial{index}", "N"),
        (f"sigma.section.torsion{index}", "N.m"),
    ):
        assert (variables[name].causality, variables[name].unit) == ("output", unit)


def test_an_importer_finds_the_reference(paths: dict[str, Path], tmp_path: Path) -> None:
    results = write_crosscheck(paths["native"], tmp_path)
    assert [one.outcome for one in results if one.importer.startswith("FMPy")] == ["passed"], results


def test_both_kinds_give_what_numpy_does(paths: dict[str, Path], tmp_path: Path) -> None:
    held = with_further(scaled_map(2, seed=4))
    random, estimator = np.random.default_rng(1), Estimator(held)
    for kind in ("native", "python"):
        with loaded(paths[kind], tmp_path / kind) as host:
            host.initialize()
            names = list(host.references)
            further = names[names.index("M_R") :][: 4 + 12]
            assert further[-1] == "sigma.section.torsion[1]"
            for k in range(6):
                strain = held.mean_strain + 1e-5 * random.normal(size=N)
                valid = np.arange(N) != k - 3
                expected = further_outputs(estimator.step(strain, NOMINAL, valid))
                host.set([f"strain[{i + 1}]" for i in range(N)], strain)
                host.set_booleans([f"valid[{i + 1}]" for i in range(N)], valid.tolist())
                rtol = 1e-10
                np.testing.assert_allclose(host.get(further), expected, rtol=rtol, atol=0.0)
