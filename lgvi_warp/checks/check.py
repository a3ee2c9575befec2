# SPDX-License-Identifier: Apache-2.0
"""`check_law`: check of a law's device code at random views, against finite differences and linear algebra."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from lgvi_kernels import built_in
from lgvi_warp.checks.bench import (
    MOST_SAMPLES,
    ORIGIN,
    OTHER_KICK,
    OTHER_STEP,
    TURN,
    Bank,
    Bench,
    Views,
    of_scene,
    short,
    sizes,
)
from lgvi_warp.checks.report import (
    LANES_APART,
    ROUND_OFF,
    VARIED_NUMBERS,
    Check,
    LawReport,
    attempt,
    finite,
    first_wrong,
    judged,
    packed_numbers,
    unpacked,
)
from lgvi_warp.common.arguments import whole_number
from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.machine import register_width
from lgvi_warp.engine import kernel_choice
from lgvi_warp.physics import notation, terms
from lgvi_warp.physics.terms.base import PackingContext, Term
from lgvi_warp.scene.scene import Scene

# Length of the time over which a law follows [s].
FOLLOWED = 0.4
FLOWS = ("steady", "uniform", "varying")
# Roles that say what the water or a force is at a moment, whatever the method's step.
MOMENTARY = ("law", "damping", "push", "load", "flow", "steady_force", "distance")
# Roles that may look at the velocities.
MOVING = ("damping", "push", "load")
SEES_VELOCITIES = (*MOVING, "power")


def check_law(
    term: Term, *, scene: Scene | None = None, samples: int = 64, seed: int = 0, step: float = 1e-5
) -> LawReport:
    """Check a term's device code against its host code, at random states.

    The first check of a law compiles one small kernel. A role is a device function of the law, such as `push`; all
    roles are explained in docs/develop/add_a_force.md. These properties are checked for the roles that the law has:

    * All roles: numbers are finite, also at rest and along single axes. Lanes are independent, and the position of a
      member in a packet has no effect. Without noise and memory, forces do not depend on the length of the step.
      Numbers that vary by member have the same effect as shared numbers. `packed` fills the fields that `params` names.
      The law is the same in all body axes and about all origins that a method may choose.
    * `law` does not depend on velocities, nor on the time unless `timed` is True. If POTENTIAL is True, force and
      torque are the derivatives of `potential`, and `energy` adds this potential.
    * `damping`: nu . D nu >= 0 for its matrix D and every velocity nu. With `dissipative = False` the smallest power is
      reported, but a negative power is not a fault.
    * `push`, which Runge-Kutta methods use, adds the same force and torque as `damping` or `load`.
    * `load`, damping by water velocities at points along the hull, passes the checks of `damping` in test water
      that varies in space and time.
    * `follow`: the stored memory depends on the time alone, and is the same after two parts of an interval as after the
      whole interval.
    * `carried_inertia` is symmetric. Neither `carried_inertia` nor `carried_momentum` depends on velocities.
    * `distance` and `power` are the same in all body axes, and `power` about all origins.
    * `flow`: rate and gradient are derivatives of the velocity. `water` gives the same velocity. The constant FLOW
      ("steady", "uniform" or "varying") covers the observed variation of the velocity.

    Args:
        term: the term, built-in or the user's own.
        scene: scene with the vehicle and the environment to use; None (default) for a simple vehicle.
        samples: number of random states (default 64): any attitude, positions some metres around the
            scene's start, velocities [m/s] and angular velocities [rad/s] of order 1, times from 0 to 10 s.
        seed: seed of the random states (default 0).
        step: step of the finite differences [m, rad, s] (default 1e-5).

    Returns:
        A report of all checks; `ok` is True if all passed.

    Raises:
        SceneError: if `term` is not a term, or its device code is incomplete, has a wrong signature or does not
            compile.

    Examples:
        >>> import lgvi_warp as lw
        >>> report = lw.laws.check_law(lw.terms.Drag(linear=[10.0, 20.0, 20.0, 1.0, 2.0, 2.0]))
        >>> report.ok
        True
    """
    if not isinstance(term, Term):
        raise SceneError([f"term = {term!r} is not a term. Give an object such as lw.terms.Drag(...), not its class"])
    term = term.beside_account(True)  # else terms leave their power out
    module = kernel_choice.device_module(term, term.device_in(False), built_in)
    packets = -(-whole_number("samples", samples, 1, MOST_SAMPLES) // register_width("float64"))
    bench = Bench(term, module, of_scene(scene), packets, whole_number("seed", seed, 0))
    checks: list[Check] = []
    for examine in (_numbers, _finite, _of_every_law, _potential, _damping, _push, _flow, _follow, _carried):
        with np.errstate(all="ignore"):  # what is not finite is found by its check
            checks += examine(bench, step)
        if examine in (_numbers, _finite) and not all(check.ok for check in checks):
            break
    return LawReport(term, tuple(checks))


def _numbers(bench: Bench, step: float) -> Iterator[Check]:
    """Check that packed() fills the fields of params(); then pack, and let the law store its memory once."""
    term, context = bench.term, bench.context(bench.parameters)
    packed, checks = packed_numbers(term, bench.Params, lambda: term.packed(bench.own, context))
    yield from checks
    if packed is None:
        return
    remembers = packed.memory is not None and packed.memory.size > 0
    good = remembers == bool(term.memory)
    text = "" if good else f"{type(term).__name__}.memory must say whether packed() gives memory"
    yield Check("memory", float(not good), 0.0, good, text)
    if good and all(check.ok for check in checks):
        packets = attempt(lambda: Bank(bench, context, bench.views), "with shared numbers")
        if isinstance(packets, str):
            yield unpacked(packets)
        else:
            bench.packets = packets


def _finite(bench: Bench, step: float) -> Iterator[Check]:
    """Check that numbers are finite at all views, at rest and along single axes; report a law that is zero everywhere."""
    here = bench.at(bench.views)
    at_random = _all_finite("finite", here, bench.views)
    yield first_wrong(_all_finite("finite at rest, along axes", bench.at(views), views) for views in bench.corners)
    asleep = not any(np.any(value) for value in here.values())
    note = "note: zero at every view, so little was checked. Give a scene that starts where the law acts"
    yield at_random._replace(text=note) if asleep else at_random


def _all_finite(name: str, values: dict[str, np.ndarray], views: Views) -> Check:
    return finite(name, np.concatenate([*values.values()], axis=1), views)


def _of_every_law(bench: Bench, step: float) -> Iterator[Check]:
    """Checks of every law: independent of other inputs, lanes independent, varied numbers act as shared ones."""
    views, kind, here = bench.views, type(bench.term).__name__, bench.at(bench.views)
    faster = bench.at(replace(views, velocity=2.0 * views.velocity + 1.0, rate=1.0 - views.rate))
    later = bench.at(replace(views, time=views.time + 3.7))
    for role, value in here.items():
        if role not in SEES_VELOCITIES:
            remedy = "only damping, push, load and power may look at view.nu and view.Om"
            yield judged(f"{role}: blind to velocity", faster[role] - value, 0.0, views, remedy)
        if role != "load" and not bench.term.timed and not bench.noisy:
            remedy = f"write timed = True in {kind}, or it gets no time"
            yield judged(f"{role}: blind to time", later[role] - value, 0.0, views, remedy)
    if not bench.noisy:
        yield from _steps(bench, here)
        yield from _packing(bench, here)


def _steps(bench: Bench, here: dict[str, np.ndarray]) -> Iterator[Check]:
    """Check that a force does not depend on the method's step; a law with memory may depend on it."""
    if bench.term.memory:
        return
    longer = bench.at(bench.views, h=OTHER_KICK)
    later = bench.at(bench.views, step=OTHER_STEP)
    for role in filter(here.__contains__, MOMENTARY):
        remedy = "only noise, and what a law remembers, may depend on view.h, the length of the step"
        yield judged(f"{role}: blind to the step", longer[role] - here[role], 0.0, bench.views, remedy)
        if not bench.term.timed:
            remedy = f"write timed = True in {type(bench.term).__name__}, or view.step stays 0"
            yield judged(f"{role}: blind to the step's number", later[role] - here[role], 0.0, bench.views, remedy)


