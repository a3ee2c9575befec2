# SPDX-License-Identifier: Apache-2.0
"""Footprints of places drawn from known distributions: areas by closed forms, and what is said where there are none."""

import dataclasses
import json
import math
import re
import time
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import map_coordinates
from scipy.stats import binom, gaussian_kde

import lgvi_warp as lw
from lgvi_warp.cli.command import main
from lgvi_warp.common.status import Status
from lgvi_warp.uncertainty.footprint.answer import number_text, place_text
from lgvi_warp.uncertainty.footprint.density import GAIN, DensityGrid, Whitening
from lgvi_warp.uncertainty.footprint.footprint import run_answer
from tests.support.made import made
from tests.support.refusals import refused, says

SHARES = (0.5, 0.9, 0.95, 0.99)
# Oblique: 2 m and 1 m along the axes, correlated by 0.75.
COVARIANCE = np.array([[4.0, 1.5], [1.5, 1.0]])
ROOT_DET = math.sqrt(np.linalg.det(COVARIANCE))
FLOOR, FAILED = int(Status.FLOOR), int(Status.NON_FINITE)


def drawn(df, n, seed):
    """Places (n, 2) of the bivariate t distribution with this scale matrix; df infinite: normal."""
    rng = np.random.default_rng(seed)
    normal = rng.standard_normal((n, 2)) @ np.linalg.cholesky(COVARIANCE).T
    return normal if df == math.inf else normal / np.sqrt(rng.chisquare(df, n) / df)[:, None]


def area(df, share):
    """Closed form: the region is an ellipse; half its squared radius is F distributed with 2 and df degrees of freedom."""
    outside = 1.0 - share
    squared = -2.0 * math.log(outside) if df == math.inf else df * (outside ** (-2.0 / df) - 1.0)
    return math.pi * squared * ROOT_DET


def spread(df, share, n):
    """Relative standard error of that area where the shape is known and the radius is the sample's quantile."""
    outside = 1.0 - share
    density = 0.5 * outside ** (1.0 + (0.0 if df == math.inf else 2.0 / df))
    return math.sqrt(share * outside / n) / density / (area(df, share) / (math.pi * ROOT_DET))


def run_to(places, depth=5.0, **named):
    """A result whose members go from the origin to these places (n, 2)."""
    end = np.concatenate([places, np.full((len(places), 1), depth)], axis=1)
    return made(np.stack([0.0 * end, 0.5 * end, end]), **named)


def footprint(places, *arguments, **named):
    return lw.studies.footprint(run_to(places, **named), *arguments)


@pytest.mark.ci
@pytest.mark.parametrize("df", [3, 5, 10, math.inf])
def test_areas_are_those_of_the_t_distribution(df):
    """Their mean error is below that of the sample, and what the choice among bandwidths leaves; intervals hold the truth."""
    n, seeds = 10_000, 8
    found = [footprint(drawn(df, n, seed)).regions for seed in range(seeds)]
    for k, share in enumerate(SHARES):
        errors = np.array([regions[k].area for regions in found]) / area(df, share) - 1.0
        sample = spread(df, share, n)
        assert abs(errors.mean()) < min(0.05, 1.0 - GAIN + 3.0 * sample / math.sqrt(seeds)) + 0.07 * (share == 0.99)
        assert errors.std() < 2.0 * sample
        covered = sum(regions[k].low < area(df, share) < regions[k].high for regions in found)
        assert binom.cdf(covered, seeds, 0.95) > 1e-3


@pytest.mark.ci
@pytest.mark.parametrize("n", [40, 400])
def test_intervals_of_few_members_hold_the_area(n):
    """At 95 %, or as often as 30 seeds can tell."""
    found = [footprint(drawn(math.inf, n, seed)).regions[1] for seed in range(30)]
    assert binom.cdf(sum(each.low < area(math.inf, 0.9) < each.high for each in found), 30, 0.95) > 1e-3
    assert all(each.high > each.low for each in found)


