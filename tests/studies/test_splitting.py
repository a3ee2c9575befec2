# SPDX-License-Identifier: Apache-2.0
"""Splitting in time: linear motions by NumPy and vehicles in white noise, whose answers are known."""

import pickle
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.special import ndtr, ndtri

import lgvi_warp as lw
from lgvi_warp.sampling.final import joined
from lgvi_warp.uncertainty.rare.causes import Chance, chances_of
from lgvi_warp.uncertainty.rare.event import SURE, condition_of
from lgvi_warp.uncertainty.rare.flock import Flock
from lgvi_warp.uncertainty.rare.moving import moved
from lgvi_warp.uncertainty.rare.splitting import piloted, split_runs
from lgvi_warp.uncertainty.rare.stages import Stage, walked
from lgvi_warp.uncertainty.rare.subset import NoProgress
from lgvi_warp.uncertainty.rare.walk import VehicleWalk, pieces
from tests.support.rare import split
from tests.support.refusals import says

# A body of mass and added mass M in linear drag and white noise of force: speeds die out in TAU, and grow by S sqrt(t).
DRAG, FORCE, H, T1 = 20.0, 30.0, 0.1, 3.0
VEHICLE = lw.Scene.named("sphere").vehicle
M = 1.5 * float(VEHICLE.mass)
TAU, S = M / DRAG, FORCE / M
RUN = {"method": "psi_x", "h": H, "t1": T1, "threads": 1}
NORTH = 0.5


@dataclass
class Place:
    """Places (n,) and speeds (n,) as columns."""

    x: np.ndarray

    def part(self, rows):
        return Place(self.x[rows])


def normals_of(keys, seed, step):
    """A standard normal (n,) for each key at a step, the same whenever it is asked (SplitMix64; Steele, Lea & Flood 2014)."""
    with np.errstate(over="ignore"):
        z = keys.astype(np.uint64)
        for number in (seed, step):
            # No two keys and seeds have one product each: sums of them would be those of their neighbours.
            z = (z * np.uint64(0x9E3779B97F4A7C15)) ^ (np.uint64(number + 1) * np.uint64(0xD1B54A32D192ED03))
            z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
            z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
            z ^= z >> np.uint64(31)
    return ndtri(((z >> np.uint64(11)).astype(float) + 0.5) / 2.0**53)


