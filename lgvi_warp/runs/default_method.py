# SPDX-License-Identifier: Apache-2.0
"""The default method of a run, chosen from the terms of the scene and from the estimated error at its step.

A scene without damping gets a symplectic method, or rk4 if its inertia changes. A splitting changes the steady motion
of a damped scene, and Runge-Kutta methods keep it. A damped scene therefore gets the cheapest Runge-Kutta method that
is stable and accurate at the step, judged by the rates of the motion.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from typing import Any

from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.sentences import capital
from lgvi_warp.engine.plan import Plan, choose_plan, damping_terms
from lgvi_warp.methods.limits import drag_limit, rotation_limit
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import TimeGrid
from lgvi_warp.runs.step_error import LOOKED_AT, Rates, path_error, rates
from lgvi_warp.scene.ensemble import Ensemble

# Parts of a method's limits that a step may use, since rates grow. Oscillations need none: psi_s and psi_x cease to be
# stable at a shorter step than rk4, rk8 and rkw3 do (methods/stable_steps.csv).
SHARES = {"drag": 0.9, "rotation": 0.5}
# Largest h (l + 2 q |v|) / I that rkw3 is trusted with: of quadratic drag it knows that at the step's start.
MOST_IMPLICIT = 1000.0
# Estimated error over the length of the path that a cheaper method may have: the estimate is right to a factor of five.
CHEAPER = 0.001
# The same above which a run says that its step is long.
ALLOWED = 0.01
# The choice looks so far ahead, whatever the length of the run: a longer run begins with the bits of a shorter one [s].
AHEAD = 30.0
# For damped scenes, in the order in which they are taken: mostly that of their cost (`python -m benchmarks run damped`).
DAMPED = {
    "rk4": "since the scene is damped",
    "rk8": "since the scene is damped and the step long",
    "rkw3": "since the scene is damped, strongly for this step",
}
OTHERWISE = ("psi_x", "psi_s")


def planned(ensemble: Ensemble, grid: TimeGrid, others: tuple[Any, ...]) -> Plan:
    """Plan a run with the first method that is possible; `others` are the arguments of `choose_plan` after the grid."""
    known_rates = rates(ensemble)
    for method in choices(ensemble, grid.h, known_rates):
        remarks = messages(method, known_rates, grid.h, max(AHEAD, grid.h * grid.steps))
        try:
            return choose_plan(ensemble, method, grid.telling(*remarks), *others)
        except SceneError as error:
            fault = error
    raise fault


def choices(ensemble: Ensemble, h: float, known_rates: Rates | None = None) -> Iterator[Method]:
    """List the methods for a run, the best first.

    h: Step [s].
    known_rates: The rates of the motion; default None: they are computed.
    """
    if not is_damped(ensemble) and any(term.carried for term in ensemble.scene.terms):
        yield Method("rk4", reason="since the inertia changes")
        return
    if not is_damped(ensemble):
        yield Method("psi_s", reason="since nothing damps the motion")
        yield Method("psi_x", reason="since nothing damps the motion, and psi_s does not take the scene")
        return
    known_rates = known_rates or rates(ensemble)
    numbers = h_rates(known_rates, h)
    well = [name for name in DAMPED if stable(Method(name), numbers)]
    errors = {
        name: path_error(Method(name), known_rates, h, AHEAD)
        for name in DAMPED
        if name in well or stable(Method(name), numbers, 1.0)
    }
    for name in ranked(errors, well):
        yield Method(name, reason=DAMPED[name])
    for name in OTHERWISE:
        if name == OTHERWISE[-1] or stable(Method(name), numbers):
            yield Method(name, reason="since the scene is damped, and Runge-Kutta methods do not take it at this step")


def ranked(errors: dict[str, float], well: Collection[str]) -> list[str]:
    """Rank methods by their errors at a step.

    well: Methods that are well within their limits at this step.
    Returns: The methods of `well` with a small error, the cheapest first; then the others, the smallest error first.
    """
    known = [name for name in errors if name in well or math.isfinite(errors[name])]
    return sorted(known, key=lambda name: 0.0 if name in well and errors[name] <= CHEAPER else errors[name])


def messages(method: Method, rates: Rates, h: float, t1: float) -> tuple[str, ...]:
    """Warn if the step is too long to follow the path.

    h: Step [s].
    t1: End of the time over which the error is estimated [s]; the caller passes at least AHEAD, as in `choices`.
    """
    near = method.name in DAMPED and not stable(method, h_rates(rates, h))
    if path_error(method, rates, h, t1) <= ALLOWED and not near:
        return ()
    text = (
        f"step h = {h:g} s is long for this motion: by its rates {method.name} may be off by more than 1 % of the path"
    )
    shorter = next(
        (h / n for n in (2, 5, 10, 20, 50, 100) if best_error(method, rates, h / n, t1) <= ALLOWED), math.nan
    )
    remedy = f"h = {shorter:.3g} s keeps that" if shorter > 0.0 else "shorten it"
    return (f"{text}. {capital(remedy)}, or ask for an error: lw.suggest, --error",)


def cost(method: Method, rates: Rates, h: float, measured: tuple[float, float] | None = None) -> str:
    """Describe the error and the cost of a method for damped scenes, compared with the cheapest such method.

    h: Step [s].
    measured: the method's error divided by the length of the path [1], and the simulated time [s]; default
        None: the error is estimated from the rates.
    Returns: A text; "" for a method that is not chosen by its error.
    """
    if method.name not in DAMPED:
        return ""

    def text(error: float) -> str:
        return f"off by about {100.0 * error:.1g} % of the path" if error < 1.0 else "unstable or off by the path"

    def estimated(each: Method) -> str:
        return text(path_error(each, rates, h, AHEAD) if stable(each, h_rates(rates, h), 1.0) else math.inf)

    cheap, own = Method(next(iter(DAMPED))), f"{estimated(method)} by its rates"
    if measured is not None:
        own = f"{text(measured[0])} in {measured[1]:.3g} s, by a run of the first member at half the step"
    if method.linearly_implicit or method.name == cheap.name or method.tableau is None or cheap.tableau is None:
        return own
    times = len(method.tableau.b) / len(cheap.tableau.b)
    return f"{own}; a step costs {times:.2g} times one of {cheap.name}, which by its rates would be {estimated(cheap)}"


def best_error(method: Method, rates: Rates, h: float, t1: float) -> float:
    """Smallest error at a shorter step, among the method itself and the methods for damped scenes.

    h: The shorter step [s].
    t1: End [s].
    """
    numbers = h_rates(rates, h)
    others = [Method(name) for name in DAMPED] if rates.drag != 0.0 else [method]
    return min((path_error(each, rates, h, t1) for each in others if stable(each, numbers)), default=math.inf)


def stable(method: Method, numbers: dict[str, float], share: float = SHARES["drag"]) -> bool:
    """Tell whether a step is well within the stability limits of a method."""
    drag = MOST_IMPLICIT if method.linearly_implicit else share * drag_limit(method.name)
    return numbers["drag"] <= drag and numbers["rotation"] <= SHARES["rotation"] * rotation_limit(method)


def is_damped(ensemble: Ensemble) -> bool:
    """Tell whether a term takes energy from some of the first members."""
    terms = [term for term in damping_terms(ensemble.scene.terms) if term.dissipative or term.brakes]
    if not terms:
        return False
    parameters = ensemble.parameters(0, min(LOOKED_AT, ensemble.members))
    return any(term.present(ensemble.own(term, parameters)) for term in terms)


def h_rates(rates: Rates, h: float) -> dict[str, float]:
    """Multiply the fastest rates among the first members by the step.

    h: Step [s].
    Returns: "drag" and "rotation" -> number [1]; the limit of rkw3 for drag if the damping of a term is unknown.
    """
    return {"drag": MOST_IMPLICIT if rates.drag is None else h * rates.drag, "rotation": h * rates.rotation}
