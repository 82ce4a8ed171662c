"""Snippets of README and of every page of the documentation, run as they are written.

Each page has a folder of its own. It holds what the pages take for granted: a finished ``demo``, the vehicles that
are shipped, and the vehicle file of the second tutorial. Blocks of a page run one after the other; those in Python
share their names. Lines that are one command of strainfmu run in this process, which has imported what it needs.
"""

import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from snippets import KINDS, ROOT, Snippet, pages, snippets

from builder.aero.euler.planes import GRID_LEVELS
from strainfmu.cli.main import main
from strainfmu.estimator.map.inverse_map import load_inverse_map

PAGES = {page.relative_to(ROOT).as_posix(): snippets(page) for page in pages()}
RUNNING = {name: found for name, found in PAGES.items() if any(s.kind != "skip" for s in found)}
LONG = (
    *("docs/tutorials/your_vehicle.md", "docs/howto/choose_gauges_and_case.md", "docs/howto/run_campaigns.md"),
    *("docs/howto/bring_cfd.md", "docs/explanation/aerodynamics.md"),
)
"""Pages that solve flows for seconds; tests/pipeline/test_readme_flows.py runs their commands on less."""
AFTER_THE_TUTORIAL = ("docs/howto/choose_gauges_and_case.md",)
"""Pages that repeat the build of the second tutorial, in its ``results``: the files are reused."""
LINE_BY_LINE = ("strainfmu", "printf", "sed")
"""Commands that share nothing but files: a block of these alone can be run line by line."""
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?(?![\w])")
HEAD_START = 3.0
"""Seconds that a block in the background has before the next one begins."""


