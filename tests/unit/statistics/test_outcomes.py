# SPDX-License-Identifier: Apache-2.0
"""Statistics of members' ends against exact counts and the usual estimator of survival, and their coverage."""

import numpy as np
import pytest
from scipy import stats

import lgvi_warp as lw
from lgvi_warp.engine.block import blocks
from lgvi_warp.engine.keepers.statistics import Gathered
from lgvi_warp.statistics.base import from_list
from lgvi_warp.statistics.ends import Ends, check_outcomes, outcomes
from lgvi_warp.statistics.estimates.estimate import Estimates
from lgvi_warp.statistics.estimates.table import table
from lgvi_warp.statistics.estimates.tree import Tree
from lgvi_warp.statistics.values.values import Values, dealt
from tests.unit.statistics.test_statistics import check_as_files_hold_it

FLOOR, SURFACE, OK, FAILED = lw.Status.FLOOR, lw.Status.SURFACE, lw.Status.OK, lw.Status.NON_FINITE
TIMES = np.linspace(0.0, 10.0, 6)
EVENTS = ("floor", "top")


def ends_of(n, seed=0, rates=(0.1, 0.05, 0.02), step=0.0):
    """n members with exponential times of floor, surface and failure, whichever is first, until 10 s."""
    rng = np.random.default_rng(seed)
    times = np.stack([rng.exponential(1.0 / rate, n) if rate else np.full(n, np.inf) for rate in rates])
    if step:
        times = np.maximum(np.ceil(times / step), 1.0) * step
    first, at = times.min(axis=0), times.argmin(axis=0)
    over = first <= TIMES[-1]
    status = np.where(over, np.array([FLOOR, SURFACE, FAILED])[at], OK)
    event = np.where(over, np.array([1, 2, 0])[at], 0)
    return Ends(status, event, np.where(over, first, TIMES[-1]), EVENTS)


def part_of(ends, at):
    return Ends(ends.status[at], ends.event[at], ends.time[at], ends.events)