@pytest.mark.ci
@pytest.mark.parametrize("n, bias", [(200, 0.107), (1_000, 0.033), (10_000, 0.005)])
def test_an_edge_widens_the_outermost_region(n, bias):
    """A uniform disc: the bias of the page on footprints."""
    found = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        angle, away = rng.uniform(0.0, 2.0 * np.pi, n), np.sqrt(rng.random(n))
        found.append(footprint(np.stack([away * np.cos(angle), away * np.sin(angle)], axis=1)).regions)
    outermost, inner = (np.mean([regions[k].area for regions in found]) / (SHARES[k] * math.pi) for k in (3, 1))
    assert outermost == pytest.approx(1.0 + bias, abs=max(0.3 * bias, 0.003))
    assert inner == pytest.approx(1.0, abs=0.02)


def test_a_region_holds_its_share_of_new_members():
    """Whatever the distribution: here a ring, whose region has a hole."""
    rng = np.random.default_rng(5)

    def ring(n):
        angle, radius = rng.uniform(0.0, 2.0 * np.pi, n), rng.normal(10.0, 1.0, n)
        return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)

    from shapely import MultiPolygon, contains_xy

    region = footprint(ring(4_000)).regions[1]
    (rings,) = region.polygons
    assert len(rings) == 2
    shape = MultiPolygon([(rings[0], rings[1:])])
    assert shape.is_valid
    assert shape.area == pytest.approx(region.area, rel=1e-3)
    inside = contains_xy(shape, *ring(20_000).T)
    # Of the level, and of the count.
    error = math.sqrt(0.09 / 4_000 + 0.09 / 20_000)
    assert abs(inside.mean() - 0.9) < 4.0 * error
    # In east, north the outer ring runs counterclockwise, and that of the hole clockwise.
    from shapely import is_ccw, linearrings

    assert [bool(is_ccw(linearrings(each[:, ::-1]))) for each in rings] == [True, False]


@pytest.mark.parametrize("distance", [30.0, 3_000.0])
def test_two_clusters_have_two_parts(distance):
    """Closed form of two normal clusters far apart: with the level c of the density, 2 pi c (s1 + s2) lie outside."""
    n, weight, sizes = 10_000, 0.7, np.array([1.0, 2.0])
    rng = np.random.default_rng(7)
    second = rng.random(n) > weight
    places = rng.standard_normal((n, 2)) * np.where(second, *sizes[::-1])[:, None] + second[:, None] * [0.0, distance]
    shares, squares = np.array([weight, 1.0 - weight]), sizes**2
    for region in footprint(places).regions[1:3]:
        level = (1.0 - region.share) / (2.0 * np.pi * squares.sum())
        exact = (np.pi * 2.0 * np.log(shares / (2.0 * np.pi * squares * level)) * squares).sum()
        assert len(region.polygons) == 2
        # Of the sample 2 % at most, as for one cluster, and what the choice among bandwidths leaves.
        assert region.area == pytest.approx(exact, rel=3.0 * 0.015 + 1.0 - GAIN)
        assert region.ellipse_area > 2.0 * region.area
    assert footprint(places).regions[2].radius == pytest.approx(0.7 * distance, rel=0.1)


def test_the_density_is_that_of_scipy():
    """The density, and without a member's own kernel, sums over all pairs; bins of a sixth of a kernel widen it by 1 %."""
    n, count = 0.5, 200
    places = np.random.default_rng(3).standard_normal((count, 2)) @ np.linalg.cholesky(COVARIANCE).T
    covariance = np.cov(places.T)
    grid = DensityGrid(places, np.ones(count), Whitening(places, covariance, 1.0), 160)
    found = grid.smoothed(n / grid.cell)
    at = np.array([[0.0, 0.0], [1.0, 1.5], [-2.0, -0.5]])
    exact = gaussian_kde(places.T, bw_method=n)(at.T)
    node = tuple(((grid.frame.of(at) - grid.low) / grid.cell).T)
    np.testing.assert_allclose(map_coordinates(found.density, node, order=3) / grid.area / count, exact, rtol=0.02)
    apart = np.array([gaussian_kde(np.delete(places, i, 0).T, bw_method=lambda kde: n * ratio(kde, covariance))(places[i])[0]
                      for i in range(count)])  # fmt: skip
    np.testing.assert_allclose(found.others / grid.area, np.sort(apart) * (count - 1), rtol=0.06, atol=0.02)


