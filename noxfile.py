"""The project's commands, each in an environment of its own: ``nox -l`` lists them."""

from __future__ import annotations

import tarfile
from pathlib import Path

import nox

nox.needs_version = ">=2025.2"
nox.options.default_venv_backend = "venv"
nox.options.reuse_existing_virtualenvs = True
nox.options.sessions = ["lint", "fast"]

OGIVE = Path("tests/acceptance/ogive/ogive.toml").absolute()


@nox.session
def lint(session: nox.Session) -> None:
    """Linter, formatter, types and the layers of the packages; nothing is changed."""
    session.install("-e", ".[all,test]")
    session.run("ruff", "check", ".")
    session.run("ruff", "format", "--check", ".")
    session.run("mypy")
    session.run("lint-imports")


@nox.session
def fast(session: nox.Session) -> None:
    """Tests of every package in less than a minute."""
    session.install("-e", ".[all,test]")
    session.run("pytest", "-m", "fast", *session.posargs)


@nox.session
def test(session: nox.Session) -> None:
    """The whole suite with coverage."""
    session.install("-e", ".[all,test]")
    session.run("pytest", "--cov", "--cov-report=term:skip-covered", *session.posargs)


@nox.session
def slow(session: nox.Session) -> None:
    """The tests that take minutes; those of the native libraries need zig."""
    session.install("-e", ".[all,native,test]")
    session.run("pytest", "-m", "slow", *session.posargs)


@nox.session
def docs(session: nox.Session) -> None:
    """The documentation site; a warning is an error."""
    session.install("-e", ".[docs]")
    session.run("python", "-m", "sphinx", "-W", "docs", "docs/_build/html")


@nox.session
def build(session: nox.Session) -> None:
    """Source archive and wheel from it, checked; a demonstration by the wheel, the fast tests from the archive."""
    # cffconvert imports pkg_resources, which setuptools no longer brings.
    session.install("build", "twine", "check-wheel-contents", "cffconvert", "setuptools<81")
    folder = Path(session.create_tmp()).absolute()
    session.run("cffconvert", "--validate")
    session.run("python", "-m", "build", "--outdir", str(folder / "dist"))
    wheel = newest(folder / "dist", "*.whl")
    archive = newest(folder / "dist", "*.tar.gz")
    session.run("twine", "check", "--strict", str(wheel), str(archive))
    session.run("check-wheel-contents", str(wheel))
    with tarfile.open(archive) as packed:
        packed.extractall(folder, filter="data")
    unpacked = folder / archive.name.removesuffix(".tar.gz")
    session.run("python", "-m", "venv", "--clear", str(folder / "clean"))
    python, strainfmu = (str(folder / "clean" / "bin" / name) for name in ("python", "strainfmu"))
    session.run(python, "-m", "pip", "install", "-q", f"{wheel}[all]", external=True)
    session.chdir(folder)  # where no checkout is in the way of the installed packages
    session.run(strainfmu, "demo", "--vehicle", str(OGIVE), "-o", "demo", external=True)
    session.chdir(unpacked)
    session.run(python, "-m", "pip", "install", "-q", "-e", ".[all,test]", external=True)
    session.run(python, "-m", "pytest", "-m", "fast", external=True)


def newest(folder: Path, pattern: str) -> Path:
    """Return the file of the folder that fits the pattern and was written last."""
    return max(folder.glob(pattern), key=lambda path: path.stat().st_mtime)