def _packing(bench: Bench, here: dict[str, np.ndarray]) -> Iterator[Check]:
    """Check that the law is the same in every lane, for shared and varied numbers, and in all axes."""
    views = bench.views
    # Last first: every member is in another lane, and in another packet.
    back = np.arange(bench.count)[::-1]
    mixed_views = Views(**{name: value[back] for name, value in vars(views).items()})
    # What a law remembers may depend on where it is: it remembers anew.
    mixed = Bank(bench, bench.context(bench.parameters), mixed_views).evaluate(mixed_views)
    each = {name: np.repeat(value, bench.count, axis=0) for name, value in bench.parameters.items()}
    varied = _tried(bench, bench.context(each), views, "where numbers have one entry a member")
    for role, value in here.items():
        yield judged(f"{role}: lanes apart", mixed[role][back] - value, 0.0, views, LANES_APART)
        difference = varied if isinstance(varied, str) else varied[role] - value
        limit = ROUND_OFF * np.abs(value).max()
        yield judged(f"{role}: varied numbers", difference, limit, views, VARIED_NUMBERS)
    # Weight and restoring moment keep their promise together, not each.
    if not any(isinstance(bench.term, type(implied)) for implied in terms.IMPLIED):
        yield from _axes(bench, here)
        yield from _event_axes(bench, here)


