"""The help of the program and of every command: panels, pages, and options that go together.

Its words and sentences have the limits in ``tests/docs/test_word_budgets.py``.
"""

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from strainfmu.cli.commands import program
from strainfmu.cli.commands.command import check_together, unwrapped
from strainfmu.cli.commands.help_layout import COMMANDS, EXCLUDES, MODULES, NEEDS, OPTIONS, PAGES
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]

ROOT = Path(__file__).parents[2]
# get_command returns the group of all commands; its type is that of any command.
PROGRAM: dict[str, Any] = get_command(program()).commands  # type: ignore[attr-defined]


def parameter(command: str, name: str) -> Any:
    return next(one for one in PROGRAM[command].params if one.name == name)


def option(command: str, name: str) -> str:
    return str(max(parameter(command, name).opts, key=len))


def test_the_program_shows_five_panels_and_the_use_of_a_map_first(run: Run) -> None:
    code, out, _ = run("--help")
    titles = re.findall(r"─ ([A-Z][A-Za-z ]+) ─", out)
    assert (code, titles) == (0, ["Options", "Use a map", "Build", "Ground test", "Bus", "Studies"])
    assert set(PAGES) == set(MODULES) == set(PROGRAM)
    rows = [line.split()[1] for line in out.splitlines() if re.match(r"│ [a-z]", line)]
    assert rows == [name for names in COMMANDS.values() for name in names]


def test_help_imports_nothing_that_computes() -> None:
    """Of the program and of every command; a command imports its own module alone."""
    script = (
        "import sys\n"
        "from contextlib import redirect_stdout, suppress\n"
        "from io import StringIO\n"
        "from strainfmu.cli.main import main\n"
        "def shown(*arguments):\n"
        "    with redirect_stdout(StringIO()), suppress(SystemExit):\n"
        "        main([*arguments, '--help'])\n"
        "    return {name.rpartition('.')[2] for name in sys.modules}\n"
        "assert not shown('estimate') & {'whole_way', 'maps', 'load_tests'}\n"
        f"for command in {sorted(PAGES)}:\n"
        "    shown(command)\n"
        "heavy = {'numpy', 'scipy', 'h5py', 'numba', 'pydantic', 'pyarrow', 'matplotlib', 'dask', 'can'}\n"
        "print(*heavy & shown())\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


@pytest.mark.parametrize("command", PAGES)
def test_a_command_names_its_page_and_no_type_of_a_flag(command: str, run: Run) -> None:
    assert (ROOT / PAGES[command]).is_file()
    code, out, _ = run(command, "--help")
    assert (code, f"Documentation: {PAGES[command]}" in out) == (0, True)
    assert not re.search(r"<bool>|BOOLEAN|<list", out)
    panels = re.findall(r"─ ([A-Z][\w ()]+) ─", out)
    assert {"Options", *OPTIONS.get(command, {})} <= set(panels)


def test_layout_and_rules_name_parameters_of_the_commands() -> None:
    """And an option stands in one panel."""
    for command, panels in OPTIONS.items():
        names = [name for options in panels.values() for name in options]
        assert len(names) == len(set(names)), command
        assert set(names) <= {one.name for one in PROGRAM[command].params}, command


def test_a_paragraph_becomes_one_line_with_its_indent() -> None:
    text = "One\ntwo.\n\n    command --a\n    --b\n\nThree\n"
    assert unwrapped(text) == "One two.\n\n    command --a --b\n\nThree"


def test_options_that_need_or_exclude_others_say_so() -> None:
    for command, rules in NEEDS.items():
        for name, needed in rules.items():
            said = parameter(command, name).help
            assert any(option(command, one) in said for one in needed) or "options below" in said, (command, name)
    for command, groups in EXCLUDES.items():
        for group in groups:
            for name in group if command not in ("stress", "trial", "loadtest") else ():
                said = parameter(command, name).help
                assert all(option(command, one) in said for one in group if one != name), (command, name)


@pytest.mark.parametrize("command", sorted({*NEEDS, *EXCLUDES}))
def test_options_that_do_not_go_together_are_refused(command: str) -> None:
    options = {one.name: max(one.opts, key=len) for one in PROGRAM[command].params}
    for name, needed in NEEDS.get(command, {}).items():
        with pytest.raises(
            InputError, match=f"^{options[name]}: expected with {options[needed[0]]}.*, got it alone"
        ):
            check_together(command, {name}, options)
    for group in EXCLUDES.get(command, ()):
        with pytest.raises(
            InputError, match=f"^{options[group[-1]]}: expected without {options[group[0]]}, got both"
        ):
            check_together(command, {group[0], group[-1]}, options)
        check_together(command, {group[0], *NEEDS.get(command, {}).get(group[0], ())}, options)


@pytest.mark.parametrize("command", ["build v.toml", "demo", "stress"])
@pytest.mark.parametrize("words", ["--estimator manifold", "--estimator=manifold"])
def test_the_old_name_of_an_estimator_is_answered_with_the_new_one(command: str, words: str, run: Run) -> None:
    code, _, errors = run(*command.split(), *words.split())
    name = command.split()[0]
    text = f"--estimator: 'manifold' is now called 'nonlinear'; see 'strainfmu {name} --help'"
    assert (code, errors) == (2, f"strainfmu: {text}\n")


@pytest.mark.parametrize(
    ("arguments", "help_of"),
    [
        (("estimate",), "strainfmu estimate --help"),
        (("estimate", "a.h5", "b.csv", "-o", "c.csv", "--fitler", "3"), "strainfmu estimate --help"),
        (("estimate", "a.h5", "b.csv", "-o", "c.csv", "--smooth"), "strainfmu estimate --help"),
        (("demo", "--can-duration", "4"), "strainfmu demo --help"),
        (
            ("bridge", "a.fmu", "--interface", "virtual", "--channel", "x", "--set", "trust.max_age_cycles=0"),
            "strainfmu bridge --help",
        ),
        (("estimat",), "strainfmu --help"),
        (("--foo",), "strainfmu --help"),
    ],
)
def test_a_wrong_use_names_the_help_of_its_command(arguments: tuple[str, ...], help_of: str, run: Run) -> None:
    code, _, errors = run(*arguments)
    assert (code, errors.count("\n")) == (2, 1)
    assert re.search(rf"[Ss]ee '{help_of}'\n$", errors)
