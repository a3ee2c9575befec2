# SPDX-License-Identifier: Apache-2.0
"""`trim`: steady straight and level motion of a vehicle, and the commands that hold it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Self

import numpy as np

from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.common.near import near_names
from lgvi_warp.common.summaries import few_digits, listed
from lgvi_warp.control.over_floor import seen_floors
from lgvi_warp.criteria.files import Saved
from lgvi_warp.criteria.running import step_of
from lgvi_warp.methods.method import Method
from lgvi_warp.physics import notation
from lgvi_warp.robustness.linear.bench import COORDINATES, Motion, MotionBench, calm, plant
from lgvi_warp.runs.request import scene_of
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.scene.start import Start

# Largest acceleration of a steady motion [m/s2, rad/s2]: far above round-off over a step, some 1e-12.
STEADY = 1e-8
# Half a difference of the unknowns, as a part of numbers above 1.
STEP = 1e-6
# Commands to begin with, as parts of their limits: where thrust goes with n |n|, it has no derivative at 0.
GUESSES = (0.0, 0.05, 0.5)
ANGLES = ("roll", "pitch", "drift")
# Numbers that the answer names.
MOST_NAMED = 5


@dataclass(frozen=True)
class Trim(Saved):
    """A steady straight and level motion.

    Attributes:
        start: state of the motion, for the field `start` of a scene.
        commands: key of an actuator -> commands that maintain the motion, (channels,).
        values: values of the free quantities by name: roll, pitch and drift (course minus heading) [rad], speed [m/s],
            and commands, such as "thrusters[0]".
        fixed: values of the fixed quantities by name.
        residual: remaining accelerations (6,) in body axes [m/s2, rad/s2].
        method: method with which a run keeps the motion.
        h: step with which a run keeps the motion [s].
    """

    study: ClassVar[str] = "trim"

    start: Start
    commands: Mapping[str, np.ndarray]
    values: Mapping[str, float]
    fixed: Mapping[str, float]
    residual: np.ndarray
    method: Method
    h: float

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the free quantities, in the order of the values."""
        return tuple(self.values)

    def _content(self) -> dict[str, Any]:
        # "start" as the section of a scene file; of the method what is no default.
        commands = {key: each.tolist() for key, each in self.commands.items()}
        found = {"start": self.start.to_dict(), "commands": commands, "values": dict(self.values)}
        chosen = ((item.name, getattr(self.method, item.name), item.default) for item in fields(self.method)[1:])
        options = {name: value for name, value, default in chosen if value != default and name != "reason"}
        method = {"method": self.method.name, "step": self.h} | ({"method_options": options} if options else {})
        return {**found, "fixed": dict(self.fixed), "residual": self.residual.tolist(), **method}

    @classmethod
    def _of_content(cls, content: dict[str, Any]) -> Self:
        commands = {key: np.array(each, np.float64) for key, each in content["commands"].items()}
        method = Method(content["method"], **content.get("method_options", {}))
        residual = np.array(content["residual"], np.float64)
        return cls(Start(**content["start"]), commands, dict(content["values"]), dict(content["fixed"]), residual, method,
                   float(content["step"]))  # fmt: skip

    def rows(self) -> Iterator[dict[str, Any]]:
        for kind, values in (("free", self.values), ("fixed", self.fixed)):
            for name, value in values.items():
                yield {"name": name, "value": float(value), "kind": kind}

    @property
    def answer(self) -> str:
        # Without round-off, of which the text has all digits.
        rounded = {name: round(value, 9) + 0.0 for name, value in (self.values or self.fixed).items()}
        return f"The motion is steady with {listed(_texts(rounded, 4), MOST_NAMED)}."

    def _report(self) -> list[str]:
        remainder = f"accelerations below {np.abs(self.residual).max():.1e} m/s2, rad/s2"
        lists = {"free": self.values, "fixed": self.fixed}
        return [
            *(f"{name:<12}{', '.join(_texts(each)) or 'nothing'}" for name, each in lists.items()),
            f"residual    {remainder}",
        ]


def _texts(values: Mapping[str, float], digits: int = 6) -> list[str]:
    """Texts of names with values; a command is in the unit of its term, which the user chooses."""
    units = {name: "rad" for name in ANGLES} | {"speed": "m/s"}
    return [f"{name} {few_digits(value, units.get(name, ''), digits)}" for name, value in values.items()]