def _event_axes(bench: Bench, here: dict[str, np.ndarray]) -> Iterator[Check]:
    """Check that the distance is the same in a frame with other axes; an event uses the body's origin in all of them."""
    if "distance" not in here:
        return
    turned_views = replace(bench.views, attitude=bench.views.attitude @ TURN)
    turned = _tried(bench, bench.context(bench.parameters, True), turned_views, "in other axes of the body")
    difference = turned if isinstance(turned, str) else turned["distance"] - here["distance"]
    limit = ROUND_OFF * np.abs(here["distance"]).max() * 100.0
    remedy = "turn vectors and points of the body by context.frame.vector() in packed()"
    yield judged("distance: any axes", difference, limit, bench.views, remedy)


def _tried(bench: Bench, context: PackingContext, views: Views, where: str) -> dict[str, np.ndarray] | str:
    """Evaluate the law in another context: its numbers by role, or a message if packed() fails in it."""
    return attempt(lambda: Bank(bench, context, views).evaluate(views), where)


def _axes(bench: Bench, here: dict[str, np.ndarray]) -> Iterator[Check]:
    """Check that the wrench is the same in a frame with other axes and origin."""
    views, turned_views = bench.views, bench.views.elsewhere()
    turned = _tried(bench, bench.context(bench.parameters, True), turned_views, "in other axes of the body")
    if "power" in here:
        difference = turned if isinstance(turned, str) else turned["power"] - here["power"]
        limit = ROUND_OFF * np.abs(here["power"]).max() * 100.0
        remedy = "turn vectors by context.frame.vector(), points by .point(), torques by .torque() in packed()"
        yield judged("power: any axes", difference, limit, views, remedy)
    for role in [role for role in ("law", *MOVING, "carried_inertia", "carried_momentum") if role in here]:
        if isinstance(turned, str):
            yield judged(f"{role}: any axes", turned, 0.0, views, "")
            continue
        wrench, turned_wrench = _wrench(role, here[role], views), _wrench(role, turned[role], turned_views)
        force = turned_wrench[:, :3] @ TURN.T
        torque = turned_wrench[:, 3:] @ TURN.T + np.cross(ORIGIN, force)
        difference = np.concatenate([force, torque], axis=1) - wrench
        # Moving the origin and turning add up numbers as large as these.
        largest = max(np.abs(values).max() for values in (here[role], turned[role], wrench))
        limit = ROUND_OFF * largest * 100.0
        remedy = "turn vectors by context.frame.vector(), points by .point(), torques by .torque() in packed()"
        yield judged(f"{role}: any axes", difference, limit, views, remedy)