def ratio(kde, covariance):
    """The bandwidth of the whole sample in terms of one without a member; their shapes differ by parts of a hundred."""
    return (np.linalg.det(covariance) / np.linalg.det(np.cov(kde.dataset))) ** 0.25


def test_ten_thousand_members_take_less_than_half_a_second():
    """On a machine of its own; three times as long is allowed beside others."""
    places = drawn(5, 10_000, 1)
    footprint(places)
    begun = time.process_time()
    footprint(places)
    assert time.process_time() - begun < 1.5


def test_the_area_settles_with_the_members():
    found = footprint(drawn(math.inf, 8_000, 2))
    assert [n for n, *_ in found.growth] == [1_000, 2_000, 4_000, 8_000]
    assert found.growth[-1][1:] == (found.main.area, found.main.low, found.main.high)
    widths = [high - low for _, _, low, high in found.growth]
    # As one over the root of the members: eight times as many, 2.8 times as narrow.
    assert 1.5 < widths[0] / widths[-1] < 5.0
    assert all(low < value < high for _, value, low, high in found.growth)


def test_weights_count():
    """A member of weight two is as two members, and one without weight as none."""
    places = drawn(math.inf, 2_000, 4)
    weights = np.where(places[:, 0] > 0.0, 1.5, 0.5)
    weights[:100] = 0.0
    result = dataclasses.replace(run_to(places), weights=weights)
    found = lw.studies.footprint(result)
    np.testing.assert_allclose(found.centre, (weights[:, None] * places).sum(axis=0) / weights.sum())
    assert found.members == 1_900
    at = np.random.default_rng(0).choice(2_000, 20_000, p=weights / weights.sum())
    from shapely import MultiPolygon, contains_xy

    shape = MultiPolygon([(rings[0], rings[1:]) for rings in found.regions[1].polygons])
    assert contains_xy(shape, *places[at].T).mean() == pytest.approx(0.9, abs=4.0 * math.sqrt(0.09 / 1_500))


@pytest.mark.ci
@pytest.mark.parametrize("far, messages", [
    ([(1e5, 3e4)], ["1 member lies"]), ([(1e9, 0.0)], ["1 member lies"]), ([(40.0, -40.0)], ["1 member lies"]),
    ([(1e6, 3e5), (-1e4, 1e4), (0.0, 200.0)], ["3 members lie"]),
    ([(1e4 * k * k, 1e5 * k) for k in range(1, 31)], ["30 members lie"]),
    ([(5.0, 5.0)], []),
])  # fmt: skip
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_few_members_far_away_change_little(far, messages, dtype):
    places = drawn(math.inf, 1_000, 6)
    alone = footprint(places)
    places[: len(far)] = far
    found = footprint(places, dtype=dtype)
    # The others are fewer, so that their share is larger, and their region.
    outside = 1.0 - 0.95 * 1_000 / (1_000 - len(far))
    ratio = math.log(outside) / math.log(0.05)
    assert found.main.area == pytest.approx(ratio * alone.main.area, rel=0.05 + 2e-3 * len(far))
    assert found.main.radius == pytest.approx(math.sqrt(ratio) * alone.main.radius, rel=0.05 + 2e-3 * len(far))
    np.testing.assert_allclose(found.centre, alone.centre, atol=0.05)
    assert found.main.ellipse_area == pytest.approx(alone.main.ellipse_area, rel=0.05)
    # The last line of the run has the same circle.
    assert run_answer(run_to(places, dtype=dtype)).endswith(found.answer)
    assert len(found.messages) == len(messages)
    says(" ".join(found.messages), *(f"{words} more than 30 standard deviations away" for words in messages))


