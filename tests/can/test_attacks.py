"""Several faults at once, against a sender and an oracle that share no code with the product.

True ages lie within the stated age and its uncertainty, no strains are mixed, every frame is accounted for, and
the bridge comes back or says what it waits for.
"""

from collections import Counter

import numpy as np
import pytest
from attacked_bus import KINDS, LONG_KINDS, PERIOD, Act, Found, campaign, draw_acts, run_scenario
from sweeps import sweep

FOREIGN = frozenset({"foreign first", "foreign behind", "second sender"})


def assert_nothing_false(found: Found) -> None:
    assert found.too_old == []
    assert found.too_young == []
    assert found.beyond == []
    assert found.mixed == []
    assert found.unaccounted == 0
    assert not found.is_late, found.last


PROFILES = ("fd64", "classic-le", "fd64-sec")

FOUND = (
    ("fd64", 2009, "the clock goes back in a silence, the counter jumps"),
    ("fd64", 2080, "a frozen sender behind a delay that shrinks"),
    ("fd64", 2159, "a loop whose cycles were refused by their counter"),
    ("fd64", 3446, "delay, clock and counter change in the same cycle"),
    ("fd64", 4350, "a restart that looks like a clock that goes on"),
    ("fd64", 10160, "a frozen sender behind a torn cycle"),
    ("fd64", 10372, "so many steps of the clock that the sender seems to have no period"),
    ("classic-le", 10491, "a restart that meets the clock of a recording"),
    ("classic-le", 30074, "a frozen sender, among cycles that come again"),
    ("classic-le", 40047, "a restart that meets the clock of a recording of the start before, 40 ms late"),
    ("classic-le", 63_000_437, "flipped bits: a result of the run before seems to answer the new one"),
    ("fd64-sec", 3165, "the clock goes back while an old recording is let in"),
    ("fd64-sec", 3590, "the first frames of a restarted sender come together"),
    ("fd64-sec", 3652, "the clock goes back to its first second, under jitter"),
    ("fd64-sec", 3960, "a stimulus that a restarted sender repeats"),
)
FOUND_AMONG_ALL = (
    ("fd64", 70_002_175, "a frozen sender behind a pause of more than half the range of its sample times"),
    ("fd64", 70_003_273, "a sender that restarts with strains of before"),
)
"""The same where pauses and creep are among the faults."""
ALL_KINDS = (*KINDS, *LONG_KINDS)


@pytest.mark.parametrize(
    ("profile", "seed", "what", "kinds"),
    [*((*row, KINDS) for row in FOUND), *((*row, ALL_KINDS) for row in FOUND_AMONG_ALL)],
)
def test_what_once_was_wrong(profile: str, seed: int, what: str, kinds: tuple[str, ...]) -> None:
    found = run_scenario(profile, seed, draw_acts(seed, kinds))
    assert found.n_valid > 0, what
    assert_nothing_false(found)


EACH = [(kind, profile) for kind in ALL_KINDS for profile in PROFILES]


