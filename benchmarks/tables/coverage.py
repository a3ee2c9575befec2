# SPDX-License-Identifier: Apache-2.0
"""Coverage of the intervals of statistics over repetitions with known truth: a Markdown table.

The second table stops each repetition by itself as lw.Until does: looks at blocks of 256 members from `members` on, then
whenever 5 % came to them, until the interval of a mean is narrow enough. The third is of designs with replicates: functions
of x = a . z, z four normal numbers from four columns of the unit cube; with the median width of the intervals, over that of
as many independent members'. The fourth stops these, with looks at powers of two. These take a fifth of the repetitions.
"""

import numpy as np
from scipy.special import ive, ndtr, ndtri

import lgvi_warp as lw
from benchmarks.pages import line, markdown
from lgvi_warp.physics.notation import matrix_from_rotation_vector
from lgvi_warp.sampling.designs import sampling_of
from lgvi_warp.sampling.designs.space import Space
from lgvi_warp.statistics.estimates.tree import Tree
from lgvi_warp.statistics.until import StoppingRule
from lgvi_warp.statistics.values.values import Values, dealt

BLOCK = 256
# Members of the first table's intervals.
FEW = (2, 5, 10, 30, 100, 1000)
# Of the designs with replicates: members, and the weights of four normal numbers, those of another sum backwards.
MEMBERS = 1024
A = np.sqrt([0.49, 0.25, 0.16, 0.1])
SPACE = ("z",), (4,), tuple((f"z[{i}]", (i,)) for i in range(4))
DESIGNS = (
    {"sobol": {"replicates": 8}},
    {"sobol": {"replicates": 16}},
    {"sobol": {"replicates": 32}},
    {"halton": {"replicates": 16}},
    {"latin_hypercube": {"group": 64, "replicates": 16}},
)


def quantity(d=1):
    return lw.statistics.Quantity("x", lambda samples, members: None, "1", (), tuple(f"x[{i}]" for i in range(d)))


def parts(statistic, blocks, replicates=1):
    """The tree after each block of values (repetitions, members, d): repetitions stand where times do."""
    tree = Tree(statistic.join)
    for i, x in enumerate(blocks):
        gathers = statistic.open(np.arange(float(len(x))), x.shape[1])
        given = np.ascontiguousarray(np.moveaxis(x, 2, 1)), None, i * BLOCK, i, BLOCK
        gathers.take(Values(*given) if replicates == 1 else dealt(*given, replicates), slice(0, len(x)))
        tree.add(i, gathers.close())
        yield tree


def said(statistic, tree, repetitions, replicates=1):
    """The estimate of what the tree holds."""
    time = np.arange(repetitions, dtype=float)
    if replicates == 1:
        return statistic.estimates(tree.parts(), time)[0]
    return statistic.estimates_of_replicates(tree.parts(), time, replicates)[0]


def last(statistic, x, replicates=1):
    """The estimate of all."""
    *_, tree = parts(statistic, np.split(x, range(BLOCK, x.shape[1], BLOCK), axis=1), replicates)
    return said(statistic, tree, len(x), replicates)


def held(answer, truth, value=""):
    return float(np.mean((answer[f"{value}lower"] <= truth) & (truth <= answer[f"{value}upper"])))


def held_on_circle(answer, truth):
    away = np.abs((answer.value - truth + np.pi) % (2.0 * np.pi) - np.pi)
    return float(np.mean(away <= answer.half_width))


def passages(repetitions, members, loss):
    """(repetitions, 7): which intervals of a first passage hold. Exponential of 5, seen at 7 times; losses of another mean."""
    rng, times, good = np.random.default_rng(3), np.arange(8.0), []
    for _ in range(repetitions):
        passage, lost = rng.exponential(5.0, members), rng.exponential(loss, members)
        statistic = lw.statistics.FirstPassage(quantity(), above=0.5)
        gathers = statistic.open(times, members)
        x = (passage <= times[:, None]).astype(float)[:, None]
        gathers.take(Values(x, lost > times[:, None]), slice(0, len(times)))
        found, truth = statistic.estimates([gathers.close()], times)[0], -np.expm1(-times / 5.0)
        good.append(((found.lower <= truth) & (truth <= found.upper))[1:])
    return np.array(good)


