# SPDX-License-Identifier: Apache-2.0
"""`estimate`: estimate a statistic to a requested error at the lowest cost."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.errors import Faults, SceneError, refusal
from lgvi_warp.common.progress import callback, shows_progress
from lgvi_warp.common.times import longest_step, whole_steps
from lgvi_warp.criteria.memory import Remembered
from lgvi_warp.engine.executors import check_threads
from lgvi_warp.measuring.ladders import SHORT
from lgvi_warp.measuring.speed import void
from lgvi_warp.methods.method import Method
from lgvi_warp.physics.terms.noisy import NoisyTerm
from lgvi_warp.runs.default_method import is_damped
from lgvi_warp.runs.request import ensemble_of
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.scene.settings import EnsembleSettings
from lgvi_warp.uncertainty.estimating import answering
from lgvi_warp.uncertainty.estimating.answer import Estimated
from lgvi_warp.uncertainty.estimating.choice import ESTIMATORS
from lgvi_warp.uncertainty.estimating.levels import Level, Runs, Setting
from lgvi_warp.uncertainty.estimating.pilot import Pilot
from lgvi_warp.uncertainty.estimating.question import Question, question_of

# Methods whose steps are tried: the scene's own, and the first of those that are cheapest by what acts.
METHODS = 2
# Halvings of the coarsest step that are tried, and doublings of one that was asked for.
HALVINGS, DOUBLINGS = 10, 4


@shows_progress
def estimate(
    fleet: Ensemble | Scene,
    of: Any,
    error: float | None = None,
    *,
    relative_error: float | None = None,
    t1: float | None = None,
    risk: Any = "mean",
    cheaper: Sequence[Mapping[str, Any] | Scene] = (),
    method: str | Method | None = None,
    h: float | None = None,
    dtype: str | None = None,
    estimator: str | None = None,
    recipe: Mapping[str, Any] | None = None,
    heavy_tail: bool = False,
    seed: int | None = None,
    threads: int | None = None,
    executor: Any = "threads",
    scheduler: str | None = None,
    store: str | os.PathLike[str] | None = None,
    progress: Callable[[float], None] | bool | None = None,
) -> Estimated:
    """Estimate a mean, probability or quantile to a requested accuracy at the lowest cost.

    A pilot runs few members at several steps. It estimates the bias of each step, and the cost of plain Monte Carlo,
    Sobol points, regression and levels (paired differences of fine and coarse settings). The cheapest estimator then
    runs with numbers of members that are fixed beforehand.

    Choices use counted costs (steps times force evaluations per step), so the same seed gives the same answer, to the
    bit, on any number of threads. `recipe` of the answer stores the choices, so that the same members can run again.

    A sample of n members can miss a group that behaves differently, up to a fraction 3 / n of all members. To estimate
    the effect of such a group, 512 to 2,048 members spread over all inputs, and members with extreme inputs, are run. A
    message gives the fraction of members that a mean may have missed. Rare values of a Choice form separate strata.

    Args:
        fleet: the ensemble, or a Scene with one. New members are drawn from its distributions; its sampling is unused.
        of: statistic to estimate, at the end of the run: a text such as "mean position[0]", "depth above 3", "outcome
            floor" or "max(depth)"; lw.statistics.Mean, Exceedance, Outcome, FirstPassage or Quantiles with one level;
            or a metric such as lw.metrics.ITAE("depth").
        error: requested root mean square error from sampling and bias together, in the unit of the statistic; above 0.
        relative_error: requested error divided by the statistic's value; give it instead of `error`.
        t1: end time [s]. Default: run.duration of the scene.
        risk: for a quantity or a metric: "mean" (the default), a quantile's level, such as 0.95, or lw.metrics.CVaR(0.05).
        cheaper: scenes that cost less and behave similarly, as tables of changed numbers, such as {"controller.delay":
            0.0}, or as Scenes. They are used only for the coarse levels. Default none.
        method: method of the estimate. Default: the scene's method and one that suits its terms are tried.
        h: step of the estimate [s]; its bias is reported. With `h` and no `method`, the scene's method is used.
        dtype: precision of all levels. Default: the scene's, and "float32" for some coarse levels.
        estimator: the estimator to use: "plain Monte Carlo", "sobol", "regression", "levels" or "levels of sobol".
            Default: the estimator with the lowest predicted cost.
        recipe: `recipe` of an earlier answer: the same members run again, without a pilot. The recipe gives error,
            setting, estimator and seed. Fleet, `of`, `risk` and `cheaper` must be the same as before.
        heavy_tail: True reports a mean even if its variance seems to be infinite. Default False: such a mean is refused.
        seed: seed of points and noise. Default: the ensemble's seed.
        threads: threads of the runs. Default: as in `lw.solve`.
        executor: "threads" (default), "processes" or "dask", or an object that runs blocks. Reported times are
            processor times for "threads", otherwise wall times.
        scheduler: address of Dask's scheduler.
        store: folder for the results of runs. After an interruption, the same call continues from these results and
            gives the same answer. A folder with results for other arguments is refused. Default: none.
        progress: True shows a bar or lines, as in lw.solve; a function is called with the completed fraction, from 0 to 1.

    Returns:
        The value, its interval and its cost; `print` shows a report.

    Raises:
        SceneError: if arguments are faulty, `of` is no such statistic or has no finite variance, members fail at the
            finest setting, or `estimator` is not possible.
        OSError: if `store` cannot be written.
        KeyboardInterrupt: if Ctrl-C interrupts the call. The message reports the progress; there is no answer.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)}, members=64)
        >>> found = lw.estimate(fleet, "mean depth", error=0.01, t1=2.0, method="rk4")
        >>> found.interval[1] - found.interval[0] < 0.1
        True
    """
    faults = Faults()
    if (error is None) == (relative_error is None) and (recipe is None or error is not None):
        faults.add("error", error, "and relative_error are both given, or none is", "give one of them")
    for name, value in (("error", error), ("relative_error", relative_error)):
        if value is not None:
            faults.positive(name, value, "in the unit of the statistic")
    check_threads(faults, threads)
    if estimator is not None:
        faults.choice("estimator", estimator, ESTIMATORS)
    question = None
    with faults.including():
        question = question_of(of, risk)
    faults.raise_if_any()
    assert question is not None
    whole = drawn(ensemble_of(fleet))
    fleets = [whole, *cheaper_fleets(whole, cheaper)]
    if recipe is not None:
        seed, t1 = recipe_of(recipe, question, len(fleets))
    t1 = whole.scene.run.duration if t1 is None else t1
    if t1 is None:
        raise refusal("t1", t1, "is missing", "give the end in seconds: t1=150.0 or [run] duration")
    faults.positive("t1", t1)
    faults.raise_if_any()
    seed = whole.seed if seed is None else int(EnsembleSettings(1, seed).seed)
    clock = time.process_time if executor == "threads" else time.perf_counter
    execution = {"threads": threads, "executor": executor, "scheduler": scheduler}
    arguments = {"study": "estimate", "of": of, "error": error, "relative_error": relative_error, "t1": t1, "risk": risk,
                 "method": method, "h": h, "dtype": dtype, "estimator": estimator, "recipe": recipe,
                 "heavy_tail": heavy_tail, "seed": seed}  # fmt: skip
    remembered = Remembered(store, fleets, arguments)
    runs = Runs(fleets, question, float(t1), seed=seed, execution=execution, clock=clock, remembered=remembered)
    report = callback(progress) or void
    content = {"scene": whole.scene.to_dict(), "ensemble": whole.to_dict(), "seed": seed, "t1": float(t1)}
    content |= {"versions": machine.versions(), "machine": machine.describe()}
    if recipe is not None:
        found = answering.replayed(runs, question.target, recipe, content)
        report(1.0)
        return found
    asked = error if error is not None else relative_error
    assert asked is not None
    steps = [spacing_of(each.scene, float(t1)) for each in fleets]
    ladders, noise = ladders_of(whole, float(t1), steps[0], None if method is None else [method], h, dtype)
    single = dtype is None and ladders[0][0].dtype == "float64"
    pilot = Pilot(runs, question.target, noise, float(asked), error is None, single, estimator, heavy_tail=heavy_tail)
    coarse = [coarse_of(spacing, i, ladders[0][0]) for i, spacing in enumerate(steps) if i]
    own = own_setting(whole, float(t1), ladders)
    try:
        return answering.answered(pilot, ladders, coarse, h is not None, own, report, content)
    except KeyboardInterrupt as stop:
        text = f"interrupted after {runs.seconds:.2g} s and {runs.members:,} members; there is no answer yet"
        raise KeyboardInterrupt(text) from stop


def recipe_of(recipe: Mapping[str, Any], question: Question, scenes: int) -> tuple[int, float]:
    """Seed and end time of a recipe; SceneError if it is not a recipe, or belongs to another question."""
    remedy = "give found.recipe of an answer to the same question"
    try:
        seed, t1, label = int(recipe["seed"]), float(recipe["t1"]), recipe["of"]
        levels = [Level.from_dict(each) for each in recipe["levels"]]
        settings = [
            Setting.from_dict(recipe["setting"]),
            *(s for each in levels for s in (each.fine, each.coarse) if s),
        ]
        counts = [
            n for share, row in recipe["rounds"] for n in row if len(row) == len(levels) and share >= 0.0 and n >= 0
        ]
        if len(counts) != len(levels) * len(recipe["rounds"]) or sum(counts) > answering.MOST:
            raise ValueError("rounds")
        most = max(each.scene for each in settings)
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, SceneError):
            raise
        raise refusal("recipe", recipe, "is not a recipe of an answer", remedy) from None
    if label != question.label or most >= scenes:
        raise refusal(
            "recipe", label, f"is of another question than {question.label}, or of more cheaper scenes", remedy
        )
    return seed, t1


def own_setting(fleet: Ensemble, t1: float, ladders: Sequence[Sequence[Setting]]) -> Setting | None:
    """The scene's own step, as runs take it, with the scene's or the first method; None if the scene has no step."""
    run = fleet.scene.run
    if run.step is None:
        return None
    named = [steps[0] for steps in ladders if steps[0].method == run.method]
    like = (named or [ladders[0][0]])[0]
    try:
        step = make_plan(fleet, like.method, run.step, t1, dtype=like.dtype).grid.h
    except SceneError:
        step = run.step
    return replace(like, h=step)


def drawn(fleet: Ensemble) -> Ensemble:
    """The fleet to draw other members from; SceneError if members have numbers without a distribution."""
    own = dict.fromkeys([*fleet.sampling.own_values(), *fleet.sampling.distributions(), *fleet.explicit()])
    names = [name for name in own if name not in ("indices", "points")]
    if names:
        problem = f"gives {', '.join(names[:4])} to its members, which no distribution draws"
        remedy = "name what varies by distributions, or ask lw.solve for the statistic of these members"
        raise refusal("fleet", fleet.sampling.kind, problem, remedy)
    return Ensemble(fleet.scene, 1, fleet.seed, fleet.vary)


def cheaper_fleets(fleet: Ensemble, cheaper: Sequence[Any]) -> list[Ensemble]:
    """Ensembles of the cheaper scenes with the same distributions; a varied number varies even if a change sets it."""
    listed = items_of(cheaper)
    if listed is None:
        raise refusal("cheaper", cheaper, "is not a list of scenes", 'give [{"controller.delay": 0.0}]')
    faults, fleets = Faults(), list[Ensemble]()
    for i, entry in enumerate(listed):
        with faults.including():
            if isinstance(entry, Mapping):
                entry = fleet.scene.with_numbers(entry)  # type: ignore[attr-defined]
            if isinstance(entry, Ensemble):
                entry = entry.scene
            if not isinstance(entry, Scene):
                raise refusal(f"cheaper[{i}]", entry, "is not a scene", 'give {"controller.delay": 0.0}, or a Scene')
            fleets.append(Ensemble(entry, 1, fleet.seed, fleet.vary))
    faults.raise_if_any()
    return fleets


def spacing_of(scene: Any, t1: float) -> Fraction:
    """The longest possible step of a scene [s]: it divides the run, the sample times, and the controller's times."""
    times = [t1]
    every, controller = scene.run.save_every, scene.controller
    if every is not None and every <= t1:
        times.append(every)
    if controller is not None:
        times += [float(each) for each in (controller.period, controller.delay) if each > 0.0]
    spacing = longest_step(times)
    return spacing / 20 if len(times) == 1 else spacing


