"""Seeded mutations: small errors of the product, and whether the tests find each.

    python tests/mutations/run.py              all of seeded.toml, which takes about an hour
    python tests/mutations/run.py c01 b05      some
    python tests/mutations/run.py --check      run nothing; whether each text still stands in its file

A mutation is put into a clone of the last commit, never into the working tree; of one in C, the libraries of this
machine are built there (extra ``native``). Of its tests, each path is run by itself up to the first failure. An
entry of ``seeded.toml`` states

- ``what`` is wrong then, the ``file``, the ``text`` that stands there (its first place if it is there twice), and
  what it is ``changed`` to;
- ``tests`` that are to find it, the likeliest first;
- ``found_by``, the test that found it when it was run last; "" of one that changes nothing, with ``why``.

The exit code is 1 where one is not found that has a ``found_by``, or a text is gone.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
SEEDED = Path(__file__).with_name("seeded.toml")

BUILD = """
import sys
from strainfmu.estimator.core import library_file as used
from strainfmu.fmu.native.build import PLATFORMS, build_library, library_file

platform = used().parent.name
for name in sys.argv[1:]:
    library_file(platform, name).write_bytes(build_library(platform, name))
    for other in set(PLATFORMS) - {platform}:  # of the sources as they were: an export would refuse them
        library_file(other, name).unlink(missing_ok=True)
"""

NO_TESTS = (4, 5)
"""Exit codes of pytest where a path has no tests."""

SHIPPED = ("test_build_from_sources.py", "test_library.py", "*platforms.py", "test_sanitizers.py")
"""Tests of the shipped libraries, which any change of the sources fails, or that build libraries of their own."""


@dataclass(frozen=True, kw_only=True)
class Mutation:
    """One entry of ``seeded.toml``, by the names there."""

    what: str
    file: str
    text: str
    changed: str
    tests: tuple[str, ...]
    found_by: str
    why: str = ""

    @property
    def libraries(self) -> tuple[str, ...]:
        """Libraries that the file is part of."""
        if not self.file.endswith(".c"):
            return ()
        folder = self.file.split("/")[2]
        return {"plant": ("plant",), "estimator": ("estimator",), "bus": ("estimator",)}.get(
            folder, ("estimator", "plant")
        )


def seeded() -> dict[str, Mutation]:
    """Return the mutations by name."""
    content = tomllib.loads(SEEDED.read_text("utf-8"))
    return {name: Mutation(**entry | {"tests": tuple(entry["tests"])}) for name, entry in content.items()}


def found_by(mutation: Mutation, clone: Path) -> str:
    """Return the test that finds ``mutation`` in ``clone``, "" for none."""
    environment = {**os.environ, "PYTHONPATH": str(clone), "PYTHONDONTWRITEBYTECODE": "1"}

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, *arguments]
        return subprocess.run(command, cwd=clone, env=environment, capture_output=True, text=True, check=False)

    file = clone / mutation.file
    before = file.read_text("utf-8")
    file.write_text(before.replace(mutation.text, mutation.changed, 1), "utf-8")
    try:
        if mutation.libraries:
            built = run("-c", BUILD, *mutation.libraries)
            if built.returncode:
                return f"the compiler: {built.stderr.strip().splitlines()[-1]}"
        options = ["-n", "0", "-x", "-q", "-rfE", "--tb=no", "-p", "no:cacheprovider"]
        options += [f"--ignore-glob=*/{name}" for name in SHIPPED]
        for path in mutation.tests:
            tested = run("-m", "pytest", *options, f"tests/{path}")
            failed = re.findall(r"^(?:FAILED|ERROR) tests/(.*?)(?: - .*)?$", tested.stdout, re.MULTILINE)
            if failed:
                return str(failed[0])
            if tested.returncode in NO_TESTS:
                print(f"tests/{path}: no test there: correct {SEEDED.name}", flush=True)
            elif tested.returncode:
                return f"pytest: {tested.stdout.strip().splitlines()[-1]}"
        return ""
    finally:
        subprocess.run(["git", "checkout", "-q", "--", "."], cwd=clone, check=True)


def main(arguments: list[str] | None = None) -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    every = seeded()
    parser.add_argument("names", nargs="*", metavar="NAME", help="of seeded.toml; all by default")
    parser.add_argument("--check", action="store_true", help="run nothing; whether each text stands in its file")
    given = parser.parse_args(arguments)
    unknown = set(given.names) - every.keys()
    if unknown:
        parser.error(f"NAME: expected a name in {SEEDED.name}, got {', '.join(sorted(unknown))}")
    chosen = {name: every[name] for name in given.names or every}
    gone = [name for name, one in chosen.items() if one.text not in (ROOT / one.file).read_text("utf-8")]
    for name in gone:
        file, text = chosen[name].file, chosen[name].text
        print(f"{name}: {file}: expected the text '{text}', not found: correct {SEEDED.name}")
    if given.check:
        return int(bool(gone))
    missed = 0
    with tempfile.TemporaryDirectory() as folder:
        clone = Path(folder) / "clone"
        subprocess.run(["git", "clone", "-q", "--shared", str(ROOT), str(clone)], check=True)
        for name in [one for one in chosen if one not in gone]:
            began, one = time.monotonic(), chosen[name]
            found = found_by(one, clone)
            missed += not found and bool(one.found_by)
            print(f"{name}  {one.what}: {found or 'NOT FOUND'}, {time.monotonic() - began:.0f} s", flush=True)
    return int(bool(gone or missed))


if __name__ == "__main__":
    sys.exit(main())