class LinearWalk:
    """A speed in drag and noise, and its place, by steps of Euler; the place begins at u where `start` is not 0."""

    stretches = None

    def __init__(self, seed, bound, of=0, lasting=False, start=0.0, per=5, looks=20, dt=0.03):
        self.seed, self.bound, self.of = seed, bound, of
        self.looks, self.per, self.dt, self.start, self.d = looks, per, dt, start, int(start > 0.0)
        self.lasting, self.ran, self.fresh = np.array([lasting]), 0, 0

    @property
    def members(self):
        return -(-self.ran // self.looks)

    def keys(self, count):
        self.fresh += count
        return np.arange(self.fresh - count, self.fresh)

    def begin(self, u):
        n, no = len(u), np.zeros(len(u), bool)
        x = np.zeros((n, 2))
        x[:, 0] = self.start * u[:, 0] if self.d else 0.0
        return Flock(0, Place(x), np.full((1, n), -np.inf), np.full((1, n), -SURE), np.zeros((n, 0)), no, no, no)

    def advance(self, flock, keys):
        x, most = flock.place.x.copy(), flock.values[0].copy()
        self.ran += len(x)
        for step in range(self.per):
            noise = normals_of(keys, self.seed, flock.look * self.per + step)
            x[:, 1] += -self.dt * x[:, 1] + np.sqrt(self.dt) * noise
            x[:, 0] += self.dt * x[:, 1]
            most = np.fmax(most, x[:, self.of])
        values = most if self.lasting[0] else x[:, self.of]
        beyond, no = values - self.bound, np.zeros(len(x), bool)
        happened = (beyond > 0.0) & (self.lasting[0] | (flock.look + 1 == self.looks))
        return Flock(flock.look + 1, Place(x), values[None], beyond[None], x.copy(), happened, no, no)

    def joined(self, flocks):
        place = Place(np.concatenate([flock.place.x for flock in flocks]))
        return flocks[0] if len(flocks) == 1 else flocks[0].beside(flocks[1:], place)

    def spread(self):
        """Standard deviation of what is looked at, at the end."""
        A, B = (
            np.array([[1.0, self.dt * (1.0 - self.dt)], [0.0, 1.0 - self.dt]]),
            np.array([self.dt, 1.0]) * self.dt**0.5,
        )
        C = np.diag([self.start**2, 0.0])
        for _ in range(self.per * self.looks):
            C = A @ C @ A.T + np.outer(B, B)
        return float(np.sqrt(C[self.of, self.of]))


class TwoSpeeds:
    """Two independent speeds in drag and noise; the event is that either was ever beyond its bound."""

    d, lasting, stretches = 0, np.array([True, True]), None

    def __init__(self, seed, bounds, looks=64, dt=0.03):
        self.seed, self.bounds, self.looks, self.dt = seed, np.array(bounds)[:, None], looks, dt
        self.ran, self.fresh = 0, 0

    members, keys, joined = LinearWalk.members, LinearWalk.keys, LinearWalk.joined

    def begin(self, u):
        n, no = len(u), np.zeros(len(u), bool)
        return Flock(
            0, Place(np.zeros((n, 2))), np.full((2, n), -np.inf), np.full((2, n), -SURE), np.zeros((n, 0)), no, no, no
        )

    def advance(self, flock, keys):
        self.ran += len(keys)
        noise = np.column_stack([normals_of(keys, self.seed, 2 * flock.look + i) for i in range(2)])
        x = (1.0 - self.dt) * flock.place.x + np.sqrt(self.dt) * noise
        most = np.fmax(flock.values, x.T)
        beyond, no = most - self.bounds, np.zeros(len(x), bool)
        return Flock(flock.look + 1, Place(x), most, beyond, x.copy(), (beyond > 0.0).any(axis=0), no, no)


def passing(bound, steps, keep, noise, points=4001):
    """Probability that v <- keep v + noise xi, from 0, passes a bound within so many steps, by its density on a grid."""
    v = np.linspace(-8.0 * noise * np.sqrt(steps), bound, points)
    weight = np.full(points, v[1] - v[0])
    weight[[0, -1]] *= 0.5

    def density(x):
        return np.exp(-0.5 * (x / noise) ** 2) / noise / np.sqrt(2.0 * np.pi)

    to, out = density(v[:, None] - keep * v[None, :]) * weight, ndtr((keep * v - bound) / noise)
    here, passed = density(v), ndtr(-bound / noise)
    for _ in range(steps - 1):
        passed, here = passed + float((out * here * weight).sum()), to @ here
    return float(passed)


def shares_of(make, seeds, size, count):
    """Probabilities of independent runs with levels of a pilot of each seed, (len(seeds), count)."""
    rows = []
    for seed in seeds:
        walk = make(seed)
        pilot = piloted(walk, 400, np.random.default_rng([seed, 1]))
        split = split_runs(walk, pilot, size, [np.random.default_rng([seed, 2, i]) for i in range(count)])
        rows.append([run.probability for run in split.runs])
    return np.array(rows)


def check_mean(shares, p):
    """The mean is p, within three of its standard errors, which are small enough to tell."""
    error = shares.std(ddof=1) / np.sqrt(shares.size)
    assert error < 0.06 * p
    assert abs(shares.mean() - p) < 3.0 * error


def end_case(p, **more):
    def make(seed):
        walk = LinearWalk(seed, 0.0, **more)
        walk.bound = -ndtri(p) * walk.spread()
        return walk

    return make


# Looks are coarse on purpose: in a sixth of the time of the motion a speed changes by half of its spread.
@pytest.mark.ci
def test_runs_with_fixed_levels_have_the_right_mean():
    check_mean(shares_of(end_case(1e-3, of=0, start=0.4), range(6), 100, 64), 1e-3)


def test_runs_whose_starts_move_have_the_right_mean():
    # Starts have seven tenths of the variance: what copies of a member share decides.
    check_mean(shares_of(end_case(1e-3, of=0, start=2.0, per=1, dt=0.15), range(4), 100, 64), 1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("p", [1e-2, 1e-3, 1e-5])
@pytest.mark.parametrize("more", [{"of": 0}, {"of": 1}, {"of": 0, "start": 0.4}, {"of": 0, "start": 2.0}])
def test_runs_with_fixed_levels_have_the_right_mean_over_seeds(p, more):
    check_mean(shares_of(end_case(p, **more), range(10), 200, 64), p)


@pytest.mark.slow
@pytest.mark.parametrize("bound, views", [(1.9, 20), (2.6, 20), (3.05, 100)])
def test_runs_with_fixed_levels_have_the_right_mean_of_a_largest_speed(bound, views):
    p, per = passing(bound, 100, 0.97, np.sqrt(0.03)), 100 // views
    check_mean(shares_of(lambda seed: LinearWalk(seed, bound, 1, True, per=per, looks=views), range(10), 200, 64), p)


@pytest.mark.ci
def test_the_grid_of_densities_knows_reflection():
    # Many steps of a motion without drag: P(max > b) is twice P(end > b), with the bound moved by 0.5826 of a step's spread.
    steps, noise = 100, 0.1
    bound = 2.5
    assert passing(bound, steps, 1.0, noise) == pytest.approx(2.0 * ndtr(-(bound + 0.5826 * noise)), rel=0.01)


def chances_of_two(seed, bounds, error):
    found = split(TwoSpeeds(seed, bounds), relative_error=error, seed=seed)
    of_any = Chance(found.probability, *found.interval())
    return chances_of(("a", "b"), found.rows, found.weights, found.of_run, of_any, found.spread)


# Both are as probable as that one of them happens after the other: who goes no further than the first sees half of that.
@pytest.mark.ci
@pytest.mark.parametrize("bounds, seeds, least", [
    pytest.param((1.3, 1.5), range(3), 3, id="likely"),
    pytest.param((2.2, 2.4), range(20), 18, id="rare", marks=pytest.mark.slow),
    pytest.param((1.3, 1.5), range(20), 18, id="likely over seeds", marks=pytest.mark.slow),
])  # fmt: skip
def test_each_condition_is_told_beside_the_others(bounds, seeds, least):
    a, b = (passing(bound, 64, 0.97, np.sqrt(0.03)) for bound in bounds)
    truth = {"a": a, "b": b, "any": a + b - a * b, "all": a * b}
    held, told = dict.fromkeys(truth, 0), []
    for seed in seeds:
        found = chances_of_two(seed, bounds, 0.1)
        told.append(found["all"].probability)
        for name, p in truth.items():
            held[name] += found[name].lower <= p <= found[name].upper
    assert min(held.values()) >= least, held
    if a * b > 1e-3:
        assert np.mean(told) == pytest.approx(a * b, rel=0.25)


def scored(make, seeds, p, error=0.1):
    """(probability over p, told spread) of whole searches, (len(seeds), 2)."""
    answers = [split(make(seed), relative_error=error, seed=seed) for seed in seeds]
    return np.array([(each.probability / p, each.spread) for each in answers])


def check_told(rows):
    """Nineteen of twenty within three told spreads, the told ones those that are seen, and a right mean."""
    away = np.abs(rows[:, 0] - 1.0) / rows[:, 1]
    assert (away < 3.0).sum() >= 0.95 * len(rows)
    seen, told = np.sqrt(np.mean((rows[:, 0] - 1.0) ** 2)), np.sqrt(np.mean(rows[:, 1] ** 2))
    assert 1.0 / 1.5 < told / seen < 1.5
    assert abs(rows[:, 0].mean() - 1.0) < 3.0 * seen / np.sqrt(len(rows))


@pytest.mark.slow
@pytest.mark.parametrize("more", [{"of": 0}, {"of": 1}, {"of": 0, "start": 0.4}, {"of": 0, "start": 2.0}])
def test_the_error_told_is_that_seen(more):
    check_told(scored(end_case(1e-5, looks=50, per=2, **more), range(40), 1e-5))


def test_a_start_that_stays_reaches_its_level_again():
    """A step of nothing runs each member again, with the noise of all its stages, to where it was."""
    walk, rngs = end_case(1e-4, of=0, start=2.0)(3), [np.random.default_rng(2)]
    pilot = piloted(walk, 200, np.random.default_rng(1))
    stage, stages = Stage.first(walk, rngs[0].standard_normal((300, 1)), np.zeros(300, int)), []
    for i, bound in enumerate(pilot.bounds[:3]):
        crossed = walked(walk, pilot.score, stage, bound)
        stages.append(stage)
        stage = stage.next(walk, crossed, 300, rngs)
        again, share = moved(walk, pilot.score, list(stages), stage, bound, np.zeros(1), rngs)
        assert share == 1.0
        np.testing.assert_array_equal(again.u, stage.u)
        np.testing.assert_array_equal(again.before, stage.before)
        for look, (rows, flock) in stage.entrants.items():
            those, there = again.entrants[look]
            np.testing.assert_array_equal(there.place.x[np.argsort(those)], flock.place.x[np.argsort(rows)])
        stage, share = moved(walk, pilot.score, stages, stage, bound, pilot.steps[i], rngs)
        assert 0.2 < share < 0.9


def test_what_never_comes_nearer_is_refused():
    class Still(LinearWalk):
        def advance(self, flock, keys):
            there = super().advance(flock, keys)
            return Flock(there.look, flock.place, 0.0 * there.values, there.distances * 0.0 - 1.0, there.features * 0.0,
                         there.happened & False, there.over, there.lost)  # fmt: skip

    with pytest.raises(NoProgress):
        piloted(Still(0, 1.0), 100, np.random.default_rng(0))


def test_pieces_are_whole_units():
    np.testing.assert_array_equal(pieces(30, 1, 50), [1] * 30)
    np.testing.assert_array_equal(pieces(100, 5, 7), [15] * 6 + [10])
    np.testing.assert_array_equal(pieces(7, 10, 3), [7])


def scene_of(*more, drag=True, **start):
    terms = [lw.terms.Drag(linear=[DRAG] * 3 + [1.0] * 3)] if drag else []
    noise = lw.terms.WrenchNoise(force=(FORCE, 0.0, 0.0))
    return lw.Scene(
        VEHICLE, terms=[*terms, noise], start=lw.Start(**{"velocity": [1.0, 0.0, 0.0]} | start), events=more
    )


def place_of(p, north=0.0):
    """Quantile p of a member's final place north."""
    s = np.linspace(0.0, T1, 20_001)
    of_noise = np.trapezoid((TAU * (1.0 - np.exp(-(T1 - s) / TAU)) * S) ** 2, s)
    return TAU * (1.0 - np.exp(-T1 / TAU)) - ndtri(p) * np.sqrt(of_noise + north**2)


def speed_of(p):
    return np.exp(-T1 / TAU) - ndtri(p) * S * np.sqrt(0.5 * TAU * (1.0 - np.exp(-2.0 * T1 / TAU)))


def both(**more):
    return lw.Ensemble(scene_of(**more), vary={"start.position[0]": lw.distributions.Normal(std=NORTH)})


# A run goes on from one prepared piece, whose samples are at every step: one kernel for all of these tests.
@pytest.fixture(scope="module")
def answer():
    return lw.rare_event(
        both(), f"position[0] - {place_of(1e-5, NORTH):.12g}", by="splitting", relative_error=0.2, **RUN
    )


@pytest.mark.slow
def test_noise_and_numbers_are_both_moved(answer):
    assert answer.estimator == "splitting"
    # Steps of 0.1 s have 0.1 % less variance, 2 % less probability.
    assert abs(answer.probability / 1e-5 - 1.0) < 3.0 * answer.relative_error
    assert answer.relative_error < 0.3
    assert answer.interval[0] < answer.probability < answer.interval[1]
    assert answer.members["the scene's own"] < 60_000
    # Of the 4.3 sd, numbers have their share of the variance.
    share = NORTH**2 / ((place_of(1e-5, NORTH) - place_of(0.5)) / -ndtri(1e-5)) ** 2
    assert answer.moved["start.position[0]"] == pytest.approx(4.4 * np.sqrt(share), abs=0.5)
    assert answer.draws.shape == (len(answer.weights), 0)
    assert any("draws of noise are not numbers" in message for message in answer.messages)
    assert len(answer.runs) % 16 == 0


@pytest.mark.ci
def test_a_failing_path_is_run_again(answer):
    assert len(answer.paths) == len(answer.weights) > 100
    levels = ndtr(answer.normals)
    runs = {}
    for i in np.random.default_rng(0).choice(len(answer.paths), 5, replace=False):
        times, indices = answer.paths[i]
        assert (times[0], times[-1]) == (0.0, T1)
        end = None
        for begin, stop, index in zip(times[:-1], times[1:], indices, strict=True):
            steps = round((stop - begin) / H)
            if steps not in runs:
                settings = RUN | {"t1": float(np.round(steps * H, 9)), "save": lw.SaveAt(final=True)}
                runs[steps] = lw.prepare(both(), levels=True, **settings)
            run, noise = runs[steps], {"indices": [index], "seed": 0}
            end = (run(levels[i : i + 1], **noise) if end is None else run.states(end, **noise)).final
        assert end.position[0, 0] > place_of(1e-5, NORTH)


@pytest.mark.ci
def test_the_answer_is_kept_in_files(answer, tmp_path):
    answer.save(tmp_path)
    again = lw.studies.RareEvent.load(tmp_path / "rare.json")
    assert str(again) == str(answer) == str(pickle.loads(pickle.dumps(answer)))
    np.testing.assert_array_equal(again.paths[3][1], answer.paths[3][1])
    assert "splitting in time" in str(answer)
    pytest.importorskip("matplotlib")
    assert len(lw.plots.rare(answer, path=tmp_path / "rare.png")) == 2


def test_failing_members_have_starts_of_their_own(answer):
    # They were copied at each of some ten levels; steps from the copies' starts tell them apart.
    starts, weight = np.unique(answer.normals, return_inverse=True)
    shares = np.bincount(weight.ravel(), answer.weights)
    assert len(starts) > 100
    assert 1.0 / np.sum(shares**2) > 50.0
    assert not any("different starts" in message for message in answer.messages)


@pytest.mark.ci
def test_the_same_seed_has_the_same_answer():
    limit = f"position[0] - {place_of(1e-2):.12g}"
    first, again, other = (
        lw.rare_event(scene_of(), limit, by="splitting", relative_error=0.3, seed=seed, **RUN) for seed in (1, 1, 2)
    )
    assert first.probability == again.probability != other.probability
    assert first.failing is None
    assert "likeliest" not in str(first)
    # What is likely is told by fewer plain members.
    assert first.plain_members < sum(first.members.values())
    assert "splitting gains nothing here" in str(first)


@pytest.mark.ci
@pytest.mark.parametrize("limit, at_once", [
    ("position[0] - 1.0", "position[0]"),
    ("max(position[0]) - 1.0", "max(position[0])"),
    ({"min(velocity[0])": {"below": -1.0}}, "min(velocity[0])"),
])  # fmt: skip
def test_pieces_tell_what_a_whole_run_does(limit, at_once):
    settings = RUN | {"save": lw.SaveAt(every=H)}
    walk = VehicleWalk(both(), condition_of(limit, scene_of()), settings, False, 7, 10)
    u, keys = np.array([[-1.0], [0.2], [2.0]]), walk.keys(3)
    there = walk.begin(u)
    for _ in range(walk.looks):
        there = walk.advance(there, keys)
    whole = lw.prepare(both(), of=at_once, levels=True, **settings)(ndtr(u), seed=7, indices=keys)
    np.testing.assert_array_equal(there.values[0], whole)
    assert (walk.looks, walk.members) == (10, 3)


@pytest.mark.slow
@pytest.mark.parametrize("limit", ["max_error depth", "iae depth", "ise heading"])
def test_pieces_tell_what_a_loop_does(limit):
    scene = lw.Scene.load("examples/scenes/remus_100_autopilot.toml")
    settings = {"method": "rk4", "h": 0.02, "t1": 6.0, "threads": 1}
    wind = lw.terms.WrenchNoise(force=(3.0, 3.0, 3.0))
    scene = lw.Scene(scene.vehicle, terms=[*scene.terms, wind], start=scene.start, controller=scene.controller)
    walk = VehicleWalk(scene, condition_of({limit: {"above": 1.0}}, scene), settings, False, 7, 13)
    keys, there = walk.keys(4), walk.begin(np.zeros((4, 0)))
    for _ in range(walk.looks):
        there = walk.advance(there, keys)
    run = lw.prepare(scene, of=limit, **settings)
    states = {name: np.repeat(getattr(lw.Ensemble(scene).select(0, 1), name), 4, axis=0)
              for name in ("position", "attitude", "velocity", "angular_velocity")}  # fmt: skip
    np.testing.assert_allclose(there.values[0], run.states(**states, seed=7, indices=keys), rtol=1e-12)


def test_copies_have_noise_of_their_own():
    """Frozen noise would lead copies of a member the same way: no key ever comes twice."""
    condition = condition_of("position[0] - 9.0", scene_of())
    walk = VehicleWalk(both(), condition, RUN, False, 0, 50)
    there = walk.advance(walk.begin(np.zeros((2, 1))), walk.keys(2))
    copies = walk.advance(there.part(np.zeros(200, int)), walk.keys(200))
    speeds = copies.place.velocity[:, 0]
    assert len(np.unique(speeds)) == 200
    # A step's noise about the parent's speed.
    assert speeds.std() == pytest.approx(S * np.sqrt(H), rel=0.2)
    assert walk.keys(3).tolist() == [202, 203, 204]
    np.testing.assert_array_equal(there.place.parameters["vehicle.mass"], copies.place.parameters["vehicle.mass"])


@pytest.mark.ci
def test_ends_that_are_joined_go_on_as_they_were():
    run = lw.prepare(both(), levels=True, **RUN | {"t1": H, "save": lw.SaveAt(every=H, final=True)})
    first = run(np.linspace(0.1, 0.9, 7)[:, None], seed=3).final
    shuffled = joined([first.part([4, 1]), first.part([0]), first.part([6, 5, 3, 2])])
    order = np.array([4, 1, 0, 6, 5, 3, 2])
    whole, parts = run.states(first, seed=3), run.states(shuffled, seed=3)
    for name in ("position", "velocity", "attitude"):
        np.testing.assert_array_equal(getattr(parts.final, name), getattr(whole.final, name)[order])
    assert joined([first]) is first


def check_over_seeds(fleet, limit, p, seeds=20, **more):
    rows = []
    for seed in range(seeds):
        each = lw.rare_event(fleet, limit, by="splitting", relative_error=0.2, seed=seed, **RUN | more)
        rows.append((each.probability / p, each.relative_error))
    check_told(np.array(rows))


@pytest.mark.slow
@pytest.mark.parametrize("p", [1e-5, 1e-6])
@pytest.mark.parametrize("of, bound", [("position[0]", place_of), ("velocity[0]", speed_of)])
def test_ends_under_white_force(p, of, bound):
    # Steps of 0.05 s have 0.03 % less variance of the place: 0.6 % less probability at 1e-6.
    check_over_seeds(scene_of(), f"{of} - {bound(p):.12g}", p, h=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("bound", [4.7, 5.2])
def test_the_largest_speed_without_drag(bound):
    noise = S * np.sqrt(H)
    p = passing(bound * S, round(T1 / H), 1.0, noise)
    limit = f"max(velocity[0]) - {bound * S:.12g}"
    fleet = scene_of(drag=False, velocity=[0.0, 0.0, 0.0])
    assert 1e-7 < p < 1e-2
    check_over_seeds(fleet, limit, p, save=lw.SaveAt(every=H))


@pytest.mark.slow
def test_against_many_plain_members():
    """Mass, start and noise together, and an event that stops members: 400,000 plain members against ten answers."""
    vary = {
        "start.position[0]": lw.distributions.Normal(std=NORTH),
        "vehicle.mass": lw.distributions.Normal(mean=float(VEHICLE.mass), std=0.1 * float(VEHICLE.mass)),
    }
    far = lw.events.Box(lower=[-99.0, -99.0, -99.0], upper=[place_of(2e-3, NORTH), 99.0, 99.0], name="wall")
    fleet = lw.Ensemble(scene_of(far), vary=vary)
    settings = RUN | {"save": lw.SaveAt(every=H)}
    plain = lw.solve(fleet.with_seed(5, 400_000), keep="none", **RUN)
    p = float((plain.status == lw.Status.BOX).mean())
    answers = [lw.rare_event(fleet, "wall", by="splitting", seed=seed, **settings) for seed in range(10)]
    mean = np.mean([each.probability for each in answers])
    error = np.hypot(np.sqrt(p / 400_000), np.sqrt(np.sum([(each.relative_error * p) ** 2 for each in answers])) / 10.0)
    assert error < 0.06 * p
    assert abs(mean - p) < 3.0 * error


@pytest.mark.slow
def test_an_event_that_stops_members():
    scene = scene_of(lw.events.Box(lower=[-99.0, -99.0, -99.0], upper=[place_of(1e-2), 99.0, 99.0], name="wall"))
    found = lw.rare_event(scene, "wall", by="splitting", relative_error=0.2, save=lw.SaveAt(every=H), **RUN)
    # A member that is beyond the wall at the end went through it, and few come back.
    assert 0.01 * (1.0 - 3.0 * found.relative_error) < found.probability < 0.02
    assert found.event == "wall"


@pytest.mark.ci
def test_members_that_fail_are_the_event_and_told_apart():
    bound = place_of(1e-2)

    def lost(samples, members):
        north = samples["position"][..., 0]
        return np.where(north > bound + 0.3, np.nan, north - bound)

    limit = lw.statistics.Quantity("lost", lost, "m", ("position",))
    found = lw.rare_event(scene_of(), limit, by="splitting", relative_error=0.2, **RUN)
    # What is beyond at any look has failed then: some of it would come back.
    assert 0.01 * (1.0 - 3.0 * found.relative_error) < found.probability < 0.02
    assert 0.2 < found.failed_share < 0.9
    with pytest.raises(lw.SceneError, match='failed="event"'):
        lw.rare_event(scene_of(), limit, by="splitting", failed="refuse", **RUN)


@pytest.mark.slow
def test_two_sides():
    bound, mean = place_of(5e-4), place_of(0.5)
    limit = {"max(position[0])": {"above": bound}, "min(position[0])": {"below": -bound + mean}}
    save = lw.SaveAt(every=H)
    found = lw.rare_event(both(), limit, by="splitting", relative_error=0.3, save=save, **RUN)
    assert found.event.count(" or ") == 1
    assert found.probability > 5e-4


@pytest.mark.ci
@pytest.mark.slow_for("*reached by none of some")
@pytest.mark.parametrize("limit, words", [
    ("position[0] - 1000.0", "was reached by none of some"),
    ("position[1] - 1.0", "has the same value for most members"),
    ("mean(depth) - 1.0", "is of the whole path"),
    (lambda result: result.position[-1, :, 0], "is a function of a whole Result"),
    ("position", "is 3 numbers"),
])  # fmt: skip
def test_what_splitting_cannot_follow_is_refused(limit, words):
    with pytest.raises(lw.SceneError) as error:
        lw.rare_event(both(), limit, by="splitting", **RUN | {"save": lw.SaveAt(every=H)})
    assert words in str(error.value)


def test_faulty_arguments():
    with pytest.raises(lw.SceneError) as error:
        lw.rare_event(both(), "depth - 1.0", by="splitting", cheaper=[{"h": 0.2}], relative_error=2.0, **RUN)
    says(str(error.value), "cheaper", "relative_error = 2.0")
    with pytest.raises(lw.SceneError, match="by = 'levels'"):
        lw.rare_event(both(), "depth - 1.0", by="levels", **RUN)
    with pytest.raises(lw.SceneError, match="intervals = 1"):
        lw.rare_event(both(), "depth - 1.0", by="splitting", intervals=1, **RUN)
    with pytest.raises(lw.SceneError, match="names times of a whole run"):
        lw.rare_event(both(), "depth - 1.0", by="splitting", save=lw.SaveAt(at=[1.0]), **RUN)
    still = lw.Ensemble(lw.Scene(VEHICLE), vary={"start.position[0]": lw.distributions.Normal(std=NORTH)})
    with pytest.raises(lw.SceneError, match="has no noise"):
        lw.rare_event(still, "position[0] - 1.0", by="splitting", **RUN)