def gathered(statistic, ends, block=256, order=None, replicates=1, last=None):
    """Estimate of a statistic over these ends, block by block; last: (n, d), its quantity at the last sample."""
    n, tree = len(ends.status), Tree(statistic.join)
    for i in order if order is not None else range(-(-n // block)):
        at = slice(i * block, min((i + 1) * block, n))
        x, good = statistic.at_ends(part_of(ends, at), None if last is None else last[at].T[None])
        gathers = statistic.open(TIMES if statistic.of_ends else TIMES[-1:], at.stop - at.start)
        given = (x, good, at.start, i, block)
        gathers.take(Values(*given) if replicates == 1 else dealt(*given, replicates), slice(0, 1))
        gathers.end(part_of(ends, at), replicates)
        tree.add(i, gathers.close())
    time = TIMES if statistic.of_ends else TIMES[-1:]
    if replicates == 1:
        return statistic.estimates(tree.parts(), time)
    return statistic.estimates_of_replicates(tree.parts(), time, replicates)


def incidence(ends, status):
    """Times of ends, and Aalen & Johansen's sum until each of them."""
    under_way, passed, times = 1.0, 0.0, np.unique(ends.time[ends.status != OK])
    sums = []
    for now in times:
        risk, here = (ends.time >= now).sum(), ends.time == now
        passed += under_way * (here & (ends.status == status)).sum() / risk
        under_way *= 1.0 - (here & np.isin(ends.status, [FLOOR, SURFACE])).sum() / risk
        sums.append(passed)
    return times, np.array(sums)


@pytest.mark.parametrize("step", [0.0, 0.5])
def test_an_outcome_is_aalen_and_johansens(step):
    # With a step many members end at the same times, some of them at sample times.
    ends = ends_of(1000, step=step)
    (found,) = gathered(lw.statistics.Outcome("floor"), ends)
    floor, lost = ends.status == FLOOR, ends.status == FAILED
    times, curve = incidence(ends, FLOOR)
    np.testing.assert_allclose(found.value, np.append(0.0, curve)[np.searchsorted(times, TIMES, "right")], rtol=1e-12)
    for name, which in {"ended": floor, "otherwise": (ends.status != OK) & ~floor, "failed": lost}.items():
        np.testing.assert_array_equal(found[name], [(which & (ends.time <= t)).sum() for t in TIMES])
    np.testing.assert_array_equal(found["fraction"], found["ended"] / 1000)
    np.testing.assert_array_equal(found.count, 1000 - found["ended"] - found["otherwise"])
    assert (found.lower <= found.value).all()
    assert (found.value <= found.upper).all()
    # The time of each level: the first end at which the curve reaches it.
    for level, time in zip(found.coordinates["level"], found["end_time"], strict=True):
        assert time == (times[curve >= level].min() if (curve >= level).any() else np.inf)
    # If nothing else stopped members: Kaplan & Meier's.
    alone = stats.ecdf(stats.CensoredData.right_censored(ends.time, ~floor)).cdf
    np.testing.assert_allclose(found["alone"], alone.evaluate(TIMES), rtol=1e-12)
    assert (found["alone_lower"] <= found["alone"]).all()
    assert (found["alone"] <= found["alone_upper"]).all()


@pytest.mark.parametrize("rates", [(0.1, 0.05, 0.02), (0.1, 0.05, 0.0), (0.0, 0.1, 0.2), (0.2, 0.0, 0.2)])
@pytest.mark.parametrize("replicates", [1, 4])
def test_the_sum_over_outcomes_and_ok_is_1(rates, replicates):
    # What fails does so before the end of the run: at 9.9 s at the latest.
    ends = ends_of(1024, rates=rates, step=0.3)
    each = [gathered(lw.statistics.Outcome(name), ends, replicates=replicates)[0] for name in ("floor", "top", "ok")]
    assert sum(one.value[-1] for one in each) == pytest.approx(1.0, abs=1e-12)
    (stopped,) = gathered(lw.statistics.Outcome("stopped"), ends, replicates=replicates)
    np.testing.assert_allclose(each[0].value + each[1].value, stopped.value, rtol=1e-12)
    (failed,) = gathered(lw.statistics.Outcome("failed"), ends, replicates=replicates)
    np.testing.assert_array_equal(failed.value, failed["fraction"])
    if not rates[2]:
        assert sum(one["fraction"][-1] for one in each) == 1.0


@pytest.mark.parametrize("rates", [(0.1, 0.0, 0.0), (0.1, 0.3, 0.0)])
def test_without_failures_an_outcome_is_a_fraction_with_wilsons_interval(rates):
    ends = ends_of(700, rates=rates)
    (found,) = gathered(lw.statistics.Outcome("floor"), ends)
    hits = np.array([((ends.status == FLOOR) & (ends.time <= t)).sum() for t in TIMES])
    np.testing.assert_array_equal(found.value, hits / 700)
    for hit, low, high in zip(hits, found.lower, found.upper, strict=True):
        wilson = stats.binomtest(int(hit), 700).proportion_ci(0.95, "wilson")
        np.testing.assert_allclose((low, high), wilson, rtol=1e-10, atol=1e-15)
    np.testing.assert_array_equal(found["fraction_upper"], found.upper)
    if not rates[1]:
        np.testing.assert_array_equal(found["alone"], found.value)


def test_all_that_are_left_fail():
    """Among 100 members 20 sink, 50 rise, and then 30 fail: these may sink or rise, all of them."""
    time = np.repeat([1.0, 1.5, 3.0], [20, 50, 30])
    ends = Ends(np.repeat([FLOOR, SURFACE, FAILED], [20, 50, 30]), np.repeat([1, 2, 0], [20, 50, 30]), time, EVENTS)
    (found,) = gathered(lw.statistics.Outcome("floor"), ends)
    assert found.value.tolist() == [0.0, 0.2, 0.2, 0.2, 0.2, 0.2]
    wilson = stats.binomtest(20, 100).proportion_ci(0.95, "wilson")
    assert found.upper[1] == pytest.approx(wilson.high)
    assert 0.3 + wilson.high <= found.upper[-1] < 1.0
    assert found.lower[1] == pytest.approx(wilson.low)
    assert found.lower[-1] <= wilson.low
    (alone,) = gathered(lw.statistics.Outcome("floor"), part_of(ends, slice(70, 100)))
    assert (alone.value[-1], alone.lower[-1], alone.upper[-1]) == (0.0, 0.0, 1.0)


def test_words_for_outcomes():
    ends = ends_of(500)
    for word, members in {
        "floor": ends.event == 1, "top": ends.event == 2, "surface": ends.status == SURFACE,
        "non_finite": ends.status == FAILED, "stopped": ends.event > 0, "failed": ends.status == FAILED,
        "ok": ends.status == OK,
    }.items():  # fmt: skip
        np.testing.assert_array_equal(ends.are(word), members)
    known = outcomes(EVENTS, [FLOOR, SURFACE])
    check_outcomes("outcome.of", ("top", "surface", "failed", "not_converged"), known)
    with pytest.raises(lw.SceneError, match="Did you mean 'floor'"):
        check_outcomes("outcome.of", ("flor",), known)
    with pytest.raises(lw.SceneError, match="is not an outcome of this scene"):
        check_outcomes("mean.at", ("box",), known)


def test_end_times_of_those_that_ended_so():
    ends = ends_of(1000)
    mean, quantiles, histogram = gathered(lw.statistics.EndTime("floor"), ends)
    time = ends.time[ends.status == FLOOR]
    assert (mean.name, quantiles.name, histogram.name) == (
        "mean end_time floor", "quantiles end_time floor", "histogram end_time floor",
    )  # fmt: skip
    np.testing.assert_allclose(mean.value, [[time.mean()]], rtol=1e-13)
    np.testing.assert_allclose(quantiles.value[0, :, 0], np.quantile(time, quantiles.coordinates["level"]), rtol=1e-13)
    counts, edges = np.histogram(time, 20, (0.0, 10.0))
    np.testing.assert_array_equal(histogram["counts"][0, 0], counts)
    np.testing.assert_allclose(histogram.coordinates["edge"], edges)
    assert mean.count == quantiles.count == histogram.count == len(time)
    assert mean.unit == "s"


def test_a_statistic_at_an_outcome_is_of_those_that_had_it():
    ends, last = ends_of(900), np.random.default_rng(3).normal(size=(900, 3))
    (mean,) = gathered(lw.statistics.Mean("position", at="floor"), ends, last=last)
    floor = ends.status == FLOOR
    assert mean.name == "mean position at floor"
    assert mean.count == floor.sum()
    np.testing.assert_allclose(mean.value[0], last[floor].mean(axis=0), rtol=1e-12)
    (beyond,) = gathered(lw.statistics.Exceedance("position", above=0.5, at="top"), ends, last=last)
    assert beyond.name == "exceedance position above 0.5 at top"
    np.testing.assert_allclose(beyond.value[0], (last[ends.event == 2] > 0.5).mean(axis=0))
    lines = "\n".join(table(Estimates([mean, beyond])))
    assert "mean position[2] at floor" in lines
    assert f"{floor.sum()} members" in lines


OF_ENDS = {
    "outcome": lw.statistics.Outcome("floor"),
    "end_time": lw.statistics.EndTime("floor", [lw.statistics.Mean(), lw.statistics.Quantiles(size=64)]),
}


@pytest.mark.parametrize("kind", OF_ENDS)
@pytest.mark.parametrize("replicates", [1, 4])
def test_blocks_in_any_order_give_the_same_bits(kind, replicates):
    ends = ends_of(1536)
    first = gathered(OF_ENDS[kind], ends, replicates=replicates)
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(6)
        again = gathered(OF_ENDS[kind], ends, order=order, replicates=replicates)
        for one, other in zip(first, again, strict=True):
            assert all(one[key].tobytes() == other[key].tobytes() for key in one.arrays)


def test_replicates_give_the_value_of_all_and_an_interval_of_their_spread():
    ends = ends_of(4096)
    (whole,), (found,) = (
        gathered(lw.statistics.Outcome("floor"), ends),
        gathered(lw.statistics.Outcome("floor"), ends, replicates=8),
    )
    np.testing.assert_allclose(found.value, whole.value, rtol=1e-12)
    np.testing.assert_array_equal(found["ended"], whole["ended"])
    assert "8 replicates" in found.interval
    # Student's t with 7 degrees of freedom is 1.2 times wider than the normal's, and a spread of 8 errs by a quarter.
    ratio = (found.upper - found.lower)[1:] / (whole.upper - whole.lower)[1:]
    assert (ratio > 0.4).all()
    assert (ratio < 2.5).all()


@pytest.mark.ci
@pytest.mark.slow_for("rates2", "rates3")
@pytest.mark.parametrize("rates", [(0.1, 0.05, 0.02), (0.01, 0.3, 0.0), (0.1, 0.1, 0.2), (0.03, 0.2, 0.1)])
def test_coverage(rates):
    """Floor, surface and failure come at constant rates a, b, c: a / (a + b) (1 - exp(-(a + b) t)) have sunk at t."""
    a, both = rates[0], rates[0] + rates[1]
    true, alone = -a / both * np.expm1(-both * TIMES[-1]), -np.expm1(-a * TIMES[-1])
    values, sizes, hold, alone_hold = [], [], 0, 0
    for seed in range(1000):
        (found,) = gathered(lw.statistics.Outcome("floor"), ends_of(200, seed, rates))
        hold += found.lower[-1] <= true <= found.upper[-1]
        # The clocks of the three are independent here, which `alone` takes for granted.
        alone_hold += found["alone_lower"][-1] <= alone <= found["alone_upper"][-1]
        values.append(found.value[-1])
        sizes.append(found.upper[-1] - found.lower[-1])
    # Of 1,000 intervals of 95 %: 5 standard deviations are 3.4 %; few ends, as of 7, make them hold a little more often.
    assert 0.915 < hold / 1000.0 < 0.985
    assert alone_hold / 1000.0 > 0.915
    # The interval is as wide as 1,000 estimates are spread, which is known to 1 / sqrt(2000); Wilson's adds some percent where
    # the normal interval would reach below 0.
    assert np.mean(sizes) == pytest.approx(2.0 * 1.96 * np.std(values), rel=0.12)


def test_nobody():
    (found,) = gathered(lw.statistics.Outcome("floor"), part_of(ends_of(10, rates=(0.0, 0.0, 0.0)), slice(0, 10)))
    np.testing.assert_array_equal(found.value, 0.0)
    assert np.isinf(found["end_time"]).all()
    assert (found.upper > 0.1).all()
    mean, quantiles, _ = gathered(lw.statistics.EndTime("top"), ends_of(10, rates=(0.0, 0.0, 0.0)))
    assert np.isnan(mean.value).all()
    assert np.isnan(quantiles.value).all()
    assert mean.count == 0


def test_first_passage_knows_when_a_member_was_stopped():
    # It sinks at 1 m/s to a floor at 3 m, between the samples at 2 and 4 s: in the second it stands on the floor.
    statistic = lw.statistics.FirstPassage(
        lw.statistics.Quantity("x", lambda s, m: None, "m", (), ("x",)), above=2.5, levels=(0.5,)
    )
    gathers = statistic.open(TIMES, 4)
    x = np.minimum(TIMES, 3.0)[:, None, None] * np.ones((1, 1, 4))
    gathers.take(Values(x[:1]), slice(0, 1))
    gathers.take(Values(x[1:]), slice(1, 6))
    gathers.end(Ends(np.full(4, FLOOR), np.ones(4, int), np.full(4, 3.0), EVENTS), 1)
    (found,) = statistic.estimates([gathers.close()], TIMES)
    # A piece is 0.25 s.
    assert found["passage_time"][0] == pytest.approx(2.5, abs=0.25)
    assert found.value.tolist() == [0, 0, 1, 1, 1, 1]


@pytest.mark.parametrize("replicates", [1, 2])
def test_first_passage_takes_stopped_members_for_what_they_are(replicates):
    """Among 100 members 50 are stopped elsewhere at 1 s, 26 fail at 5 s and 24 pass at 7 s.

    Of the 50 all would have passed.
    """
    statistic = lw.statistics.FirstPassage(
        lw.statistics.Quantity("x", lambda s, m: None, "m", (), ("x",)), above=2.5, levels=(0.4, 0.6)
    )
    end = np.repeat([1.0, 5.0, 10.0], [50, 26, 24])
    x = np.where((np.arange(100) >= 76) & (TIMES[:, None] >= 7.0), 3.0, 2.0)[:, None]
    good = (np.arange(100) < 50) | (np.arange(100) >= 76) | (TIMES[:, None] < 5.0)
    ends = Ends(np.repeat([SURFACE, FAILED, OK], [50, 26, 24]), np.repeat([2, 0, 0], [50, 26, 24]), end, EVENTS)
    gathers = statistic.open(TIMES, 100)
    gathers.take(dealt(x, good, 0, 0, 100, replicates) if replicates > 1 else Values(x, good), slice(0, 6))
    gathers.end(ends, replicates)
    parts = [gathers.close()]
    (found,) = (
        statistic.estimates(parts, TIMES)
        if replicates == 1
        else statistic.estimates_of_replicates(parts, TIMES, replicates)
    )
    np.testing.assert_allclose(found.value, [0, 0, 0, 0, 0.5, 0.5], rtol=1e-15)
    assert (found["stopped"].tolist(), found["lost"].tolist()) == ([0, 50, 0, 0, 0, 0], [0, 0, 0, 26, 0, 0])
    assert found["passage_time"][0] < 8.0
    assert (found["passage_time"][1], found["censored"]) == (np.inf, 0)
    (outcome,) = gathered(lw.statistics.Outcome("floor"), Ends(
        np.where(ends.status == OK, FLOOR, ends.status), np.where(ends.status == OK, 1, ends.event), end, EVENTS))  # fmt: skip
    assert outcome.value[-1] == pytest.approx(found.value[-1], rel=1e-15)


def test_parts_and_estimates_of_an_earlier_version_are_refused():
    (found,) = gathered(lw.statistics.Outcome("floor"), ends_of(100))
    arrays, text = Estimates([found]).to_arrays()
    assert Estimates.from_arrays(arrays, text)["outcome floor"]["alone"].tobytes() == found["alone"].tobytes()
    del arrays["0/alone"]
    with pytest.raises(ValueError, match="'outcome floor' is of an earlier version"):
        Estimates.from_arrays(arrays, text)
    gather = Gathered(TIMES, 100, [lw.statistics.Outcome("floor")])
    old = {"members": np.array([1]), "time": np.array([1.0]), "so": np.array([True]),
           "replicate": np.zeros(1, np.int32)}  # fmt: skip
    with pytest.raises(ValueError, match="'outcome floor' is of an earlier version"):
        gather.merge(blocks(100)[0], [old])


def test_from_a_scene_file():
    tables = [{"type": "outcome", "of": "floor", "levels": [0.5]}, {"type": "end_time", "of": "floor"},
              {"type": "mean", "of": "depth", "at": "floor"}]  # fmt: skip
    found = from_list(tables)
    assert [part.key for one in found for part in one.parts()] == [
        "outcome floor", "mean end_time floor", "quantiles end_time floor", "histogram end_time floor", "mean depth at floor",
    ]  # fmt: skip
    again = from_list([one.to_dict() for one in found])
    assert [one.to_dict() for one in again] == [one.to_dict() for one in found]


@pytest.mark.parametrize(("make", "text"), [
    (lambda: lw.statistics.Outcome(3), "is not an outcome"),
    (lambda: lw.statistics.Outcome("floor", levels=(0.0,)), "between 0 and 1"),
    (lambda: lw.statistics.EndTime("floor", lw.statistics.FirstPassage(above=1.0)), "one number of each member"),
    (lambda: lw.statistics.EndTime("floor", lw.statistics.Mean(at="floor")), "Leave it out"),
    (lambda: lw.statistics.FirstPassage("depth", above=1.0, at="floor"), "of all times"),
    (lambda: lw.statistics.PathMean("depth", at="floor"), "of all times"),
    (lambda: lw.statistics.Mean("depth", at=""), "is not an outcome"),
    (lambda: lw.statistics.Outcome("floor", at="floor"), "of all times"),
    (lambda: lw.statistics.Histogram("depth", bins=3, limits="run"), "lw.statistics.EndTime"),
])  # fmt: skip
def test_what_is_refused(make, text):
    with pytest.raises(lw.SceneError) as error:
        make()
    assert text in str(error.value)


@pytest.mark.parametrize("replicates", [1, 4])
def test_every_kind_is_the_same_from_a_file(replicates):
    ends = ends_of(400)
    for statistic in (lw.statistics.Outcome("floor"), lw.statistics.EndTime("floor")):
        check_as_files_hold_it(gathered(statistic, ends, replicates=replicates))