def _wrench(role: str, value: np.ndarray, views: Views) -> np.ndarray:
    """(force; torque) (k, 6) of a law; for a matrix or a load, at the views' velocities."""
    if role not in ("damping", "load", "carried_inertia"):
        return value
    twist = np.concatenate([views.velocity, views.rate], axis=1)
    resistance = np.einsum("kij,kj->ki", value[:, :36].reshape(-1, 6, 6), twist)
    return np.asarray(value[:, 36:] - resistance if role == "load" else -resistance)


class Slope(NamedTuple):
    """A central difference `value` (k, ...), and a bound of its error: step error, from twice the step, and rounding."""

    value: np.ndarray
    allowed: np.ndarray


def _slope(values: Any, step: float, reach: np.ndarray) -> Slope:
    """Slope of values(by), from by = +-step and +-2 step; reach (k,): magnitude of the varied quantity, for rounding."""
    near, far = [(np.asarray(values(by)), np.asarray(values(-by))) for by in (step, 2.0 * step)]
    first, second = (near[0] - near[1]) / (2.0 * step), (far[0] - far[1]) / (4.0 * step)
    size = np.maximum.reduce([np.abs(value) for value in (*near, *far)])
    rounded = ROUND_OFF * (size + reach.reshape(-1, *(1,) * (size.ndim - 1)) * np.abs(first)) / step
    # The error of the step is a third of the difference; where the slope jumps nearby, as much as that.
    return Slope(first, 2.0 * np.abs(second - first) + rounded)


def _potential(bench: Bench, step: float) -> Iterator[Check]:
    """Check force = -R^T dU/db and torque = -dU/dR (left-trivialised)."""
    if "law" not in bench.roles or not getattr(bench.module, "POTENTIAL", False):
        return
    views, term = bench.views, bench.term
    reach = np.linalg.norm(views.position, axis=1) + 1.0

    def U(at: Views) -> np.ndarray:
        value = term.potential(bench.own, at.position[:, None], at.attitude[:, None], bench.parameters)
        return np.broadcast_to(value, (len(at.position), 1))[:, 0]

    moves, turns = (
        [_slope(lambda by, f=f, i=i: U(f(i, by)), step, reach) for i in range(3)] for f in (views.moved, views.turned)
    )
    R = views.attitude
    force = -notation.rotate_into(R, np.stack([slope.value for slope in moves], axis=1))
    allowed = np.linalg.norm([slope.allowed for slope in moves], axis=0)
    torque = -np.stack([slope.value for slope in turns], axis=1)
    wrench = bench.at(views)["law"]
    remedy = "is it the gradient of potential()?"
    if not np.any(U(views)):
        remedy = "potential() gives 0 everywhere: write it, or drop POTENTIAL"
    yield judged("law: force = -R^T dU/db", wrench[:, :3] - force, allowed, views, remedy)
    limits = np.stack([slope.allowed for slope in turns], axis=1)
    yield judged("law: torque = -dU/dR", wrench[:, 3:] - torque, limits, views, remedy)
    if hasattr(bench.module, "energy"):
        known, energy = U(views), bench.at(views)["energy"][:, 0]
        round_off = 100.0 * ROUND_OFF * max(np.abs(known).max(), np.abs(energy).max())
        difference = (energy - energy[0]) - (known - known[0])
        yield judged("energy: as potential()", difference, round_off, views, "is it u + U, with u as given?")