def test_members_far_away_that_are_a_share_of_their_own_have_no_bounded_area():
    places = drawn(math.inf, 1_000, 6)
    places[:80] *= 1e6
    found = footprint(places)
    assert found.regions[1].area == pytest.approx(area(math.inf, 0.9 / 0.92), rel=0.15)
    assert found.main.area == math.inf
    says(str(found), "95 %        too few members for an area")


@pytest.mark.parametrize("share", [0.85, 0.97])
def test_a_small_cluster_far_away_is_in_the_region_of_its_share(share):
    """The region of 95 % has both clusters; it leaves out one of 3 %."""
    n, sizes = 10_000, np.array([1.0, 2.0])
    rng = np.random.default_rng(7)
    second = rng.random(n) > share
    places = rng.standard_normal((n, 2)) * np.where(second, *sizes[::-1])[:, None] + second[:, None] * [0.0, 3_000.0]
    found = footprint(places)
    if share == 0.97:
        assert found.main.area == pytest.approx(-2.0 * math.pi * math.log(1.0 - 0.95 / share), rel=0.05)
        says(found.answer, "95 % end within 2.")
    else:
        level = 0.05 / (2.0 * np.pi * (sizes**2).sum())
        logs = np.log(np.array([share, 1.0 - share]) / (2.0 * np.pi * sizes**2 * level))
        assert found.main.area == pytest.approx((2.0 * np.pi * logs * sizes**2).sum(), rel=0.075)


def test_of_several_parts_the_answer_names_the_largest():
    rng = np.random.default_rng(2)
    places = rng.standard_normal((2_000, 2)) * np.where(np.arange(2_000) < 800, 1.0, 2.0)[:, None]
    places[:800] += [100.0, -30.0]
    found = footprint(places)
    number = r"([\d.]+)"
    words = (
        rf"95 % end in 2 areas, {number} m2 in total, the largest within {number} m of a point {number} m .*origin\."
    )
    total, radius, north = map(float, re.fullmatch(words, found.answer).groups())
    assert total == pytest.approx(found.main.area, rel=5e-3)
    # Closed form as above: half the squared radius of the large one in its own units.
    log = math.log(0.6 / 4.0 / (0.05 / 5.0))
    assert radius == pytest.approx(2.0 * math.sqrt(2.0 * log), rel=0.15)
    assert north < 0.3


@pytest.mark.parametrize("n, shares", [(1, [0.5]), (2, [0.5]), (3, [0.5]), (8, [0.5]), (9, [0.5, 0.9]),
                                       (18, [0.5, 0.9]), (19, [0.5, 0.9, 0.95]), (98, [0.5, 0.9, 0.95]),
                                       (99, [0.5, 0.9, 0.95, 0.99])])  # fmt: skip
def test_few_members_have_few_regions(n, shares):
    """A region of a share leaves one of 1 / (1 - share) members outside: of fewer members there is none."""
    found = footprint(drawn(math.inf, n, 1))
    assert [region.share for region in found.regions] == shares
    says(" ".join(found.messages), *(f"a region of {share:.0%} needs" for share in SHARES if share not in shares))
    if n < 72:
        # All of 71 members lie within a region of 95 % at 2.6 %: nothing bounds it from above.
        assert found.main.share < 0.95 or not math.isfinite(found.main.high)
    assert not any(region.low == region.high for region in found.regions)
    says(str(found), found.answer)
    assert not re.search(r"\binf\b|\(0\.00 or more|\b1 members", str(found))
    if n == 3:
        says(str(found), "m2 (too few members for an interval)")


