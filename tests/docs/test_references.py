"""Names on the pages: paths, modules and files that README and documentation speak of exist."""

import re
from dataclasses import fields
from functools import cache
from importlib import import_module
from inspect import getsource, signature
from pathlib import Path
from typing import Any

import pytest
from snippets import ROOT, pages

from builder.aero.euler.scheme import flux
from builder.campaign import snapshots
from builder.reports.build_report import build_page
from builder.structure import structure_file
from builder.truth import flow_table
from strainfmu.cosim.models import flight_model
from strainfmu.cosim.systems import recording
from strainfmu.estimator.map import inverse_map
from strainfmu.estimator.map.schema import MapRecord, entries
from strainfmu.fmu.description import model_description

pytestmark = pytest.mark.fast

TOP = ("strainfmu", "builder", "fmus", "tests", "docs")
PATH = re.compile(rf"(?<![\w./-])((?:{'|'.join(TOP)})/[\w./*-]+)")
DOTTED = re.compile(r"(?<![\w./-])((?:strainfmu|builder)(?:\.\w+)+)(?![\w/-])")
FILE = re.compile(r"`(?:[\w/]+/)?(\w+\.(?:py|c|h))`")
LINK = re.compile(r"\]\(([^)#:]+)(?:#[\w-]+)?\)")

SCHEMAS = {"strainfmu.inverse_map", "strainfmu.snapshots", "strainfmu.structure", "strainfmu.recording"}
SCHEMAS |= {"strainfmu.flight_model", "strainfmu.flow_table"}
"""Names of the files' schemas, which look like modules."""


VERSIONED: tuple[Any, ...] = (snapshots, structure_file, flow_table, flight_model, recording, inverse_map)
"""Modules of files with a version."""


@cache
def file_names() -> frozenset[str]:
    """Return the names of all files of the packages, tests and documentation."""
    return frozenset(path.name for top in TOP for path in (ROOT / top).rglob("*.*"))


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.relative_to(ROOT).as_posix())
def test_paths_exist(page: Path) -> None:
    missing = []
    for found in PATH.findall(page.read_text(encoding="utf-8")):
        path = found.rstrip(".")
        if path.startswith("docs/_build"):  # what a build of the site writes
            continue
        if not (list(ROOT.glob(path)) if "*" in path else (ROOT / path).exists()):
            missing.append(path)
    assert not missing


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_to_files_lead_somewhere(page: Path) -> None:
    gallery = ROOT / "docs" / "gallery"  # made by the build
    targets = [page.parent / link for link in LINK.findall(page.read_text(encoding="utf-8"))]
    missing = []
    for target in targets:
        if gallery in target.resolve().parents:
            target = ROOT / "docs" / "gallery_src" / f"{target.name}.py"
            if target.name == "index.py":
                continue
        if not target.exists():
            missing.append(target)
    assert not missing


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.relative_to(ROOT).as_posix())
def test_modules_and_their_names_exist(page: Path) -> None:
    missing = []
    for name in DOTTED.findall(page.read_text(encoding="utf-8")):
        if name not in SCHEMAS and not _exists(name):
            missing.append(name)
    assert not missing


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.relative_to(ROOT).as_posix())
def test_files_named_alone_exist(page: Path) -> None:
    named = set(FILE.findall(page.read_text(encoding="utf-8")))
    assert not named - file_names()


def test_versions_of_files_are_those_of_the_code() -> None:
    """Every file that the page of files gives a version of, and the version of report.json."""
    text = (ROOT / "docs" / "reference" / "files.md").read_text(encoding="utf-8")
    stated = {schema: int(version) for schema, version in re.findall(r"`(strainfmu\.\w+)`, version (\d+)", text)}
    assert stated == {one.SCHEMA: one.SCHEMA_VERSION for one in VERSIONED}
    for page in ("reference/files.md", "explanation/reports.md"):
        (version,) = re.findall(r"`schema_version` (\d+)", (ROOT / "docs" / page).read_text(encoding="utf-8"))
        assert int(version) == build_page.SCHEMA_VERSION, page


def test_every_data_set_of_a_map_is_in_its_schema() -> None:
    """The page of files, what is checked and the units in files follow from the schema."""
    for record in MapRecord.__subclasses__():
        assert [one.name for one in fields(record) if one.name not in entries(record)] in ([], ["provenance"])


def test_the_first_step_of_a_pressure_is_the_function_that_turns_it_parallel_to_the_wall() -> None:
    text = (ROOT / "docs" / "developers" / "way_of_a_pressure.md").read_text(encoding="utf-8")
    named = re.search(r"^\| 1 \| `builder\.aero\.euler\.scheme\.flux\.(\w+)`", text, re.MULTILINE)
    assert named is not None
    assert "pressure_at_wall" in signature(getattr(flux, named[1])).parameters


def test_theory_sends_the_objective_to_a_module_that_states_it() -> None:
    text = (ROOT / "docs" / "explanation" / "theory.md").read_text(encoding="utf-8")
    row = re.search(r"`eq:objective` \| `([\w.]+)` \|", text)
    assert row is not None
    assert "minimises |L^-1 (d - m - A q)|^2" in getsource(import_module(row[1]))


def test_the_module_of_the_model_description_states_both_kinds_of_fmus() -> None:
    assert model_description.__doc__ is not None
    assert all(kind in model_description.__doc__ for kind in ("co-simulation", "model exchange"))


def _exists(dotted: str) -> bool:
    """Tell whether ``dotted`` is a module, or a name in one."""
    parts = dotted.split(".")
    for length in range(len(parts), 0, -1):
        try:
            thing = import_module(".".join(parts[:length]))
        except ModuleNotFoundError:
            continue
        for name in parts[length:]:
            if not hasattr(thing, name) and name not in getattr(thing, "__annotations__", {}):
                return False
            thing = getattr(thing, name, None)
        return True
    return False