@near_names()
def trim(
    scene: Scene,
    speed: float | None = None,
    *,
    free: Sequence[str] | None = None,
    fixed: Mapping[str, float] | None = None,
    method: str | Method | None = None,
    h: float | None = None,
) -> Trim:
    """Find a steady straight and level motion at the position and heading of the scene's start.

    Velocities and rates are the same after a step of the method, so a run that starts with this motion keeps it, to
    round-off. The motion differs from the equations' steady motion by the method's error. The controller is left out.

    Args:
        scene: The scene, or an Ensemble, whose scene is used.
        speed: Speed over ground [m/s]; None, the default: the speed is free, as for a propeller with constant thrust.
        free: Names of free quantities: "roll", "pitch", "drift" (course minus heading), "speed", commands, such as
            "thrusters[0]", or "thrusters" for all commands of the term. None, the default: all that are not fixed.
        fixed: Values of other quantities by name; None by default. A quantity neither free nor fixed is 0.
        method: As in `lw.solve`; the scene's method by default.
        h: Step [s]; the scene's step by default.

    Returns:
        The motion, with the values of the free quantities and the remaining acceleration.

    Raises:
        SceneError: If no steady motion is found, or waves or noise act.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("bluerov2_heavy")
        >>> steady = lw.linear.trim(scene, speed=0.5, fixed={"pitch": 0.0}, method="psi_s", h=0.02)
        >>> print(f"{steady.start.velocity[0]:.3f} m/s")
        0.500 m/s
    """
    from scipy.optimize import least_squares

    scene = scene_of(scene, "scene")
    calm(scene, "steady motions")
    h = step_of(scene, h)
    bench = MotionBench(
        Ensemble(plant(replace(scene, events=seen_floors(scene.controller, scene.events)), h), 1), method, h, 2.0 * h, h
    )
    problem = _Problem(scene, bench, speed, free, dict(fixed or {}))
    best: Any = None
    for part in GUESSES:
        guess = problem.guess(part)
        if len(guess) == 0:
            break
        answer = least_squares(
            problem.residual, guess, problem.jacobian, (-problem.most, problem.most), "trf", xtol=1e-15, ftol=1e-15,
            gtol=1e-15, x_scale=problem.scale, max_nfev=200)  # fmt: skip
        if best is None or answer.cost < best.cost:
            best = answer
        if np.abs(best.fun).max() < STEADY:
            break
    x = np.zeros(0) if best is None else best.x
    accelerations = problem.residual(x)
    if not np.abs(accelerations).max() < STEADY:
        worst = int(np.argmax(np.abs(accelerations)))
        problem_text = f"has no steady motion with {', '.join(problem.free) or 'nothing'} free: "
        problem_text += (
            f"{accelerations[worst]:.3g} of the rate of {COORDINATES[6 + worst]} is left at the best of them"
        )
        remedy = "let more be free (speed=None), give actuators that can, or other ballast"
        raise refusal("trim", "" if speed is None else f"speed {speed:g} m/s", problem_text, remedy)
    return problem.answer(x, accelerations)