def attitudes(repetitions, members, at_once=500):
    """Part of the intervals of a mean attitude's turns about three axes that hold."""
    rng, good = np.random.default_rng(4), []
    for first in range(0, repetitions, at_once):
        shape = (min(at_once, repetitions - first), members, 3)
        R = matrix_from_rotation_vector(rng.normal(size=shape) * [0.2, 0.5, 0.3])
        found = last(lw.statistics.MeanAttitude(), R.reshape(*shape[:2], 9))
        X = found.value
        turn = 0.5 * np.stack([X[:, 2, 1] - X[:, 1, 2], X[:, 0, 2] - X[:, 2, 0], X[:, 1, 0] - X[:, 0, 1]], axis=1)
        good.append(np.abs(turn) <= found["rotation_half_width"])
    return float(np.mean(np.concatenate(good)))


def kinds(repetitions, members):
    """Name -> part of the intervals that hold, of 95 %."""
    rng = np.random.default_rng(1)
    a = rng.normal(size=(repetitions, members, 1))
    b = 0.6 * a + 0.8 * rng.normal(size=a.shape)
    x, heavy = quantity(), np.exp(a)
    levels = (0.1, 0.5, 0.9)
    cov = last(lw.statistics.Covariance(quantity(2)), np.concatenate([a, b], axis=2))
    inside = (cov.lower <= (truth := np.array([[1.0, 0.6], [0.6, 1.0]]))) & (truth <= cov.upper)
    yield "mean, normal", held(last(lw.statistics.Mean(x), a), 0.0)
    yield "mean, lognormal", held(last(lw.statistics.Mean(x), heavy), np.exp(0.5))
    yield "variance, normal", float(inside[:, [0, 1], [0, 1]].mean())
    yield "covariance, normal, correlated by 0.6", float(inside[:, 0, 1].mean())
    yield "variance, lognormal", held(last(lw.statistics.Covariance(x), heavy), (np.e - 1.0) * np.e)
    yield "quantiles 0.1, 0.5, 0.9", held(last(lw.statistics.Quantiles(x, levels), a), ndtri(np.array(levels))[:, None])
    yield (
        "the same from a sketch of 64",
        held(last(lw.statistics.Quantiles(x, levels, size=64), a), ndtri(np.array(levels))[:, None]),
    )
    yield "probability of 0.16", held(last(lw.statistics.Exceedance(x, above=1.0), a), ndtr(-1.0))
    yield "probability of 0.01", held(last(lw.statistics.Exceedance(x, above=2.3263), a), ndtr(-2.3263))
    circle = last(lw.statistics.CircularMean(x), rng.vonmises(1.0, 2.0, size=a.shape))
    yield "circular mean", held_on_circle(circle, 1.0)
    yield "resultant length", held(circle, ive(1, 2.0) / ive(0, 2.0), "resultant_length_")
    yield "mean attitude", attitudes(repetitions, members)
    yield "first passage, half lost by the end", float(passages(repetitions, members, 10.0).mean())
    yield "first passage at the end, 97 % lost by then", float(passages(repetitions, members, 2.0)[:, -1].mean())


def stopped(repetitions, until, blocks, truth, replicates=1):
    """Coverage of a mean where each repetition stops by itself, and the members it took on average."""
    statistic = lw.statistics.Mean(quantity())
    watch = StoppingRule(until, statistic, statistic.key, {}, np.zeros(1, int), doubling=replicates > 1)
    good, members = np.zeros(repetitions, bool), np.zeros(repetitions)
    for i, tree in enumerate(parts(statistic, blocks, replicates), 1):
        if not watch.due(i * BLOCK):
            continue
        found = said(statistic, tree, repetitions, replicates)
        now = (members == 0) & (found.half_width[:, 0] <= until.half_width)
        members[now] = i * BLOCK
        good[now] = ((found.lower <= truth) & (truth <= found.upper))[now, 0]
        if members.all():
            break
    # Who never had enough keeps the interval of all.
    left = members == 0
    assert not left.any() or i * BLOCK == watch.looked
    members[left] = i * BLOCK
    good[left] = ((found.lower <= truth) & (truth <= found.upper))[left, 0]
    return float(good.mean()), float(members.mean())


LAWS = {
    "normal": (lambda rng, shape: rng.normal(size=shape), 0.0, 1.0),
    "lognormal": (lambda rng, shape: np.exp(rng.normal(size=shape)), np.exp(0.5), np.sqrt((np.e - 1.0) * np.e)),
}


def stops(repetitions):
    """(law, members before the first look, asked for, coverage, members taken)."""
    for law, (draw, truth, deviation) in LAWS.items():
        for least, wanted in ((256, 512), (1024, 512), (256, 4096)):
            half = 1.96 * deviation / np.sqrt(wanted)
            rng = np.random.default_rng(2)
            blocks = (draw(rng, (repetitions, BLOCK, 1)) for _ in range(100))
            yield law, least, wanted, *stopped(repetitions, lw.Until("mean x", half, members=least), blocks, truth)


