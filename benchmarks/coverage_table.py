"""How often the intervals of statistics hold the true value, of so many repetitions with known truth: a Markdown table.

python benchmarks/coverage_table.py

The second table stops each repetition by itself as lw.Until does: looks at blocks of 256 members from `members` on, then
whenever 5 % came to them, until the interval of a mean is narrow enough.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from scipy.special import ive, ndtr, ndtri

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import lgvi_warp as lw
from lgvi_warp.statistics.tree import Tree
from lgvi_warp.statistics.until import Watch
from lgvi_warp.statistics.values import Values

BLOCK = 256


def quantity(d=1):
    return lw.Quantity("x", lambda samples, members: None, "1", (), tuple(f"x[{i}]" for i in range(d)))


def parts(statistic, blocks):
    """The tree after each block of values (repetitions, members, d): repetitions stand where times do."""
    tree = Tree(statistic.join)
    for i, x in enumerate(blocks):
        gathers = statistic.open(len(x), x.shape[1])
        gathers.take(Values(np.ascontiguousarray(np.moveaxis(x, 2, 1)), None, i * BLOCK, i, BLOCK), slice(0, len(x)))
        tree.add(i, gathers.close())
        yield tree


def last(statistic, x):
    """The estimate of all."""
    *_, tree = parts(statistic, np.split(x, range(BLOCK, x.shape[1], BLOCK), axis=1))
    return statistic.estimates(tree.parts(), np.arange(len(x), dtype=float))[0]


def held(found, truth, value=""):
    return float(np.mean((found[f"{value}lower"] <= truth) & (truth <= found[f"{value}upper"])))


def kinds(repetitions, members):
    """Name -> part of the intervals that hold, of 95 %."""
    rng = np.random.default_rng(1)
    a = rng.normal(size=(repetitions, members, 1))
    b = 0.6 * a + 0.8 * rng.normal(size=a.shape)
    x, heavy = quantity(), np.exp(a)
    levels = (0.1, 0.5, 0.9)
    cov = last(lw.Covariance(quantity(2)), np.concatenate([a, b], axis=2))
    yield "mean, normal", held(last(lw.Mean(x), a), 0.0)
    yield "mean, lognormal", held(last(lw.Mean(x), heavy), np.exp(0.5))
    yield "covariance, normal", held(cov, np.array([[1.0, 0.6], [0.6, 1.0]]))
    yield "covariance, lognormal", held(last(lw.Covariance(x), heavy), (np.e - 1.0) * np.e)
    yield "quantiles 0.1, 0.5, 0.9", held(last(lw.Quantiles(x, levels), a), ndtri(np.array(levels))[:, None])
    yield (
        "the same from a sketch of 64",
        held(last(lw.Quantiles(x, levels, size=64), a), ndtri(np.array(levels))[:, None]),
    )
    yield "probability of 0.16", held(last(lw.Exceedance(x, above=1.0), a), ndtr(-1.0))
    yield "probability of 0.01", held(last(lw.Exceedance(x, above=2.3263), a), ndtr(-2.3263))
    circle = last(lw.CircularMean(x), rng.vonmises(1.0, 2.0, size=a.shape))
    yield "circular mean", held(circle, 1.0)
    yield "resultant length", held(circle, ive(1, 2.0) / ive(0, 2.0), "resultant_length_")


def stopped(repetitions, until, draw, truth, most=100):
    """Coverage of a mean where each repetition stops by itself, and the members it took on average."""
    rng = np.random.default_rng(2)
    statistic = lw.Mean(quantity())
    watch = Watch(until, statistic, statistic.key, {}, np.zeros(1, int))
    good, members = np.zeros(repetitions, bool), np.zeros(repetitions)
    blocks = (draw(rng, (repetitions, BLOCK, 1)) for _ in range(most))
    for i, tree in enumerate(parts(statistic, blocks), 1):
        if not watch.due(i * BLOCK):
            continue
        (found,) = statistic.estimates(tree.parts(), np.arange(repetitions, dtype=float))
        now = (members == 0) & (found.half_width[:, 0] <= until.half_width)
        members[now] = i * BLOCK
        good[now] = ((found.lower <= truth) & (truth <= found.upper))[now, 0]
        if members.all():
            break
    assert members.all()
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
            yield law, least, wanted, *stopped(repetitions, lw.Until("mean x", half, members=least), draw, truth)


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--repetitions", type=int, default=10_000)
    chosen = arguments.parse_args()
    n = chosen.repetitions
    print(f"| {n:,} intervals of 95 %, each of 1,000 members | hold |\n|---|---|")
    for name, part in kinds(n, 1000):
        print(f"| {name} | {part:.1%} |", flush=True)
    print("\n| stopped: mean of | first look at | half width as of | holds | members taken |\n|---|---|---|---|---|")
    for law, least, wanted, part, taken in stops(n):
        print(f"| {law} | {least} | {wanted} | {part:.1%} | {taken:.0f} |", flush=True)


if __name__ == "__main__":
    main()
