# SPDX-License-Identifier: Apache-2.0
"""`rare_event`: the probability of an event that plain sampling would hardly ever see."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.calls.prepared import prepare
from lgvi_warp.common import machine
from lgvi_warp.common.arguments import whole_number
from lgvi_warp.common.errors import Faults, SceneError, refusal
from lgvi_warp.common.near import near_names
from lgvi_warp.common.progress import callback, shows_if_long, shows_progress
from lgvi_warp.criteria.memory import Remembered
from lgvi_warp.criteria.running import duration_text
from lgvi_warp.results.quantities import OfInterest
from lgvi_warp.runs.request import ensemble_of
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.uncertainty.rare.answer import RareEvent
from lgvi_warp.uncertainty.rare.causes import PARTS, Chance, chances_of, moves_of, noise_score
from lgvi_warp.uncertainty.rare.cheaper import cheaper_of, chosen_chain
from lgvi_warp.uncertainty.rare.event import SURE, RareCondition, condition_of
from lgvi_warp.uncertainty.rare.limit import VehicleLimit
from lgvi_warp.uncertainty.rare.search import RareAnswer, RareSearch
from lgvi_warp.uncertainty.rare.split_search import SplitAnswer, SplitSearch
from lgvi_warp.uncertainty.rare.subset import MOST_LEVELS, NoProgress
from lgvi_warp.uncertainty.rare.walk import VehicleWalk

# What members of the scene's own setting are called.
OWN = "the scene's own"
ALL_LOST = (
    "every failing member failed, or has a number that is not finite (NaN): the probability is of that; "
    'failed="refuse" shows the first of them'
)
WITH_STATUS = (
    "by_condition is empty: a member that ends with the status counts as every condition. Ask for each by itself"
)
WAYS = ("chains", "splitting")
ASK = 'ask for what is rare, as "peak depth above 12"'
# Members of a level that chains take for an error of 10 %, levels of a search for 1e-5, and the most numbers of a level.
LEVEL_MEMBERS, LEVELS, MOST_LEVEL_NUMBERS = 16_000, 5, 250_000_000
# Draws from which on the cost is told before the first level, and members of the trial for it.
MANY_DRAWS, TRIAL = 1000, 32
# The least error that can be asked, and the fewest members.
LEAST_ERROR, FEWEST = 0.005, 10_000


@shows_progress
@near_names(prepare)
@shows_if_long
def rare_event(
    fleet: Scene | Ensemble,
    limit: OfInterest | Mapping[str, Any],
    *,
    relative_error: float = 0.1,
    by: str = "chains",
    cheaper: Sequence[Mapping[str, Any]] = (),
    intervals: int = 50,
    failed: str = "event",
    most: int = 1_000_000,
    seed: int = 0,
    store: str | os.PathLike[str] | None = None,
    progress: Callable[[float], None] | bool | None = None,
    **settings: Any,
) -> RareEvent:
    """Estimate the probability of a rare event, with its interval, and list failing members.

    Markov chains of members move level by level towards the event (subset simulation), over the varied numbers and the
    draws of noise, in four independent runs. Importance sampling about the failing members then gives the answer if it
    passes its checks. Otherwise the answer comes from more chains. Events more likely than 1e-3 are sampled directly.

    Args:
        fleet: A Scene or an Ensemble; its distributions in `vary` and its noise make the members differ.
        limit: The event: a quantity, such as "max(depth) - 40.0", or a function of a Result, positive if the event
            happens; conditions as in a sweep, {"peak depth": {"above": 12.0}}: one suffices; or an event's name.
        relative_error: Target relative standard error of the probability, 0.005 to 0.5; 0.1 by default.
        by: "chains", the default, or "splitting", for a scene with noise and an event that develops over time: a
            quantity at the end, its max or min over the path, "max_error depth", "iae depth", or an event of the scene.
        cheaper: Coarser settings that the first chains may use; the answer is always for the scene's own setting. Each
            is a table of changed numbers and run settings, [{"h": 0.1, "dtype": "float32", "controller.delay": 0.0}].
            None by default.
        intervals: Maximum number of time intervals of splitting, 2 to 1,000; 50 by default. More intervals need fewer
            members, but each interval costs a call. Intervals begin at samples and at ticks of a controller.
        failed: "event" (default): a failed member counts as the event, and is reported separately; "refuse" raises an
            error.
        most: Approximate maximum number of members to run, without the pilot; at least 10,000, by default 1,000,000.
        seed: Seed of all random draws; 0 by default.
        store: Folder for the results of runs. After an interruption, the same call continues from these results and
            gives the same answer. Splitting repeats its pilot and continues after the last complete level. A folder
            with results for other arguments is refused. None by default.
        progress: True shows a bar or lines, as in lw.solve; False: nothing; a function is called with the estimated
            completed fraction. None, the default, shows progress on a terminal if more than 10 s are expected.
        **settings: As in `lw.prepare`: method, h, t1, save, dtype, threads, ...

    Returns:
        The probability, its interval, its cost, and the members for which the event happens.

    Raises:
        SceneError: If an argument is wrong, the event never or always happens, the limit has too few different values
            to show how near a member is to the event, or members have more draws of noise than chains can store.
        FailedMembers: With failed="refuse", if members failed.
        OSError: If `store` cannot be written.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("sphere")
        >>> fleet = lw.Ensemble(scene, vary={"start.velocity[2]": lw.distributions.Normal(std=0.1)})
        >>> found = lw.rare_event(fleet, "depth - 0.35", method="psi_x", h=0.1, t1=1.0)
        >>> found.estimator
        'importance'
    """
    members = ensemble_of(fleet)
    faults = Faults()
    faults.choice("failed", failed, ("event", "refuse"))
    known = faults.choice("by", by, WAYS)
    if known and by == "splitting" and cheaper:
        faults.add("cheaper", cheaper, "is of chains", 'leave it out, or give by="chains"')
    check_asked(faults, relative_error, most)
    for name in ("of", "levels", "statistics", "draws", "common_noise"):
        if name in settings:
            faults.add(name, settings[name], "is what rare_event decides", "leave it out")
    faults.raise_if_any()
    whole_number("seed", seed, 0), whole_number("intervals", intervals, 2, 1000)
    condition = condition_of(limit, members.scene)
    report = callback(progress) or (lambda fraction: None)
    faster = cheaper_of(cheaper, members, settings)
    asked = {"study": "rare_event", "limit": limit, "relative_error": relative_error, "most": most, "seed": seed,
             "cheaper": [each.name for each in faster], "failed": failed, **settings}  # fmt: skip
    if by == "splitting":
        remembered = Remembered(store, [members], {**asked, "by": by, "intervals": intervals})
        walk = VehicleWalk(members, condition, settings, failed == "refuse", seed, intervals, remembered)
        return _by_splitting(walk, condition, float(relative_error), most, seed, report, settings)
    remembered = Remembered(store, [members], asked)
    own = VehicleLimit(members, condition, settings, failed, remembered, OWN)
    cost = expected_cost(own, relative_error)
    others = {
        each.name: VehicleLimit(each.fleet, condition, each.settings, failed, remembered, each.name) for each in faster
    }
    chain, notes = chosen_chain(own, others, seed) if others else (None, [])
    notes = [*cost, *notes]
    search = RareSearch(
        own.each, own.d, relative_error, seed, most, chained=chain, margin=chain.margin if chain else 0.0, report=report,
        notes=notes, witness=own.tolerant,
    )  # fmt: skip
    try:
        found = search.answer()
    except NoProgress as stuck:
        raise _refused(stuck, condition) from None
    if found.probability >= 1.0:
        lost = bool(np.isinf(found.limits).all())
        problem = f"happens for each of {found.members:,} members" + (", all of which failed" if lost else "")
        remedy = "fix the failing members" if lost else ASK
        raise refusal("limit", condition.label, problem, remedy)
    return _told(found, own, others, condition, settings)


def _by_splitting(
    walk: VehicleWalk, condition: RareCondition, relative_error: float, most: int, seed: int,
    report: Callable[[float], None], settings: Mapping[str, Any]) -> RareEvent:  # fmt: skip
    """Compute the answer by splitting in time."""
    search = SplitSearch(walk, relative_error, seed, most, report)
    try:
        found = search.answer()
    except NoProgress as stuck:
        if stuck.kind != "never":
            raise _refused(stuck, condition) from None
        problem = f"was reached by none of some {walk.members:,} members, whatever its probability"
        remedy = 'give by="chains", which moves numbers that vary, too; or move the bound'
        raise refusal("limit", condition.label, problem, remedy) from None
    if found.probability >= 1.0:
        problem = f"happens for each of {len(found.limits):,} members"
        raise refusal("limit", condition.label, problem, ASK)
    paths = tuple((walk.times[points], keys) for points, keys in found.paths)
    answer = replace(_told(found, walk, {}, condition, settings), paths=paths)
    if answer.plain_members < walk.members:
        note = f'splitting gains nothing here: it took {walk.members:,} members; by="chains", or plain ones'
        answer = replace(answer, messages=(*answer.messages, note))
    return answer


def check_asked(faults: Faults, relative_error: Any, most: Any) -> None:
    """Add errors in `relative_error` and `most` to the faults."""
    error = faults.number("relative_error", relative_error)
    if error is not None and not LEAST_ERROR <= error <= 0.5:
        faults.add(
            "relative_error",
            relative_error,
            "is not between 0.005 and 0.5",
            "give a part of the probability, such as 0.1",
        )
    with faults.including():
        whole_number("most", most, FEWEST)


def expected_cost(own: VehicleLimit, relative_error: float) -> list[str]:
    """Text of the expected cost with many draws of noise, also shown on a terminal; "" for few. Raises SceneError.

    It refuses levels with more numbers than memory should hold.
    """
    level = LEVEL_MEMBERS * (0.1 / relative_error) ** 2
    if level * own.d > MOST_LEVEL_NUMBERS:
        problem = (
            f"has {own.draws:,} draws of noise a member: chains keep some {level:,.0f} members at once, "
            f"{8e-9 * level * own.d:,.1f} GB for each copy"
        )
        remedy = (
            'give by="splitting", which takes no draws as numbers. Run plain members, which bound the event by 3 / n. Leave '
            "the noise out, for chains over the numbers that vary alone, and draw it afresh for the members found; or ask "
            "for a larger relative_error"
        )
        raise refusal("fleet", "...", problem, remedy)
    if own.draws < MANY_DRAWS:
        return []
    trial = np.random.default_rng(0).standard_normal((TRIAL, own.d))
    own.tolerant(trial)  # compiles
    begin = own.seconds
    own.tolerant(trial)
    members = LEVELS * level
    text = (
        f"{own.draws:,} draws of noise a member; expected are some {members:,.0f} members at 1e-5, about "
        f"{duration_text(members * (own.seconds - begin) / TRIAL)}"
    )
    if sys.stderr.isatty():
        sys.stderr.write(f"{text}\n")
    return [text]


def _refused(stuck: NoProgress, condition: RareCondition) -> SceneError:
    """Error if chains came no nearer to the event."""
    if stuck.kind == "steps":
        problem = "has the same value for most members, so that nothing says how near one is to the event"
        remedy = 'give a number that grows towards it: a distance, "peak depth above 12", or the name of an event'
        return refusal("limit", condition.label, problem, remedy)
    reached = "fewer than a tenth of the last level's members" if stuck.largest > 0.0 else "no member"
    short = "" if stuck.largest > 0.0 else f"; the nearest member is {-stuck.largest:.4g} short of it"
    problem = (
        f"was reached by {reached} within {MOST_LEVELS} levels, each a tenth of the one before, or until members came no "
        f"nearer: it never happens, or is rarer than about 1e-{MOST_LEVELS - 2}"
        f"{'; none came near it' if stuck.largest <= -SURE else short}"
    )
    return refusal("limit", condition.label, problem, "move the bound, or widen what varies")


def _told(
    result: RareAnswer,
    own: VehicleLimit | VehicleWalk,
    others: Mapping[str, VehicleLimit],
    condition: RareCondition,
    settings: Mapping[str, Any],
) -> RareEvent:
    """The answer in the scene's numbers."""
    limits: dict[str, VehicleLimit | VehicleWalk] = {OWN: own, **others}
    count = len(own.names)
    nearest = int(np.argmin((result.failing**2).sum(axis=1)))
    best = result.failing[nearest : nearest + 1]
    # With splitting, members of one start are related.
    chains = result.chains if len(result.chains) else np.unique(result.failing, axis=0, return_inverse=True)[1].ravel()
    parts = result.parts if len(result.parts) else chains % PARTS
    moves = moves_of(result.failing[:, :count], result.weights, chains)
    moved, size, spread, z = (dict(zip(own.names, map(float, column), strict=True)) for column in moves)
    columns: dict[str, list[int]] = {}
    for source in own.sources:
        columns.setdefault(source.of, []).extend(np.arange(result.failing.shape[1])[count:][source.columns])
    lost = float(result.weights[np.isinf(result.limits)].sum())
    messages = [*result.notes, *[ALL_LOST] * (lost >= 1.0 - 1e-12)]
    of_any = Chance(result.probability, *result.interval())
    several = len(condition.names) == len(result.rows) > 1
    if condition.statuses:
        messages.append(WITH_STATUS)
    # Runs of splitting are independent; members of one are related, wherever they began.
    related = result.of_run if isinstance(result, SplitAnswer) else result.ancestors
    plain = (1.0 - result.probability) / (result.probability * max(result.spread, 1e-12) ** 2)
    return RareEvent(
        event=condition.label,
        probability=result.probability,
        interval=result.interval(),
        relative_error=result.spread,
        estimator=result.estimator,
        members={name: each.members for name, each in limits.items()},
        failing=own.table(result.failing),
        normals=result.failing[:, :count],
        draws=result.failing[:, count:],
        weights=result.weights,
        failed_share=lost,
        likeliest={name: value[0] for name, value in own.values(best).items()} if count else {},
        likeliest_draws=best[0, count:],
        distance=float(np.linalg.norm(best)),
        moved=moved,
        moved_size=size,
        moved_spread=spread,
        moved_z=z,
        noise_moved={
            name: noise_score(result.failing[:, own_], result.weights, chains, parts) for name, own_ in columns.items()
        },
        by_condition=chances_of(condition.names, result.rows, result.weights, related, of_any, result.spread)
        if several
        else {},
        ancestors=related,
        runs=result.runs,
        plain_members=plain,
        plain_seconds=plain * own.seconds / max(1, own.members),
        seconds=sum(each.seconds for each in limits.values()),
        messages=tuple(messages),
        provenance={
            "scene": own.fleet.scene.to_dict(),
            "ensemble": own.fleet.to_dict(),
            "settings": {name: str(value) for name, value in settings.items()},
            "versions": machine.versions(),
            "machine": machine.describe(),
        },
    )