def sums(repetitions, design, members=MEMBERS):
    """(repetitions, members, 2): the two sums of normal numbers of members of a design, with other seeds."""
    sampling, weights = sampling_of(design), np.stack([A, A[::-1]], axis=1)
    drawn = (sampling.draw(Space(seed, *SPACE), np.arange(members))["z"] for seed in range(repetitions))
    return np.stack([ndtri(u) @ weights for u in drawn])


def judged(xy, replicates):
    """(name, part of the intervals that hold, their median width) of statistics of these members."""
    x = xy[..., :1]
    c, levels = A @ A[::-1], np.array([0.1, 0.5, 0.9])
    angles = (1.0 + 0.8 * x + np.pi) % (2.0 * np.pi) - np.pi
    cases = [
        ("mean of a linear function", lw.statistics.Mean(quantity()), x, 0.0),
        ("mean, lognormal", lw.statistics.Mean(quantity()), np.exp(x), np.exp(0.5)),
        ("covariance", lw.statistics.Covariance(quantity(2)), xy, np.array([[1.0, c], [c, 1.0]])),
        ("quantiles 0.1, 0.5, 0.9", lw.statistics.Quantiles(quantity(), levels), x, ndtri(levels)[:, None]),
        ("probability of 0.16", lw.statistics.Exceedance(quantity(), above=1.0), x, ndtr(-1.0)),
        ("probability of 0.01", lw.statistics.Exceedance(quantity(), above=2.3263), x, ndtr(-2.3263)),
        ("circular mean", lw.statistics.CircularMean(quantity()), angles, 1.0),
    ]
    for name, statistic, values, truth in cases:
        found = last(statistic, values, replicates)
        yield name, held(found, truth), float(np.median(found.upper - found.lower))


def replicated(repetitions, design):
    """(name, part of the intervals that hold, their width over that of independent members')."""
    (settings,) = design.values()
    independent = judged(sums(repetitions, "random"), 1)
    for (name, part, width), (_, _, wide) in zip(
        judged(sums(repetitions, design), settings["replicates"]), independent, strict=True
    ):
        yield name, part, width / wide


def replicated_stops(repetitions, design, most=16_384):
    """(law, asked for, coverage, members taken) of means of linear and lognormal functions, first looked at with 1,024."""
    (settings,) = design.values()
    linear = sums(repetitions, design, most)[..., :1]
    for law, wanted in (("normal", 50_000), ("normal", 1_000_000), ("lognormal", 10_000), ("lognormal", 40_000)):
        _, truth, deviation = LAWS[law]
        half = 1.96 * deviation / np.sqrt(wanted)
        blocks = (linear[:, first : first + BLOCK] for first in range(0, most, BLOCK))
        chosen = (np.exp(x) if law == "lognormal" else x for x in blocks)
        yield law, wanted, *stopped(repetitions, lw.Until("mean x", half), chosen, truth, settings["replicates"])


def add_options(parser):
    parser.add_argument("--repetitions", type=int, default=10_000)


def main(repetitions):
    head = [f"part that holds of {repetitions:,} intervals of 95 %, of members:", *(f"{one:,}" for one in FEW)]
    columns = zip(*(kinds(repetitions, members) for members in FEW), strict=True)
    show(head, ([row[0][0], *(f"{part:.1%}" for _, part in row)] for row in columns))
    head = ["stopped: mean of", "first look at", "half width as of", "holds", "members taken"]
    show(head, ([law, f"{least}", f"{wanted}", f"{part:.1%}", f"{taken:.0f}"]
                for law, least, wanted, part, taken in stops(repetitions)))  # fmt: skip
    few = max(1, repetitions // 5)
    head = [f"{few:,} intervals of 95 %, each of {MEMBERS:,} members: hold, width", *map(called, DESIGNS)]
    columns = zip(*(replicated(few, design) for design in DESIGNS), strict=True)
    show(head, ([row[0][0], *(f"{part:.1%}, {width:.2f}" for _, part, width in row)] for row in columns))
    head = ["stopped: mean of", "design", "half width as of", "holds", "members taken"]
    show(head, ([law, called(design), f"{wanted}", f"{part:.1%}", f"{taken:.0f}"] for design in DESIGNS[:2]
                for law, wanted, part, taken in replicated_stops(few, design)))  # fmt: skip


def show(head, rows):
    """Print a table, each row once it is measured."""
    print(markdown(head, ()))
    for row in rows:
        print(line(row), flush=True)
    print()


def called(design):
    """A design's name and replicates."""
    ((kind, settings),) = design.items()
    return f"`{kind}`, {settings['replicates']}"