def test_places_without_an_area():
    spot = footprint(np.tile([3.0, -4.0], (50, 1)))
    assert spot.answer == "All end at a point 3.00 m north and 4.00 m west of the origin."
    line = footprint(np.outer(np.linspace(0.0, 10.0, 101), [0.6, 0.8]))
    # 95 % of 102 places between members from the middle: 4.85 m, in steps of 0.1 m.
    assert line.main.radius == pytest.approx(4.85, abs=0.1)
    rounded = footprint(1e5 + 1e-3 * drawn(math.inf, 50, 1).astype(np.float32), dtype=np.float32)
    two = footprint(np.repeat([[1.0, 2.0], [3.0, 4.0]], 20, axis=0))
    nearly = footprint(np.array([3.0, -4.0]) + 1e-15 * drawn(math.inf, 50, 1))
    for found, words in ((spot, "at one point"), (line, "on a line"), (rounded, "at one point"), (two, "at two points"),
                         (nearly, "at one point")):  # fmt: skip
        says(str(found), words, "no area", "ellipse 0.00 m2")
        assert all(math.isnan(each) for region in found.regions for each in (region.area, region.low, region.high))
        assert not any(region.polygons for region in found.regions)
        again = lw.studies.Footprint.from_dict(json.loads(found.to_json()))
        assert again.to_json() == found.to_json()
        lw.plots.footprint(found)
    hardly = footprint(drawn(math.inf, 500, 1) @ np.array([[1.0, 0.0], [0.0, 1e-4]]))
    assert 0.0 < hardly.main.area < 1e-2


def test_many_members_at_few_places():
    found = footprint(np.repeat([[0.0, 0.0], [0.0, 9.0], [5.0, 0.0]], 100, axis=0))
    says(str(found), "finer than the grid resolves")


def test_members_without_a_place_are_counted():
    places = drawn(math.inf, 300, 9)
    status = np.array([FLOOR] * 200 + [0] * 70 + [FAILED] * 30)
    end = np.where(status == 0, np.nan, np.where(status == FLOOR, 1.0, 0.5))
    scene = lw.Scene.named("sphere", events=[lw.events.Floor(depth=5.0)])
    result = run_to(places, status=status, end=end, scene=scene)
    floor = lw.studies.footprint(result, "floor")
    assert (floor.members, floor.lacking) == (200, {"ok": 70, "non_finite": 30})
    np.testing.assert_allclose(floor.centre, places[:200].mean(axis=0))
    says(floor.answer, "95 % of the 200 members that reach the floor do so within")
    last = lw.studies.footprint(result)
    assert (last.members, last.lacking) == (270, {"non_finite": 30})
    says(last.answer, "95 % of the 270 members that did not fail end within")
    says(str(last), "left out    30 members without such a place: non_finite 30")
    # At 1 s the failed members have stopped; at the start they are under way.
    assert lw.studies.footprint(result, 1.0).lacking == {"non_finite": 30}
    assert lw.studies.footprint(result, "0").answer == "At 0 s all are at the origin."
    says(lw.studies.footprint(result, 1).answer, "At 1 s 95 % of the 270 members that did not fail are within")
    assert lw.studies.footprint(result, "stopped").members == 200
    lost = run_to(np.where(np.arange(300)[:, None] == 299, np.nan, places))
    assert lw.studies.footprint(lost).lacking == {"ok": 1}


def test_what_cannot_be_is_refused():
    places = drawn(math.inf, 30, 1)
    result = run_to(places)
    says(refused(lw.studies.footprint, result, 0.7), "at = 0.7", "not a time of a sample", "Give 0 or 1", "at=[0.7]")
    says(
        refused(lw.studies.footprint, result, "flor"),
        "at = 'flor'",
        'neither "end", a time nor an outcome',
        "Known: end, a time [s], as 12.5, ",
    )
    says(refused(lw.studies.footprint, result, None), "at = None")
    says(refused(lw.studies.footprint, result.position), "result", "lw.solve")
    bare = dataclasses.replace(result, samples={})
    says(refused(lw.studies.footprint, bare), "were not kept", "keep='all'")
    none = run_to(places, status=np.full(30, FAILED), end=np.full(30, 0.5))
    says(refused(lw.studies.footprint, none), "no member has a place", "non_finite 30")


