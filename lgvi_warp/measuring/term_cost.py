# SPDX-License-Identifier: Apache-2.0
"""Cost of a member's step with each term of a scene, compared with a step without terms."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.engine.plan import Plan
from lgvi_warp.measuring.cost import Cost, costs
from lgvi_warp.methods.method import Method
from lgvi_warp.physics.terms.base import Term
from lgvi_warp.runs.request import scene_of
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene

# Row of a scene without terms, and row of all its terms together.
NONE, ALL = "none", "all terms"


def term_cost(
    scene: Scene,
    *,
    method: str | Method | None = None,
    h: float | None = None,
    dtype: str | None = None,
    members: int = 64,
    rounds: int = 5,
) -> list[dict[str, Any]]:
    """Measure the cost of a step without terms, with each term of a scene alone, and with all of them.

    The scenes are timed in turn. A cost is the smallest of several readings of the processor time of the thread that
    runs the kernel. Controllers and events are left out. Each kernel is compiled once, which takes some seconds.

    Args:
        scene: The scene.
        method: Name of the method, or a Method; by default the method chosen for the whole scene.
        h: Step [s]; by default `run.step` of the scene.
        dtype: "float64", "float32" or "float32_compensated"; by default the scene's precision.
        members: Number of vehicles in the timed run; by default 64.
        rounds: Number of readings of each scene; by default 5.

    Returns:
        A row for each scene: "term", "method", "dtype", "ns_per_vehicle_step" [ns], and "more_than_none" [ns], the
        additional cost compared with the scene without terms.

    Raises:
        SceneError: The scene has no terms, or an argument is at fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("sphere", terms=[lw.terms.Drag(linear=[1.0] * 6)])
        >>> rows = lw.bench.term_cost(scene, method="psi_s", h=0.1)
        >>> [row["term"] for row in rows]
        ['none', 'drag']
    """
    scene = scene_of(scene)
    faults = Faults()
    if h is not None:
        h = faults.positive("h", h)
    faults.raise_if_any()
    if not scene.terms:
        raise SceneError(["scene.terms is empty. Give the scene terms whose cost is to be measured"])
    step = scene.run.step if h is None else h
    plans = plans_of_terms(scene, members, method, step, dtype)
    for plan in plans.values():
        plan.compile()
    return priced(plans, costs(list(plans.values()), rounds))


def plans_of_terms(
    scene: Scene, members: int, method: str | Method | None, h: float | None, dtype: str | None
) -> dict[str, Plan]:
    """Plan ten steps of a scene without terms, with each term alone and with all terms, by the whole scene's method.

    Controllers and events are left out.
    """

    def plan_of(terms: tuple[Term, ...], method: str | Method | None) -> Plan:
        bare = dataclasses.replace(scene, terms=terms, controller=None, events=(), ensemble_settings=None)
        return make_plan(Ensemble(bare, members, 1), method, h=h, t1=None if h is None else 10.0 * h, dtype=dtype)

    casts: dict[str, tuple[Term, ...]] = {NONE: ()} | {term.key: (term,) for term in scene.terms}
    if len(scene.terms) > 1:
        casts[ALL] = tuple(scene.terms)
    chosen = plan_of(tuple(scene.terms), method).method
    return {name: plan_of(terms, chosen) for name, terms in casts.items()}


def priced(plans: Mapping[str, Plan], prices: Sequence[Cost]) -> list[dict[str, Any]]:
    """Rows of `term_cost`; plans: name -> plan, the first without terms."""
    nanoseconds = [
        1e3 * price.us_per_vehicle_second * plan.grid.h for price, plan in zip(prices, plans.values(), strict=True)
    ]
    return [
        {
            "term": name,
            "method": plan.method.name,
            "dtype": plan.dtype,
            "ns_per_vehicle_step": round(price, 3),
            "more_than_none": round(price - nanoseconds[0], 3),
        }
        for (name, plan), price in zip(plans.items(), nanoseconds, strict=True)
    ]
