"""Seeded mutations: small errors in the product, each of which some test has to find. ``run.py`` runs them."""

from __future__ import annotations

from dataclasses import dataclass

ESTIMATOR, NATIVE = "fmus/native/estimator", "fmus/native"
GOLDEN = "golden/test_golden_streams.py"


@dataclass(frozen=True)
class Mutation:
    """An error that is put in.

    Attributes
    ----------
    what : what is wrong then.
    file : of the product.
    text, changed : what stands there, once, and what is put there; the first place counts where there are more.
    tests : paths in ``tests`` that are to find it, the likeliest first; each is run by itself.
    """

    what: str
    file: str
    text: str
    changed: str
    tests: tuple[str, ...]


def _of(what: str, file: str, text: str, changed: str, *tests: str) -> Mutation:
    return Mutation(what, file, text, changed, tests)


CORE = {
    "c01": _of(
        "sign: temperature gradient of the atmosphere",
        f"{NATIVE}/core/atmosphere.c",
        "+ gradient * rise;",
        "- gradient * rise;",
        "fmu/plant/test_plant.py",
    ),
}