@pytest.mark.parametrize(("kind", "profile"), sweep(EACH, [EACH[3 * k + k % 3] for k in range(len(EACH) // 3)]))
def test_one_kind_of_fault(kind: str, profile: str) -> None:
    """A seed for each profile, pauses of two minutes at most; the slow campaign has more and longer ones."""
    seed, largest = PROFILES.index(profile), 0.3 if "pause" in kind else 1.0
    random = np.random.default_rng((seed, 5))
    end = 63 + int(random.integers(60))
    found = run_scenario(profile, seed, [Act(kind, 60, end, largest * random.random())])
    assert_nothing_false(found)
    assert found.n_valid > 50
    # A foreign frame that comes first is found by the true one behind it: then it counts for long.
    assert found.foreign <= (profile != "fd64-sec" and kind in FOREIGN)


@pytest.mark.parametrize("profile", sweep(PROFILES, ["fd64"]))
def test_two_to_five_faults_at_once(profile: str) -> None:
    total = campaign(profile, range(4), report=lambda _, found: assert_nothing_false(found))
    assert total["cycles"] > 900
    assert total["valid"] > 500


@pytest.mark.slow
def test_two_hundred_thousand_cycles() -> None:
    late, total = list[int](), Counter[str]()
    for profile in PROFILES:
        total += campaign(
            profile,
            range(1000, 1250),
            report=lambda seed, f: late.append(seed) if f.is_late else None,
            kinds=ALL_KINDS,
        )
    print(dict(total), late)
    assert total["cycles"] > 200_000
    wrong = ("too_old", "too_young", "beyond", "mixed", "unaccounted")
    assert [total[name] for name in wrong] == [0] * len(wrong)
    assert len(late) <= 0.01 * total["scenarios"]


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize(
    "act",
    [
        Act("steps with delay", 60, 160, 0.95),
        Act("restart under delay", 60, 65, 0.3),
        Act("restart under delay", 60, 65, 0.521),  # 260 cycles: counters of 8 bits come round
    ],
    ids=lambda act: f"{act.kind} {act.size:g}",
)
def test_whatever_clocks_do_an_age_is_at_most_the_time_since_the_result_that_was_heard(
    profile: str, act: Act
) -> None:
    """Delay and clock grow by as much in a cycle, or a run begins under a delay: nothing is older than stated."""
    found = run_scenario(profile, 0, [act])
    assert_nothing_false(found)
    assert found.largest_uncertainty < 5 * PERIOD


FROZEN = (
    (
        *("classic-le", 9_420_076, "beside a gauge without value: all others repeat their readings"),
        [Act("freeze", 87, 114, 0.05), Act("steps with delay", 60, 93, 0.4), Act("no value", 63, 90, 0.66)],
    ),
    (
        *("fd64", 9_510_652, "behind a recording, whose readings were others"),
        [Act("freeze", 72, 108, 0.5), Act("large step ahead", 66, 119, 0.45), Act("recording", 60, 74, 0.48)],
    ),
    (
        *("classic-le", 9_720_100, "whose clock is set ahead by less than a cycle: it is no older than by ours"),
        [Act("small step ahead", 76, 128, 0.621), Act("freeze", 75, 130, 0.325)],
    ),
    (
        *("fd64-sec", 9_930_361, "whose frames were held and come at once: for us hardly any time has passed"),
        [Act("step under delay", 64, 74, 0.92), Act("freeze", 72, 90, 0.7)],
    ),
    (
        *("fd64", 9_930_361, "whose frames are delayed from now on: they are no older than by its clock"),
        [Act("delay", 72, 90, 0.18), Act("freeze", 72, 90, 0.7)],
    ),
    (
        *("fd64", 42, "whose clock was set with the first repetition, and whose frames come at once"),
        [Act("freeze", 95, 142, 0.11), Act("step under delay", 95, 154, 0.518), Act("delay", 83, 100, 0.519)],
    ),
    (
        *("classic-le", 44, "behind a recording, whose clock was set back meanwhile"),
        [Act("freeze", 78, 135, 0.547), Act("recording", 74, 91, 0.048), Act("step back", 84, 91, 0.547)],
    ),
    (
        *("fd64", 61_280_383, "of whose small frame some are lost: three readings repeat by chance"),
        [Act("freeze", 70, 81, 0.851), Act("loss", 62, 86, 0.639)],
    ),
    (
        *("fd64", 61_280_537, "behind a silence, the small frame alone"),
        [Act("freeze", 83, 94, 0.374), Act("reorder", 88, 147, 0.871), Act("silence", 75, 88, 0.22)],
    ),
)


@pytest.mark.parametrize(("profile", "seed", "what", "acts"), FROZEN)
def test_a_frozen_sender_is_not_used_beyond_the_largest_age(
    profile: str, seed: int, what: str, acts: list[Act]
) -> None:
    found = run_scenario(profile, seed, acts)
    assert_nothing_false(found)
    assert found.beyond == [], what


def test_a_recording_that_seems_to_go_on_names_results_of_before() -> None:
    """Meanwhile the clock was set back by as much as the counter needs to come round."""
    acts = [Act("recording", 77, 97, 0.05), Act("step back", 73, 105, 0.92346), Act("creep", 65, 96, 0.6015)]
    found = run_scenario("fd64", 61_290_286, acts)
    assert_nothing_false(found)
    assert found.beyond == []


def test_strains_whose_state_is_of_the_run_before_are_not_used() -> None:
    """Its start goes on from the new run's, and the result of a silence comes between state and strains."""
    acts = [Act("restart behind a pause", 90, 117, 0.7777), Act("same stimulus again", 93, 98, 0.8024944107105458)]
    found = run_scenario("fd64", 66_000_096, acts)
    assert_nothing_false(found)
    assert found.beyond == []
    assert found.n_valid > 200


def test_of_results_that_look_alike_the_oldest_is_named() -> None:
    """`Verdict` of classic-le counts to 15: a recording of this run names results of both times."""
    found = run_scenario("classic-le", 61_310_467, [Act("same stimulus again", 60, 97, 0.681)])
    assert_nothing_false(found)
    assert found.n_valid > 50


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
@pytest.mark.parametrize("n_recorded", sweep([4, 8, 20], [8]))
def test_a_recorded_start_does_not_make_the_sender_behind_it_old(profile: str, n_recorded: int) -> None:
    """The recording comes while the sender is off. Both clocks begin at 0, so the sender fits the recorded one."""
    end = 82 + n_recorded
    acts = [Act("same stimulus again", 82, end, 0.5), Act("silence", end, end + 20, 0.5)]
    found = run_scenario(profile, 1, acts)
    assert_nothing_false(found)
    assert found.last.startswith("VALID")
    assert found.largest_uncertainty < 5 * PERIOD


WITHOUT_ECHO = tuple(
    kind
    for kind in KINDS
    if kind not in ("recording", "same stimulus again", "restart under delay", "step under delay")
)


@pytest.mark.parametrize("profile", PROFILES)
def test_a_sender_of_version_1_is_older_than_stated_only_where_an_earlier_run_is_replayed(profile: str) -> None:
    """It names neither session nor result: restarts wait for somebody, or say so."""
    total = campaign(profile, range(4), kinds=WITHOUT_ECHO, session=None)
    assert total["valid"] > 400
    assert total["too_old"] == total["mixed"] == total["unaccounted"] == 0


RACK = (
    (700_052, "the clock is set while cycles are too late"),
    (700_390, "the clock is set by a tenth of a cycle, again and again, and the delay grows by as much"),
    (700_541, "the clock is set by as much as frames are held, and the counter seems to have gone round"),
    (700_537, "a frozen sender behind a cycle whose counter jumped"),
    (700_623, "the clock is set back by a seventh of a cycle"),
    (8_310_041, "the clock is set ahead in a burst of late cycles, whose last ones fit the clock of before"),
    (8_330_106, "the clock is set ahead by as much as frames are held, while a recording comes in their place"),
    (9_850_073, "clock and counter jump together, the counter by more than has passed, and frames are held"),
    (9_800_426, "the clock is set back by nearly the largest age among lost cycles: it says nothing of a delay"),
)


RACK_ACTS = (
    ([Act("counter jump", 69, 85, 0.33), Act("steps with delay", 67, 103, 0.63)], "the counter jumps meanwhile"),
    ([Act("steps with delay", 63, 113, 0.034)], "small steps of the clock, eleven in a row"),
    (
        [Act("large step ahead", 67, 99, 0.015), Act("delay", 77, 89, 0.648)],
        "the unproven sender is late, not back",
    ),
    (
        [Act("delay", 73, 120, 0.555), Act("recording", 90, 113, 0.715)],
        "the sender is back behind a recording, late, and a clock that begins with it explains it too",
    ),
)


@pytest.mark.parametrize(
    ("acts", "what"), [*((draw_acts(seed, ALL_KINDS), what) for seed, what in RACK), *RACK_ACTS]
)
def test_what_once_was_wrong_of_a_multiplexed_rack(acts: list[Act], what: str) -> None:
    found = run_scenario("rack", 3, acts)
    assert found.n_valid > 0, what
    assert_nothing_false(found)


def test_a_multiplexed_rack() -> None:
    total = campaign("rack", range(15), kinds=WITHOUT_ECHO)
    assert total["valid"] > 1_500
    wrong = ("too_old", "too_young", "beyond", "mixed", "unaccounted", "late")
    assert [total[name] for name in wrong] == [0] * len(wrong)