def test_a_footprint_is_saved_and_read(tmp_path):
    found = footprint(drawn(3, 60, 2))
    assert found.main.high == math.inf
    files = found.save(tmp_path)
    assert [path.name for path in files] == ["footprint.json", "footprint.csv", "footprint.txt"]
    again = lw.studies.Footprint.load(files[0])
    assert str(again) == str(found)
    for item in dataclasses.fields(found):
        if item.name not in ("regions", "provenance"):
            np.testing.assert_equal(getattr(again, item.name), getattr(found, item.name))
    assert json.loads(files[0].read_text())["answer"] == found.answer
    np.testing.assert_array_equal(again.regions[0].polygons[0][0], found.regions[0].polygons[0][0])
    assert len(files[1].read_text().splitlines()) == 1 + len(found.regions)
    # The command takes the file, too.
    for name in ("by_command.geojson", "by_command.kml"):
        assert main(["export", str(files[0]), "--to", str(tmp_path / name), "--origin=63.4,10.4", "-q"]) == 0
        direct = lw.export(found, tmp_path / f"direct{Path(name).suffix}", origin=[63.4, 10.4])
        assert (tmp_path / name).read_bytes().replace(b"by_command", b"direct") == direct.read_bytes()


@pytest.mark.parametrize(
    "value, text", [(7035.2, "7,035"), (143.4, "143"), (26.44, "26.4"), (0.01234, "0.0123"), (0.0, "0.00")]
)
def test_numbers_in_words(value, text):
    assert number_text(value, value) == text


@pytest.mark.parametrize("place, scale, text", [
    ((-1.9, 24.94), 11.7, "a point 1.9 m south and 24.9 m east of the origin"),
    ((0.04, -3.0), 11.7, "a point 3.0 m west of the origin"), ((0.0, 0.0), 1.0, "the origin"),
    ((12345.6, 0.0), 2345.0, "a point 12,346 m north of the origin"),
    ((0.0, 0.00123), 0.01, "a point 0.0012 m east of the origin"),
])  # fmt: skip
def test_places_in_words(place, scale, text):
    assert place_text(place, scale) == text


def test_the_picture_shows_the_numbers():
    floor = lw.events.Floor(
        depth=np.linspace(-22.5, 22.5, 21)[:, None] * np.ones(21), origin=[-50.0, -50.0], spacing=[5.0, 5.0]
    )
    result = run_to(drawn(math.inf, 1_500, 3), scene=lw.Scene.named("sphere", events=[floor]))
    found = lw.studies.footprint(result)
    axes = lw.plots.footprint(result)
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_aspect()) == ("east [m]", "north [m]", 1.0)
    assert axes.get_title().replace("\n", " ") == found.answer.rstrip(".")
    shown = dict(
        zip(
            [f"{region.percent}: {number_text(region.area, region.area)} m$^2$" for region in found.regions],
            found.regions,
            strict=True,
        )
    )
    for patch in axes.patches[:4]:
        low, high = patch.get_path().get_extents().get_points()
        ring = np.concatenate([rings[0] for rings in shown[patch.get_label()].polygons])
        np.testing.assert_allclose([low[::-1], high[::-1]], [ring.min(axis=0), ring.max(axis=0)])
    # The corners of the ellipse's matrix: along north and east it reaches r times the standard deviations.
    ellipse = next(patch for patch in axes.patches if "ellipse" in patch.get_label())
    reach = math.sqrt(-2.0 * math.log(0.05)) * np.sqrt(np.diag(found.covariance))[::-1]
    box = ellipse.get_path().transformed(ellipse.get_patch_transform()).get_extents()
    np.testing.assert_allclose([box.width, box.height], 2.0 * reach, rtol=1e-3)
    texts = [text.get_text() for text in axes.get_legend().get_texts()]
    says(texts, "depth of the floor", "1,000 of 1,500 members", "centre", *shown)
    assert len([item for item in axes.collections if hasattr(item, "levels")]) == 2
    # A member far away leaves the view on the regions.
    places = drawn(math.inf, 500, 3)
    places[0] = 1e6, 3e5
    axes = lw.plots.footprint(footprint(places))
    assert np.abs([axes.get_xlim(), axes.get_ylim()]).max() < 100.0
    says(refused(lw.plots.footprint, found, 1.0), "at = 1.0", "footprint at end")
