"""Packages of the extra "report": what a report is without where they are not installed."""

from __future__ import annotations

from importlib.util import find_spec

PACKAGES = {"matplotlib": "figures and PDF", "reportlab": "PDF"}
"""What each package is needed for."""


def without_packages(name: str) -> str:
    """Return the line on what the page ``name`` is without; empty where nothing is missing."""
    missing = [package for package in PACKAGES if find_spec(package) is None]
    if not missing:
        return ""
    return (
        f"{name}: without {PACKAGES[missing[0]]}, {' and '.join(missing)} missing: pip install 'strainfmu[report]'"
    )
