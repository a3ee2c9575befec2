# SPDX-License-Identifier: Apache-2.0
"""Choice of what is shown of a run: a fair choice of members, even times."""

import dataclasses

import numpy as np
import pytest
from scipy import stats

import lgvi_warp as lw
from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.common.status import Status
from lgvi_warp.views import choice
from tests.support.made import made, straight

N = 10_000
SIDE = np.linspace(0.0, 1.0, 100)


def points(kind):
    """N points of the unit cube in the order in which a design gives them, (N, 3)."""
    if kind == "grid":
        axes = np.meshgrid(SIDE, np.linspace(0.0, 1.0, 10), np.linspace(0.0, 1.0, 10), indexing="ij")
        return np.stack(axes, axis=-1).reshape(-1, 3)
    if kind == "sobol":
        return stats.qmc.Sobol(3, scramble=False).random_base2(14)[:N]
    drawn = np.random.default_rng(7).uniform(size=(N, 3))
    return drawn[np.argsort(drawn[:, 0])] if kind == "table" else drawn


@pytest.mark.parametrize("kind", ["grid", "sobol", "table", "random"])
def test_the_choice_is_fair(kind):
    all_points = points(kind)
    few = lw.select_members(straight(all_points))
    assert len(few.members) == 1000
    assert few.text == "1,000 of 10,000 members"
    for axis in range(3):
        assert stats.ks_2samp(all_points[few.members, axis], all_points[:, axis]).pvalue > 1e-3
    # The first members, and evenly spread ones of a grid, would not pass.
    assert stats.ks_2samp(points("grid")[:1000, 0], points("grid")[:, 0]).pvalue < 1e-9


def test_few_that_failed_are_all_shown():
    n = 100_000
    lost = [3, 77, 40_000, 40_001, 99_999]
    status, end = np.zeros(n, int), np.full(n, np.nan)
    status[lost], end[lost] = Status.NON_FINITE, 0.5
    path = np.random.default_rng(3).normal(size=(2, n, 3))
    few = lw.select_members(made(path, status=status, end=end))
    assert set(lost) <= set(few.members.tolist())
    assert len(few.members) == 1000
    assert len(few.ranked) == choice.MOST_RANKED
    assert len(np.unique(few.ranked)) == choice.MOST_RANKED


def test_outcomes_share_a_third_of_the_places():
    n = 6000
    status = np.full(n, int(Status.OK))
    status[:4000] = Status.FLOOR
    status[4000:4100] = Status.SURFACE
    status[4100:4110] = Status.STEP_TOO_LARGE
    result = made(np.random.default_rng(4).normal(size=(2, n, 3)), status=status, end=np.where(status, 1.0, np.nan))
    counts = {
        code: np.count_nonzero(status[lw.select_members(result, 300).members] == code) for code in np.unique(status)
    }
    # 100 places: all 10 that failed, 45 of each event, which most of those on the floor have by their number already.
    assert counts[Status.STEP_TOO_LARGE] == 10
    assert counts[Status.SURFACE] >= 45
    assert counts[Status.FLOOR] / counts[Status.OK] == pytest.approx(4000 / 1890, rel=0.35)
    assert sum(counts.values()) == 300


def test_the_farthest_are_shown():
    path = np.random.default_rng(5).normal(size=(3, 5000, 3))
    path[1, 123, 2], path[2, 456, 0], path[0, 789, 1] = 50.0, -60.0, 70.0
    few = lw.select_members(made(path), most=20)
    assert {123, 456, 789} <= set(few.members.tolist())
    assert len(few.members) == 20
    # What a member is at after its end is not drawn as its path, so it is no reach.
    status, end = np.zeros(5000, int), np.full(5000, np.nan)
    status[456], end[456] = Status.FLOOR, 1.0
    unlike = lw.select_members(made(path, status=status, end=end), most=2)
    assert 456 not in unlike.members


def test_the_same_run_gives_the_same_choice_and_one_member_more_changes_a_handful():
    path = np.random.default_rng(6).normal(size=(2, 1001, 3))
    first, again = (lw.select_members(made(path[:, :1000]), most=500) for _ in range(2))
    assert (first.members == again.members).all()
    more = lw.select_members(made(path), most=500)
    assert len(set(more.members) ^ set(first.members)) <= 14
    all_but_one = lw.select_members(made(path))
    assert len(all_but_one.members) == 1000
    assert lw.select_members(made(path[:, :1000])).text == "1,000 members"


