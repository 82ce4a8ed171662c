"""Coverage of the loads with gauges lost: rows, directions, halves drawn, down to three gauges.

Every sample is of a vehicle of its own, built with errors drawn, at one of many flight conditions of the
independent model. A load counts as covered where it is within three of its standard deviations of the truth or is
not given. The nonlinear estimator finds the flight by a search of its tables, which is where mirror images of the
flow may be taken for it.

    python -m builder.stress.masks VEHICLE MAP FLOWS
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from rich.console import Console

from builder.pipeline.progress_bars import ConsoleReporter
from builder.pipeline.trial_run import world_of_files
from builder.reporting import Progress
from builder.stress.study import run_study, study_parser
from builder.trial.estimators import known_by
from builder.trial.levels import level_readings
from builder.trial.readings import Readings
from builder.trial.score import SIGMAS
from builder.trial.world import World
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap, load_inverse_map

HALVES = 500
"""Random halves of the gauges."""

FEW, OF_FEW = (3, 4, 5, 6, 8, 10, 12, 16, 20), 20
"""Numbers of gauges that are left, and the sets of each that are drawn."""

SAMPLES, OF_DRAWN = 2000, 200
"""Samples of a mask by rows and directions, and of one that is drawn."""

CONDITIONS_PER_VEHICLE = 2
"""Samples of one flight condition."""

TARGET = 99.0
"""Coverage [%] that is aimed at for every load."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Mask:
    """Gauges in use ``used`` (n_d,), by ``name``, of a class ``group``; whether the set is ``drawn``."""

    group: str
    name: str
    used: BoolArray
    drawn: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class MaskScore:
    """Score of one mask: in ``samples`` samples, ``inside`` (5,) of each coefficient and of each force and moment
    where they are given, ``unidentified`` without, and the root mean square ``rms_z`` (5,) of errors over their
    standard deviations."""

    mask: Mask
    samples: int
    inside: FloatArray
    unidentified: int
    detected: int
    undetected: int
    rms_z: FloatArray

    @property
    def coverage(self) -> FloatArray:
        """(5,) covered samples [%] of those with loads; 100 where there are none."""
        given = self.samples - self.unidentified
        return np.asarray(100.0 * self.inside / given) if given else np.full(len(self.inside), 100.0)


def gauge_rows(inverse_map: InverseMap) -> tuple[FloatArray, BoolArray]:
    """Return the roll angle (n_d,) [deg] of the meridian that each gauge is on, and whether it reads along the
    axis."""
    _, y, z = inverse_map.gauge_position.T
    roll = np.round(np.mod(np.degrees(np.arctan2(y, z)), 360.0), 3) % 360.0
    return np.asarray(roll), np.abs(inverse_map.gauge_direction[:, 0]) > np.sqrt(0.5)