def _damping(bench: Bench, step: float) -> Iterator[Check]:
    """Check nu.D nu >= 0 at the views' velocities, and at the velocities with the smallest power for this D."""
    if not {"damping", "load"} & set(bench.roles):
        return
    views = bench.views
    D = _matrices(bench.at(views))
    weakest = np.linalg.eigh(D + np.swapaxes(D, 1, 2))[1][:, :, 0]
    trials = [views, *(replace(views, velocity=s * weakest[:, :3], rate=s * weakest[:, 3:]) for s in (1.0, -1.0))]
    power, allowed, twist = (np.concatenate(x) for x in zip(*(_power(bench, trial) for trial in trials), strict=True))
    endless = ~(np.isfinite(power) & np.isfinite(allowed))
    if endless.any():
        i = int(endless.argmax())
        where = f"at velocity {sizes(twist[i, :3])} m/s, rate {sizes(twist[i, 3:])} rad/s"
        yield Check("damping: power", np.inf, 0.0, False, f"power is not finite {where}; bound D")
        return
    i = int((power + allowed).argmin()) if (power + allowed).min() < 0.0 else int(power.argmin())
    least, limit = float(power[i]), float(allowed[i])
    where = f"least power {least:.3g} W at velocity {short(twist[i, :3])} m/s, rate {short(twist[i, 3:])} rad/s"
    if not bench.term.dissipative:
        yield Check("damping: power", max(0.0, -least), np.inf, True, f"note: {where} (dissipative = False)")
        return
    good = bool(np.all(power >= -allowed))
    text = where if good else f"{where}; D creates energy: write dissipative = False if it may"
    yield Check("damping: power >= 0", max(0.0, -least), limit, good, text)


def _push(bench: Bench, step: float) -> Iterator[Check]:
    """Check that push equals damping: w - D (nu; Om)."""
    if "push" not in bench.roles:
        return
    views, here = bench.views, bench.at(bench.views)
    other = "load" if "load" in here else "damping"
    twist = np.abs(np.concatenate([views.velocity, views.rate], axis=1))
    limit = (
        100.0 * ROUND_OFF * (np.einsum("kij,kj->ki", np.abs(_matrices(here)), twist).max() + np.abs(here["push"]).max())
    )
    remedy = f"is it w less the matrix of {other}() times (nu; Om)?"
    yield judged(f"push: as {other}", here["push"] - _wrench(other, here[other], views), limit, views, remedy)


def _matrices(here: dict[str, np.ndarray]) -> np.ndarray:
    """Matrices (k, 6, 6) of damping, or of loads."""
    return (here["damping"] if "damping" in here else here["load"][:, :36]).reshape(-1, 6, 6)


def _power(bench: Bench, views: Views) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute (nu.D nu (k,) [W]; the effect of rounding on it; the velocities (k, 6))."""
    D = _matrices(bench.at(views))
    twist = np.concatenate([views.velocity, views.rate], axis=1)
    power = np.einsum("ki,kij,kj->k", twist, D, twist)
    return power, ROUND_OFF * np.einsum("ki,kij,kj->k", np.abs(twist), np.abs(D), np.abs(twist)), twist


def _flow(bench: Bench, step: float) -> Iterator[Check]:
    """Check that du/dt and du/db are the derivatives of u, that the host's water() equals u, and that FLOW describes u."""
    if "flow" not in bench.roles or bench.noisy:
        return
    views, kind = bench.views, getattr(bench.module, "FLOW", None)
    flow = bench.at(views)["flow"]

    def u(at: Views) -> np.ndarray:
        return bench.at(at)["flow"][:, :3]

    reach = np.linalg.norm(views.position, axis=1) + 1.0
    moves = [_slope(lambda by, i=i: u(views.moved(i, by)), step, reach) for i in range(3)]
    passes = _slope(lambda by: u(replace(views, time=views.time + by)), step, views.time + 1.0)
    yield judged("flow: rate = du/dt", flow[:, 3:6] - passes.value, passes.allowed, views, "add it to f.rate")
    for i, name in enumerate(("by_north", "by_east", "by_depth")):
        gradient = flow[:, 6 + 3 * i : 9 + 3 * i]
        difference, allowed = gradient - moves[i].value, moves[i].allowed
        yield judged(f"flow: {name} = du/db{i + 1}", difference, allowed, views, f"add it to f.{name}")
    yield _flow_kind(kind, moves, passes)
    yield _water(bench, u, sum(reach * np.abs(slope.value).max(axis=1) for slope in moves))