def test_frames_are_even_and_have_both_ends():
    rng = np.random.default_rng(8)
    for time in (np.linspace(0.0, 60.0, 6001), np.sort(rng.uniform(0.0, 9.0, 5000)), 1.1 ** np.arange(500)):
        frames = choice.frames_of(time)
        assert frames[0] == 0
        assert frames[-1] == len(time) - 1
        assert len(frames) <= 240
        assert (np.diff(frames) > 0).all()
        spacing = (time[-1] - time[0]) / 239
        nearest = np.abs(time[frames][:, None] - np.linspace(time[0], time[-1], 240)).min(axis=0)
        assert (nearest <= np.maximum(0.5 * spacing, np.diff(time).max())).all()
    assert choice.frames_of(np.arange(240.0)).tolist() == list(range(240))
    assert choice.frames_of(np.array([0.0])).tolist() == [0]


def test_the_hash_has_no_pattern():
    hashed = choice.mixed(np.arange(1 << 16))
    assert len(np.unique(hashed)) == 1 << 16
    uniform = hashed / 2.0**64
    for stride in (1, 2, 100, 1024):
        pairs = np.corrcoef(uniform[:-stride], uniform[stride:])[0, 1]
        assert abs(pairs) < 5.0 / np.sqrt(len(uniform))
    assert stats.kstest(uniform, "uniform").pvalue > 1e-3


def test_large_runs_are_read_in_pieces():
    k, n = 20_001, 250
    position = np.zeros((k, n, 3), np.float32)
    farthest = [3, 120, 240]
    position[k - 1, farthest] = np.diag([5.0, 6.0, 7.0])
    position[0, 7, 0] = np.nan
    result = dataclasses.replace(made(np.zeros((2, n, 3))), time=np.arange(float(k)), samples={"position": position})
    # Two million states at once are 99 members at these times.
    seen = [(members.start, members.stop) for members, _ in choice.pieces(result, ("position",))]
    assert seen == [(0, 99), (99, 198), (198, 250)]
    few = lw.select_members(result, most=20)
    assert set(farthest) <= set(few.members.tolist())
    assert 7 not in lw.select_members(result).members


def test_parameters_of_some_members_are_theirs():
    result = dataclasses.replace(straight(np.ones((10, 3))), parameters={"own": np.arange(10.0), "shared": np.ones(1)})
    few = choice.few(result, np.array([3, 5]), ("position", "nothing"), np.array([0, 2]))
    assert {name: values.tolist() for name, values in few.parameters.items()} == {"own": [3.0, 5.0], "shared": [1.0]}
    assert few.samples["position"].shape == (2, 2, 3)
    assert few.time.tolist() == [0.0, 2.0]
    assert few.members == 2


def test_vectors_are_finite_in_all_three():
    rows = np.ones((4, 3))
    rows[0, 0], rows[1, 1], rows[2, 2] = np.nan, np.inf, -np.inf
    assert choice.finite_rows(rows).tolist() == [False, False, False, True]


def test_the_hash_is_that_of_the_paper():
    # The first numbers of SplitMix64 from the seed 0.
    assert choice.mixed(np.arange(3)).tolist() == [0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4, 0x06C45D188009454F]


def test_frames_are_the_nearest():
    time = np.array([0.0, 1.0, 2.0, 3.4, 3.6, 10.0])
    assert choice.frames_of(time, 3).tolist() == [0, 4, 5]
    assert choice.frames_of(np.array([0.0, 4.0, 6.0, 10.0]), 3).tolist() == [0, 2, 3]  # of two as near the later one


def test_one_member_two_times():
    few = lw.select_members(made(np.zeros((2, 1, 3))))
    assert few.members.tolist() == [0]
    assert few.frames.tolist() == [0, 1]
    assert few.text == "1 member"


def test_what_cannot_be_shown_says_why():
    result = made(np.zeros((2, 3, 3)))
    with pytest.raises(ValueError, match="most = 0 draws no member"):
        lw.select_members(result, most=0)
    with pytest.raises(NothingToDraw, match="no member has a finite start"):
        lw.select_members(made(np.full((2, 3, 3), np.nan)))
    bare = lw.Result(**{**vars(result), "samples": {}})
    with pytest.raises(NothingToDraw, match="no positions were kept"):
        lw.select_members(bare)