def masks_of(inverse_map: InverseMap, random: np.random.Generator, halves: int = HALVES) -> Iterator[Mask]:
    """Yield masks of a layout: rows and pairs of rows lost, one direction lost, and random sets of gauges left."""
    roll, axial = gauge_rows(inverse_map)
    n_d, rows = len(roll), [float(one) for one in np.unique(roll)]
    yield Mask(group="all gauges", name="", used=np.ones(n_d, dtype=bool), drawn=False)
    for count in range(1, len(rows)):
        for lost in combinations(rows, count):
            name = " and ".join(f"{one:g}" for one in lost) + " deg lost"
            yield Mask(
                group=f"{count} of {len(rows)} rows lost", name=name, used=~np.isin(roll, lost), drawn=False
            )
    for direction, kept in (("hoop", axial), ("axial", ~axial)):
        if not 0 < kept.sum() < n_d:
            continue
        yield Mask(group="one direction lost", name=f"all {direction}", used=kept, drawn=False)
        for row in rows:
            yield Mask(
                group="one direction of a row lost",
                name=f"{direction} at {row:g} deg",
                used=kept | (roll != row),
                drawn=False,
            )
            if np.any(used := kept & (roll != row)):
                yield Mask(
                    group="a direction and a row lost",
                    name=f"all {direction}, {row:g} deg",
                    used=used,
                    drawn=False,
                )
    for count, number, group in (
        (n_d // 2, halves, "random half left"),
        *((few, OF_FEW, f"random {few} left") for few in FEW if few < n_d),
    ):
        for _ in range(number):
            kept = np.sort(random.choice(n_d, size=count, replace=False))
            name = " ".join(str(one + 1) for one in kept)
            yield Mask(group=group, name=name, used=np.isin(np.arange(n_d), kept), drawn=True)


def score(estimator: Estimator, flights: Readings, mask: Mask, rows: slice) -> MaskScore:
    """Return the score of the samples ``rows`` of ``flights`` with the gauges of ``mask`` alone."""
    part = flights.rows(rows)
    truth, strain = part.truth, np.where(mask.used, part.strain, np.nan)
    found = estimator.estimate(strain, **known_by(estimator, part.known))
    error = np.abs(found.coefficients - truth)
    with np.errstate(invalid="ignore"):
        z = error / found.coefficients_std
    given = np.isfinite(z).all(axis=1)
    wrong = given & (z > SIGMAS).any(axis=1)
    health = np.asarray(found.health)
    return MaskScore(
        mask=mask,
        samples=len(truth),
        inside=np.sum(z[given] <= SIGMAS, axis=0).astype(float),
        unidentified=int(np.sum(~given)),
        detected=int(np.sum(~np.isin(health, (HealthState.OK, HealthState.DEGRADED)))),
        undetected=int(np.sum(wrong & np.isin(health, (HealthState.OK, HealthState.DEGRADED)))),
        rms_z=np.sqrt(np.mean(z[given] ** 2, axis=0)) if given.any() else np.full(z.shape[1], np.nan),
    )


def scores(
    estimator: Estimator,
    flights: Readings,
    masks: Sequence[Mask],
    *,
    samples: int = SAMPLES,
    of_drawn: int = OF_DRAWN,
    progress: Progress | None = None,
) -> list[MaskScore]:
    """Return the scores of ``masks``; each that is drawn has the next ``of_drawn`` of the flights' samples.

    The worst of many masks is below the target by chance: one that is has ``samples`` of them.
    """
    found, next_row = list[MaskScore](), 0
    for done, mask in enumerate(masks, start=1):
        count = min(of_drawn if mask.drawn else samples, len(flights.strain))
        first = next_row if next_row + count <= len(flights.strain) else 0
        one = score(estimator, flights, mask, slice(first, first + count))
        if mask.drawn and one.coverage.min() < TARGET:
            one = score(estimator, flights, mask, slice(0, samples))
        found.append(one)
        next_row = first + count if mask.drawn else next_row
        if progress is not None:
            progress(done, len(masks))
    return found


def table(found: Sequence[MaskScore]) -> list[str]:
    """Return the lines of a table: of each class of masks the lowest coverage of a load, and the worst mask."""
    groups: Mapping[str, list[MaskScore]] = {one.mask.group: [] for one in found}
    for one in found:
        groups[one.mask.group].append(one)
    head = (
        f"{'gauges':30s}{'masks':>6s}{'covered':>9s}{'load':>5s}{'of a mask':>11s}"
        f"{'none':>7s}{'alarms':>8s}{'undetected':>11s}{'rms z':>7s}  worst mask"
    )
    lines = [head]
    for group, members in groups.items():
        samples, none = sum(one.samples for one in members), sum(one.unidentified for one in members)
        inside = sum((one.inside for one in members), start=np.zeros(len(COEFFICIENT_NAMES)))
        pooled = 100.0 * inside / max(samples - none, 1) if samples > none else np.full(len(inside), 100.0)
        load = int(np.argmin(pooled))
        worst = min(members, key=lambda one: float(one.coverage.min()))
        rms_z = float(np.nanmax([np.nan_to_num(one.rms_z).max() for one in members]))
        lines.append(
            f"{group:30s}{len(members):6d}{pooled[load]:9.2f}{COEFFICIENT_NAMES[load]:>5s}"
            f"{worst.coverage.min():11.2f}{100.0 * none / samples:7.1f}"
            f"{100.0 * sum(one.detected for one in members) / samples:8.2f}"
            f"{100.0 * sum(one.undetected for one in members) / samples:11.2f}{rms_z:7.2f}"
            f"  {worst.mask.name[:60]} ({COEFFICIENT_NAMES[int(np.argmin(worst.coverage))]})"
        )
    below = [one for one in found if one.coverage.min() < TARGET]
    return [*lines, f"{len(below)} of {len(found)} masks with a load covered in less than {TARGET:g} %"]


def read(world: World, *, samples: int, seed: int) -> Readings:
    """Return what all gauges read in ``samples`` samples of the independent model."""
    conditions = max(1, samples // CONDITIONS_PER_VEHICLE)
    return level_readings(world, seed=seed, vehicles=CONDITIONS_PER_VEHICLE, conditions=conditions)


def main() -> None:
    """Print a table for each estimator of the map."""
    parser = study_parser("masks", __doc__)
    parser.add_argument("--samples", type=int, default=SAMPLES, help="of each mask by rows and directions")
    parser.add_argument("--of-drawn", type=int, default=OF_DRAWN, help="samples of each mask that is drawn")
    parser.add_argument("--halves", type=int, default=HALVES, help="random halves of the gauges")
    options = parser.parse_args()
    if min(options.samples, options.of_drawn) < 1 or min(options.halves, options.seed) < 0:
        raise InputError("expected --samples and --of-drawn from 1 on, --halves and --seed from 0 on")
    inverse_map = load_inverse_map(options.map)
    masks = list(masks_of(inverse_map, np.random.default_rng(options.seed), options.halves))
    reporter = ConsoleReporter(Console(stderr=True))
    flights = read(
        world_of_files(options.vehicle, options.map, options.flows),
        samples=max(options.samples, 20 * options.of_drawn),
        seed=options.seed,
    )
    estimators = {"linear": Estimator(inverse_map.without_tables())}
    if inverse_map.manifold is not None:
        estimators["nonlinear"] = Estimator(inverse_map)
    for name, estimator in estimators.items():
        with reporter.stage(f"Masks, {name} estimator") as progress:
            found = scores(
                estimator,
                flights,
                masks,
                samples=options.samples,
                of_drawn=options.of_drawn,
                progress=progress,
            )
        print("\n".join([f"{name} estimator", *table(found), ""]))


if __name__ == "__main__":
    run_study(main)