def _water(bench: Bench, u: Callable[[Views], np.ndarray], rounded: np.ndarray) -> Check:
    """Check that water(), or water_at_start() at t = 0, equals flow(). rounded (k,): effect of a position's rounding."""
    term, views = bench.term, bench.views
    velocity = term.water(bench.own, views.position[:, None], views.time, bench.parameters)
    if velocity is None and type(term).water_at_start is Term.water_at_start:
        text = f"write water(numbers, position, time, parameters) in {type(term).__name__}: start and energy need it"
        return Check("flow: water()", np.inf, 0.0, False, text)
    if velocity is None:
        views = replace(views, time=0.0 * views.time)
        host = term.water_at_start(bench.own, views.position, bench.context(bench.parameters))
    else:
        host = velocity[:, 0]
    limit = ROUND_OFF * (max(np.abs(host).max(), 1e-300) + rounded)
    return judged("flow: water()", u(views) - host, limit, views, "the host's water() must be what flow() gives")


def _flow_kind(kind: Any, moves: list[Slope], passes: Slope) -> Check:
    """Check that FLOW allows the observed variation of the velocity."""
    varies = any(np.any(np.abs(slope.value) > slope.allowed) for slope in moves)
    changes = bool(np.any(np.abs(passes.value) > passes.allowed))
    least = "varying" if varies else "uniform" if changes else "steady"
    good = kind in FLOWS and FLOWS.index(kind) >= FLOWS.index(least)
    text = f"FLOW = {kind!r}" + ("" if good else f". Write FLOW = {least!r}")
    return Check("flow: FLOW", float(not good), 0.0, good, text)


def _follow(bench: Bench, step: float) -> Iterator[Check]:
    """Check that follow() depends on the time alone and is exact: two parts of an interval give the same as the whole."""
    if not bench.term.memory or not hasattr(bench.module, "follow"):
        return
    views, context = bench.views, bench.context(bench.parameters)

    def remembered(*parts: tuple[Views, float]) -> np.ndarray:
        bank = Bank(bench, context, views)
        for at, h in parts:
            bank.run_device(at, 2, h)
        rows = bank.memory.numpy()
        return np.asarray(rows.transpose(0, 2, 1).reshape(-1, rows.shape[1]))

    at_once = remembered((views, FOLLOWED))
    if not getattr(bench.module, "FOLLOWS_PLACE", False):
        elsewhere = Views(
            views.attitude[::-1], views.position + 1.0, 1.0 - views.velocity, 1.0 - views.rate, views.time
        )
        remedy = "leave follow() out: what this law remembers depends on more than the time"
        yield judged("follow: blind to the state", remembered((elsewhere, FOLLOWED)) - at_once, 0.0, views, remedy)
    earlier = replace(views, time=views.time - 0.25 * FOLLOWED)
    apart = remembered((earlier, 0.75 * FOLLOWED), (views, 0.25 * FOLLOWED)) - at_once
    limit = ROUND_OFF * (np.abs(at_once).max() + 1e-300)
    remedy = "advance by the exact solution over view.h, which ends at view.t"
    yield judged("follow: exact", apart, limit, views, remedy)


def _carried(bench: Bench, step: float) -> Iterator[Check]:
    """Check that an added inertia is symmetric."""
    if "carried_inertia" not in bench.roles:
        return
    D = bench.at(bench.views)["carried_inertia"].reshape(-1, 6, 6)
    apart = (D - np.swapaxes(D, 1, 2)).reshape(len(D), -1)
    remedy = "add m J^T J, as add_drag_at(D, m, r) does for a mass m at r"
    yield judged("carried_inertia: symmetric", apart, ROUND_OFF * np.abs(D).max(), bench.views, remedy)