def ladders_of(
    fleet: Ensemble, t1: float, spacing: Fraction, methods: Sequence[Any] | None, h: float | None, dtype: str | None
) -> tuple[list[list[Setting]], str]:
    """Settings to try for each method, the coarsest step first, a requested step last but one; and the kind of noise.

    Returns: The settings; and "none", "grid" if settings can share a noise path, or "free" if they cannot.
    """
    scene = fleet.scene
    dtype = scene.run.dtype if dtype is None else dtype
    few = fleet.with_seed(fleet.seed, 64) if fleet.vary else fleet
    rate = float(np.nanmax(np.linalg.norm(few.select(0, few.members).angular_velocity, axis=1)))
    m = max(1, math.ceil(float(spacing) * max(rate, 2.0 * math.pi / t1)))
    coarsest = spacing / m
    names = short_and_own(fleet, h is not None) if methods is None else methods
    most = 1 if h is not None else METHODS if methods is None else len(methods)
    taken, refused, noise, actual = list[Any](), list[str](), "none", 0.0
    for name in names:
        try:
            plan = make_plan(fleet, name, h or float(coarsest), t1, dtype=dtype)
        except SceneError as fault:
            refused += fault.faults
            continue
        laws = plan.kernel_choice.laws
        noisy = [term for term, module in laws if getattr(module, "NOISE", False)]
        if noisy:
            noise = "grid" if all(isinstance(term, NoisyTerm) for term in noisy) else "free"
        taken.append(name if isinstance(name, str | Method) else plan.method)
        actual = plan.grid.h
        if len(taken) == most:
            break
    if not taken:
        raise SceneError(refused)
    if h is None:
        return [[Setting(name, float(coarsest / 2**k), dtype) for k in range(HALVINGS)] for name in taken], noise
    # The step that is made divides the run and its samples: of a longer one half may be no shorter.
    longer = [actual * 2**k for k in range(DOUBLINGS, 0, -1) if whole_steps(float(spacing), actual * 2**k)]
    return [[Setting(taken[0], step, dtype) for step in (*longer, actual, actual / 2)]], noise


def short_and_own(fleet: Ensemble, alone: bool) -> Sequence[Any]:
    """Methods to try: the usually cheapest, the scene's own, and others; alone: only the scene's own, if any."""
    own, noisy = fleet.scene.run.method, any(isinstance(term, NoisyTerm) for term in fleet.scene.terms)
    kind = "noisy" if noisy else "damped" if is_damped(fleet) else "conservative"
    if own is None:
        return SHORT[kind]
    named = own if not fleet.scene.run.method_options else fleet.scene.run.method_of(None)
    first, *others = SHORT[kind]
    return [named] if alone else [*([first] if first != own else []), named, *(name for name in others if name != own)]


def coarse_of(spacing: Fraction, scene: int, like: Setting) -> list[Setting]:
    """Settings of a cheaper scene, the longest step first, down to the coarsest step of the scene itself."""
    steps = [float(spacing / 2**k) for k in range(4)]
    return [replace(like, h=step, scene=scene) for step in steps if step > 0.4 * like.h] or [replace(like, scene=scene)]