def environment() -> dict[str, str]:
    """Return what a user's shell has: the commands of this installation ahead of others."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("STRAINFMU_", "COVERAGE_"))}
    path = f"{Path(sys.executable).parent}{os.pathsep}{kept['PATH']}"
    return kept | {"PATH": path, "MPLBACKEND": "Agg", "COLUMNS": "120"}


def run_shell(snippet: Snippet, folder: Path, env: dict[str, str]) -> None:
    """Run a block as one script that ends at its first failing line; print what it prints."""
    command = ["bash", "-e", "-o", "pipefail", "-c", snippet.text]
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, timeout=1800, check=False)
    expected = int(snippet.value) if snippet.kind == "fails" else 0
    assert done.returncode == expected, f"{snippet}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
    print(done.stdout, end="")


def own_commands(line: str) -> list[list[str]]:
    """Return the commands of a line joined by ``&&``, where each is one of strainfmu and nothing else; or none."""
    lexer = shlex.shlex(line, posix=True, punctuation_chars=True)
    lexer.whitespace_split = True
    commands: list[list[str]] = [[]]
    for token in lexer:
        if token == "&&":
            commands.append([])
        elif set(token) <= set("();<>|&") or set(token) & set("$`*?~"):
            return []
        else:
            commands[-1].append(token)
    return commands if all(command[:1] == ["strainfmu"] for command in commands) else []


def run_lines(snippet: Snippet, folder: Path, env: dict[str, str]) -> None:
    """Run a block as :func:`run_shell` does, but commands of strainfmu in this process: a start takes seconds."""
    lines = [line for line in snippet.text.splitlines() if line.strip()]
    if not all(line.startswith(LINE_BY_LINE) and not line.endswith("\\") and "<<" not in line for line in lines):
        run_shell(snippet, folder, env)
        return
    code = 0
    for line in lines:
        assert code == 0, f"{snippet}: ahead of: {line}"
        commands = own_commands(line)
        if not commands:
            run_shell(replace(snippet, text=line, kind="run"), folder, env)
        for command in commands:
            with pytest.raises(SystemExit) as ended:
                main(command[1:])
            code = int(ended.value.code or 0)
            if code != 0:
                break
    assert code == (int(snippet.value) if snippet.kind == "fails" else 0), snippet


def run_python(snippet: Snippet, names: dict[str, Any]) -> None:
    """Run a block here; a traceback shows the line of the page."""
    code = compile("\n" * (snippet.line - 1) + snippet.text, str(ROOT / snippet.page), "exec")
    exec(code, names)


def check_output(snippet: Snippet, printed: str) -> None:
    """Compare what a block printed with the page: words, and numbers within five units of their last digit.

    A line of three dots on the page stands for any lines. Numbers that are zero but for rounding agree.
    """
    assert snippet.output is not None
    lines = [" ".join(line.split()) for line in printed.splitlines() if line.strip()]
    at, skips = 0, False
    for line in [" ".join(line.split()) for line in snippet.output.splitlines() if line.strip()]:
        if line == "...":
            skips = True
            continue
        agrees = [n for n in range(at, len(lines)) if same_line(line, lines[n])]
        assert agrees, f"{snippet}: expected {line!r} in\n{printed}"
        assert skips or agrees[0] == at, f"{snippet}: prints more than the page shows ahead of {line!r}\n{printed}"
        at, skips = agrees[0] + 1, False
    assert skips or at == len(lines), f"{snippet}: prints more than the page shows\n{printed}"


def same_line(shown: str, printed: str) -> bool:
    """Return whether two lines are the same, numbers within five units of the last digit that is ``shown``."""
    if NUMBER.sub("#", shown) != NUMBER.sub("#", printed):
        return False
    return all(map(same_number, NUMBER.findall(shown), NUMBER.findall(printed)))


def same_number(shown: str, printed: str) -> bool:
    """Return whether ``printed`` is what a page has ``shown``, or both are zero but for rounding."""
    digits, _, exponent = shown.lower().partition("e")
    unit = 10.0 ** (int(exponent or 0) - len(digits.partition(".")[2]))
    size = max(abs(float(shown)), abs(float(printed)))
    return size < 1e-5 or abs(float(shown) - float(printed)) <= 5.0 * unit * (1.0 + 1e-9)


def run_page(name: str, folder: Path, *, slow: bool) -> None:
    """Run the blocks of a page in ``folder``, those marked slow only if ``slow``."""
    names: dict[str, Any] = {"__name__": "__main__"}
    running: list[subprocess.Popen[bytes]] = []
    for snippet in PAGES[name]:
        if snippet.kind in ("skip", "clone") or (snippet.kind in ("slow", "background") and not slow):
            continue
        if snippet.kind == "background":
            command = ["bash", "-c", f"exec {snippet.text}"]
            running.append(subprocess.Popen(command, cwd=folder, env=environment()))
            time.sleep(HEAD_START)
            continue
        if snippet.kind == "file":
            (folder / snippet.value).write_text(snippet.text, encoding="utf-8")
            continue
        with redirect_stdout(StringIO()) as printed:
            if snippet.language == "sh":
                (run_shell if slow else run_lines)(snippet, folder, environment())
            else:
                run_python(snippet, names)
        if snippet.output is not None:
            check_output(snippet, printed.getvalue())
        while running:
            process = running.pop()
            process.send_signal(signal.SIGINT)
            assert process.wait(timeout=60) == 0, snippet


@pytest.fixture
def folder(tmp_path: Path, ic3x_demo: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of one page, which is the working directory."""
    shutil.copytree(ic3x_demo, tmp_path / "demo")
    shutil.copytree(ROOT / "builder" / "vehicles", tmp_path / "builder" / "vehicles")
    for snippet in PAGES["docs/tutorials/your_vehicle.md"]:
        if snippet.kind == "file":
            (tmp_path / snippet.value).write_text(snippet.text, encoding="utf-8")
    shutil.copy(ROOT / "docs" / "tutorials" / "rack.dbc", tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def after_the_tutorial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder in which the results of the second tutorial are kept, once its page has run."""
    return tmp_path_factory.mktemp("tutorial") / "results"


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.slow if name in LONG else ())
        for name in sorted(RUNNING, key=lambda name: name in AFTER_THE_TUTORIAL)
    ],
)
def test_page(name: str, folder: Path, after_the_tutorial: Path) -> None:
    """Pages that build a map take more than five seconds each: the commands are those of a reader.

    Pictures of reports are left out: no page needs them.
    """
    if name in AFTER_THE_TUTORIAL and after_the_tutorial.exists():
        shutil.copytree(after_the_tutorial, folder / "results")
    run_page(name, folder, slow=False)
    if name == "docs/tutorials/your_vehicle.md":
        shutil.copytree(folder / "results", after_the_tutorial)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [name for name, found in RUNNING.items() if any(s.kind in ("slow", "background") for s in found)]
)
def test_page_with_what_takes_long(name: str, folder: Path) -> None:
    run_page(name, folder, slow=True)


@pytest.mark.slow
def test_options_of_commands_reach_the_map(folder: Path) -> None:
    """Snapshots, structure and map, each by its own command as written; what they were made with is in the map."""
    (chain,) = [s for s in PAGES["docs/howto/bring_mesh.md"] if "strainfmu snapshots" in s.text]
    run_shell(chain, folder, environment())
    found = load_inverse_map(folder / "coarse" / "map.h5").provenance
    assert "--set P1 --grid coarse" in chain.text
    assert found["snapshots"] == 90
    assert found["flow"]["options"] == {"set": ["P1"], "grid": "coarse"}
    assert found["flow"]["sets"] == ["P1 (90)"]
    assert found["flow"]["marching_grid"]["n_radial"] == GRID_LEVELS["coarse"].n_radial
    assert "--resolution coarse" in chain.text
    assert found["structure"]["model"] == "swept_hexahedra"
    assert found["structure"]["resolution"] == "coarse"


@pytest.mark.slow
@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="a source archive has nothing to clone")
def test_first_command_of_the_readme(tmp_path: Path) -> None:
    (snippet,) = [s for s in PAGES["README.md"] if s.kind == "clone"]
    clone = tmp_path / "clone"
    subprocess.run(["git", "clone", "-q", str(ROOT), str(clone)], check=True)
    env = {name: value for name, value in environment().items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
    run_shell(snippet, clone, env)
    assert (clone / "demo" / "estimator.fmu").exists()


@pytest.mark.fast
def test_marks_are_known_and_what_is_skipped_has_a_reason() -> None:
    for snippet in [snippet for found in PAGES.values() for snippet in found]:
        assert snippet.kind in (*KINDS, "run"), snippet
        assert snippet.kind != "skip" or len(snippet.value.split()) >= 3, f"{snippet}: give a reason"
    skipped = [s for found in PAGES.values() for s in found if s.kind == "skip"]
    assert len(skipped) <= 20, [str(s) for s in skipped]


@pytest.mark.fast
@pytest.mark.parametrize("page", pages(), ids=lambda page: page.name)
def test_toml_on_a_page_is_toml_and_commands_stand_in_blocks_that_are_run(page: Path) -> None:
    lines = page.read_text(encoding="utf-8").splitlines()
    assert not [line for line in lines if line.startswith(("    strainfmu ", "\tstrainfmu "))]
    block: list[str] | None = None
    for line in lines:
        if line.startswith("```toml"):
            block = []
        elif line.startswith("```") and block is not None:
            tomllib.loads("\n".join(block))
            block = None
        elif block is not None:
            block.append(line)