class _Problem:
    """The free numbers, and the accelerations that follow from them."""

    def __init__(
        self, scene: Scene, bench: MotionBench, speed: float | None, free: Sequence[str] | None, fixed: dict[str, float]
    ):
        self.bench = bench
        controller = bench.plan.kernel_choice.controller
        actuators: Mapping[str, Any] = controller.actuators if controller else {}
        self.limits = {key: term.limit for key, term in actuators.items()}
        channels = [f"{key}[{i}]" for key, limit in self.limits.items() for i in range(len(limit))]
        names = (*ANGLES, "speed", *channels)
        faults = Faults()
        if speed is not None:
            faults.number("speed", speed, "m/s")
            if "speed" in fixed:
                faults.add("fixed", "speed", "is given twice", "leave out one")
            fixed = {**fixed, "speed": speed}
        wished = names if free is None else tuple(free)
        chosen = [n for name in wished for n in ([c for c in channels if c.startswith(f"{name}[")] or [name])]
        faults.keys("free", chosen, names)
        faults.keys("fixed", fixed, names)
        if free is not None:
            for name in sorted(set(chosen) & fixed.keys()):
                faults.add("free", name, "has a value too", "leave out one")
        faults.raise_if_any()
        self.free = tuple(name for name in names if name in chosen and name not in fixed)
        self.values = dict.fromkeys(names, 0.0) | {name: float(value) for name, value in fixed.items()}
        top = np.concatenate([np.full(3, 1.5), [np.inf], *self.limits.values()])
        at = [names.index(name) for name in self.free]
        self.most, self.angles = np.where(top == 0.0, 1e-12, top)[at], [name in ANGLES for name in self.free]
        self.scale = np.where(self.angles, 0.1, np.where(np.isfinite(self.most), np.clip(self.most, 0.1, 100.0), 1.0))
        self.origin = bench.start(np.zeros(1, np.int64))
        R = self.origin.attitude[0]
        self.heading = float(np.arctan2(R[1, 0], R[0, 0]))
        self.names = names
        start = scene.start.given()
        # A start gives either velocity.
        velocity = start["velocity" if "velocity" in start else "velocity_inertial"]
        self.ahead = float(np.linalg.norm(velocity)) or 1.0

    def guess(self, part: float) -> np.ndarray:
        """Initial guess: the speed of the start, and the fraction `part` of the largest commands."""
        values = np.where(np.isfinite(self.most), part * np.minimum(self.most, 1e3), self.ahead)
        return np.where(self.angles, 0.0, values)

    def motions(self, x: np.ndarray) -> Motion:
        """The motions (m,) with these numbers (m, free)."""
        m = len(x)
        value = {name: np.full(m, each) for name, each in self.values.items()}
        value |= dict(zip(self.free, x.T, strict=True))
        zero = np.zeros(m)
        yaw = np.full(m, self.heading)
        R = np.eye(3)
        for turn in ((zero, zero, yaw), (zero, value["pitch"], zero), (value["roll"], zero, zero)):
            R = R @ notation.matrix_from_rotation_vector(np.stack(turn, axis=1))
        course = yaw + value["drift"]
        over = np.stack([value["speed"] * np.cos(course), value["speed"] * np.sin(course), zero], axis=1)
        origin = self.bench.commanded(self.origin.of(np.zeros(m, np.int64)), self.commands(value))
        return Motion(origin.position, R, notation.rotate_into(R, over), np.zeros((m, 3)), origin.memory)

    def commands(self, value: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """Commands, key of an actuator -> (..., channels)."""
        return {
            key: np.stack([value[f"{key}[{i}]"] for i in range(len(limit))], axis=-1)
            for key, limit in self.limits.items()
        }

    def _rates(self, x: np.ndarray) -> np.ndarray:
        before, k = self.motions(x), self.bench.every
        after = self.bench.run(np.zeros(len(x), np.int64), before, k, k + 1)
        names, h = ("velocity", "angular_velocity"), self.bench.plan.grid.h
        rates = np.concatenate([(getattr(after, name) - getattr(before, name)) / h for name in names], axis=1)
        # Where a step failed: far from what is looked for.
        return np.where(np.isfinite(rates), rates, 1e6)

    def residual(self, x: np.ndarray) -> np.ndarray:
        """The remaining accelerations (6,) with these numbers."""
        return self._rates(x[None])[0]

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """The derivatives of the accelerations by the free numbers (6, free), from one launch."""
        delta = STEP * np.maximum(1.0, np.abs(x))
        rates = self._rates(np.concatenate([x + np.diag(delta), x - np.diag(delta)]))
        plus, minus = np.split(rates, 2)
        return np.asarray(((plus - minus) / (2.0 * delta[:, None])).T)

    def answer(self, x: np.ndarray, accelerations: np.ndarray) -> Trim:
        """The steady motion with these numbers."""
        motion, plan = self.motions(x[None]), self.bench.plan
        start = Start(position=motion.position[0], attitude=motion.attitude[0], velocity=motion.velocity[0])
        values = dict(zip(self.free, map(float, x), strict=True))
        fixed = {name: self.values[name] for name in self.names if name not in values}
        return Trim(start, self.commands(self.values | values), values, fixed, accelerations, plan.method, plan.grid.h)
