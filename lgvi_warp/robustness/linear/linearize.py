# SPDX-License-Identifier: Apache-2.0
"""`linearize`: linear model of one period about a motion; hold, lags and method are as in the run."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import explained, flag
from lgvi_warp.common.errors import Faults, MissingExtra, refusal
from lgvi_warp.common.near import near_names
from lgvi_warp.control.over_floor import seen_floors
from lgvi_warp.control.sensor import HANDED, Sensor
from lgvi_warp.criteria.running import step_of
from lgvi_warp.methods.method import Method
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.physics.terms.control_wrench import COMPONENTS, ControlWrench
from lgvi_warp.robustness.linear.bench import COORDINATES, Motion, MotionBench, calm, plant
from lgvi_warp.robustness.linear.differences import STEP, Differences, Row, names_of
from lgvi_warp.robustness.linear.trim import Trim
from lgvi_warp.runs.request import scene_of
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene

INPUTS = ("commands", "wrench")


@explained
@dataclass(frozen=True)
class LinearModel:
    """Discrete linear model of deviations from a motion: x' = A x + B u, y = C x + D u.

    x: n states; x': x one period later; u: m inputs; y: the first 12 states: position [m, inertial axes], rotation
    vector [rad], velocity [m/s], angular velocity [rad/s] (body axes). Other states are memory of actuators and parts.

    Attributes:
        A: state matrix (n, n).
        B: input matrix (n, m).
        C: output matrix (12, n).
        D: feedthrough matrix (12, m).
        dt: the period [s].
        states: names of the states (n,), such as "velocity[0]", "control_fins.place[1]", "heading_pid.memory[0]".
        inputs: names of the inputs (m,), such as "control_fins[0]"; for a wrench "X", "Y", "Z", "K", "M" and "N".
        about: the motion at the start of the period: position, attitude, velocity and angular_velocity by name.
        messages: notes on parts of the scene that the model leaves out: noise, drift and rounding of sensors, faults.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    dt: float
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    about: Mapping[str, np.ndarray]
    messages: tuple[str, ...] = ()

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs (12,): the coordinates of the motion."""
        return COORDINATES

    @property
    def poles(self) -> np.ndarray:
        """Eigenvalues of A (n,), the largest first."""
        values = np.linalg.eigvals(self.A)
        return np.asarray(values[np.argsort(-np.abs(values))])

    def part(self, states: Sequence[str], inputs: Sequence[str] | None = None) -> LinearModel:
        """Reduce the model to some of its states and inputs; all other states and inputs are set to 0.

        Args:
            states: names of the states to keep; a whole name, such as "velocity", keeps all of its entries.
            inputs: names of the inputs to keep; None, the default, keeps all inputs.

        Returns:
            The smaller model.

        Raises:
            SceneError: If a name is unknown.
        """
        faults = Faults()
        keep = chosen_places(faults, "states", states, self.states)
        push = chosen_places(faults, "inputs", self.inputs if inputs is None else inputs, self.inputs)
        faults.raise_if_any()
        return replace(
            self, A=self.A[np.ix_(keep, keep)], B=self.B[np.ix_(keep, push)], C=self.C[:, keep], D=self.D[:, push],
            states=tuple(self.states[i] for i in keep), inputs=tuple(self.inputs[i] for i in push))  # fmt: skip

    def state_space(self) -> Any:
        """Convert the model to a StateSpace of python-control (extra: control), to compute margins and designs.

        Returns:
            A control.StateSpace with the names of this model's states, inputs and outputs; dots become underscores.

        Raises:
            MissingExtra: If python-control is not installed.
        """
        try:
            import control
        except ImportError as error:
            raise MissingExtra("state spaces", "control", "control") from error
        names = {
            kind: [name.replace(".", "_") for name in getattr(self, kind)] for kind in ("states", "inputs", "outputs")
        }
        return control.StateSpace(self.A, self.B, self.C, self.D, self.dt, **names)


def chosen_places(faults: Faults, key: str, wanted: Sequence[str], known: tuple[str, ...]) -> list[int]:
    """Indices of names; the name of a vector stands for all its entries."""
    places: list[int] = []
    for name in wanted:
        entries = [i for i, each in enumerate(known) if each == name or each.startswith(f"{name}[")]
        if not entries:
            faults.keys(key, [name], known)
        places += entries
    return places


@near_names()
def linearize(
    scene: Scene,
    about: Trim | float | None = None,
    *,
    inputs: str = "commands",
    closed: bool = False,
    period: float | None = None,
    method: str | Method | None = None,
    h: float | None = None,
    step: float = STEP,
) -> LinearModel:
    """Linearise one period of the plant with constant commands, or of the closed loop.

    Central differences of the run's own steps give the model, so it includes the method, the lags of actuators and the
    hold of commands. Its errors are step^2 times a third derivative plus round-off / step, together about 1e-10. In a
    closed loop, noise, drift and rounding of sensors are set to 0, their mean, and faults are off.

    Args:
        scene: The scene, without waves and noise; or an Ensemble, whose scene is used.
        about: Motion to linearise about: a result of `lw.linear.trim`; or, in a closed loop, a time [s] of a run. None,
            the default: for a plant, the start with commands of 0; for a closed loop, the motion after one period.
        inputs: "commands" of the actuators, the default; or, for a plant only, "wrench": X, Y, Z [N], K, M, N [N m] in
            body axes about the body's origin, held for a period; the actuators keep their commands.
        closed: True includes the controller in the model; the inputs are then added to its commands. Default False.
        period: Period of a plant [s]. Default: the controller's period; without a controller, the step.
        method: As in `lw.solve`. Default: the method of the trim; without a trim, the scene's method.
        h: Step [s]. Default: the step of the trim; without a trim, the scene's step.
        step: Increment of the central differences; for |number| > 1, as a fraction of |number|. Default 1e-5.

    Returns:
        The model.

    Raises:
        SceneError: If an argument is wrong, if a part of the controller is random or acts only at some ticks, or if a
            vehicle that starts slightly off the motion fails.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("bluerov2_heavy")
        >>> steady = lw.linear.trim(scene, speed=0.5, fixed={"pitch": 0.0}, method="psi_s", h=0.02)
        >>> model = lw.linear.linearize(scene, steady, period=0.1)
        >>> model.A.shape, model.B.shape
        ((20, 20), (20, 8))
    """
    scene = scene_of(scene, "scene")
    calm(scene, "linear models")
    faults = Faults()
    faults.choice("inputs", inputs, INPUTS)
    faults.positive("step", step, "")
    if period is not None:
        faults.positive("period", period)
    closed = flag("closed", closed)
    if closed and scene.controller is None:
        faults.add("closed", closed, "needs a controller, which this scene has not", "give [controller]")
    if closed and (period is not None or inputs != "commands"):
        misplaced = "period" if period is not None else "inputs"
        faults.add(misplaced, period or inputs, "is that of a plant", "leave it out, or closed=True")
    if not (about is None or isinstance(about, Trim) or (closed and isinstance(about, int | float))):
        remedy = "give what lw.linear.trim returns" + (", or a time in seconds" if closed else ", or leave it out")
        faults.add("about", about, "is not a motion", remedy)
    faults.raise_if_any()
    if isinstance(about, Trim):
        scene = replace(scene, start=about.start)
        method, h = about.method if method is None else method, about.h if h is None else h
    h = step_of(scene, h)
    scene = replace(scene, events=seen_floors(scene.controller, scene.events))
    if closed:
        scene, _, messages = of_the_mean(scene)
        check_parts(scene.controller, "closed")
        model = _closed_model(scene, about if isinstance(about, int | float) else 0.0, method, h, step)
        return replace(model, messages=messages)
    return _plant_model(scene, about if isinstance(about, Trim) else None, inputs, period, method, h, step)


def _plant_model(
    scene: Scene, about: Trim | None, inputs: str, period: float | None, method: Any, h: float, step: float
) -> LinearModel:
    length = period or (scene.controller.period if scene.controller else h)
    name = "wrench_input"
    held = plant(scene, length, [ControlWrench(name=name)] if inputs == "wrench" else [])
    bench = MotionBench(Ensemble(held, 1), method, h, 2.0 * length, length)
    every = bench.every if bench.bus else round(length / bench.plan.grid.h)
    places = np.zeros(1, np.int64)
    motion = bench.commanded(bench.start(places), about.commands if about else {})
    commands = dict(bench.bus.commands) if bench.bus else {}
    rows = remembered(bench, motion.memory, terms=True)
    if inputs == "wrench":
        # Actuators stay where they are: of what they remember nothing moves.
        rows = [row for row in rows if row.key not in commands]
    pushed = [name] if inputs == "wrench" else list(commands)
    held_rows = [
        Row("", begin + i, COMPONENTS[i] if inputs == "wrench" else f"{key}[{i}]")
        for key, (begin, count) in commands.items()
        if key in pushed
        for i in range(count)
    ]
    derivatives = Differences(bench, every, every, [*rows, *held_rows], rows, step=step)(places, motion)[0]
    A, B = np.split(derivatives, [12 + len(rows)], axis=1)
    return _model(A, B, every * bench.plan.grid.h, names_of(rows), [row.name for row in held_rows], motion)


def _closed_model(scene: Scene, time: float, method: Any, h: float, step: float) -> LinearModel:
    period = scene.controller.period
    k = max(1, round(time / period))
    bench = MotionBench(Ensemble(scene, 1), method, h, (k + 1) * period, period)
    places, begin = np.zeros(1, np.int64), k * bench.every
    motion = bench.run(places, None, 0, begin)
    rows = loop_rows(bench, motion.memory)
    derivatives = Differences(bench, begin, bench.every, rows, rows, step=step)(places, motion)[0]
    names = names_of(rows)
    pushed, inputs = np.zeros((len(derivatives), 0)), list[str]()
    for key, (first, count) in bench.bus.commands.items():  # type: ignore[union-attr]
        for i in range(count):
            acting = [j for j, row in enumerate(rows) if row.key == "" and row.row in command_rows(bench, first + i)]
            pushed = np.column_stack([pushed, derivatives[:, [12 + j for j in acting]].sum(axis=1)])
            inputs.append(f"{key}[{i}]")
    keep = states_in_use(derivatives)
    return _model(derivatives[np.ix_(keep, keep)], pushed[keep], period, tuple(names[i] for i in keep), inputs, motion)


def command_rows(bench: MotionBench, row: int) -> tuple[int, ...]:
    """Rows of the bus through which a command acts during a period."""
    bus: Any = bench.bus
    return (bus.acting + row, bus.acting + bus.channels + row) if bus.delayed else (row,)


def loop_rows(bench: MotionBench, memory: Mapping[str, np.ndarray]) -> list[Row]:
    """Memory of a closed loop after a tick.

    Records that ticks make of themselves are left out. The undelivered demand is left out, too: only its sign matters,
    for the anti-windup of integrals.
    """
    bus: Any = bench.bus
    names = [f"{key}.command[{i}]" for key, (_, count) in bus.commands.items() for i in range(count)]
    kept = remembered(bench, memory, terms=True)
    for i, name in enumerate(names):
        words = ("acting", "before") if bus.delayed else ("",)
        rows = zip(command_rows(bench, i), words, strict=True)
        kept += [Row("", row, f"{name} {word}".strip()) for row, word in rows]
    kept += [row for row in remembered(bench, memory, terms=False) if row.key != "controller"]
    if bus.delayed:
        # The commands of the last ticks, the latest first.
        sets = memory["controller"].shape[1] // bus.channels
        for age in range(sets):
            kept += [Row("controller", age * bus.channels + i, f"{name} {age} ago") for i, name in enumerate(names)]
    return kept


def remembered(bench: MotionBench, memory: Mapping[str, np.ndarray], terms: bool) -> list[Row]:
    """Rows of the memory other than the commands."""
    choice = bench.plan.kernel_choice
    each = (term for term, _ in (choice.laws if terms else choice.parts_of_control) if term.key in memory)
    rows = []
    for term in each:
        count = memory[term.key].shape[1]
        word = "place" if terms and term.channels == count else "memory"
        rows += [Row(term.key, i, f"{term.key}.{word}[{i}]") for i in range(count)]
    return rows


# What of a sensor changes from tick to tick by chance, in whatever motion; and beside it what linear models take as such.
RANDOM = ("noise", "drift", "outlier")
OF_MEAN_ZERO = (*RANDOM, "quantum")
# How the message of what a linear loop leaves out begins.
AS_LINEAR = "of the loop as a linear one: "


def of_the_mean(scene: Any, words: Sequence[str] = OF_MEAN_ZERO) -> tuple[Any, tuple[str, ...], tuple[str, ...]]:
    """The scene without faults and without some sensor errors of mean zero.

    Returns: The scene, the names of the numbers that were set to 0, and a message for the user.
    """
    controller, sensors, zeros = scene.controller, [], list[str]()
    # A filter believes noises that are not 0; linear models refuse it elsewhere.
    if controller is None or any(part.uses for part in controller.sensors):
        return scene, (), ()
    for part in controller.sensors:
        acting = [word for word in words if isinstance(part, Sensor) and np.any(getattr(part, word))]
        zeros += [f"{part.key}.{word}" for word in acting]
        sensors.append(replace(part, **dict.fromkeys(acting, 0.0)) if acting else part)
    faults = [fault.key for fault in controller.faults]
    if not (zeros or faults):
        return scene, (), ()
    texts = [f"{', '.join(zeros)} taken as 0, its mean"] * bool(zeros) + [f"{', '.join(faults)} taken as off"] * bool(
        faults
    )
    scene = replace(scene, controller=replace(controller, sensors=sensors, faults=()))
    return scene, tuple(zeros), (f"{AS_LINEAR}{'; '.join(texts)}",)


def check_parts(controller: Any, purpose: str, refused: Collection[str] | None = None) -> None:
    """Refuse sensors with errors in `refused`, which prevent a steady motion; None: all errors except the bias."""
    problem = f"has no linear model of one period, which {purpose} needs"
    if refused:
        problem = f"lets no motion be steady, as {purpose} need it"
    faults = Faults()
    for part in controller.sensors:
        if not part.linear:
            faults.add("sensors", part.key, problem, "leave it out of this scene")
        if isinstance(part, Sensor):
            numbers = {name: np.asarray(value)[None] for name, value in part.parameters().items()}
            for word in part.features(numbers):
                if word in refused if refused else word not in ("bias", HANDED):
                    faults.add(f"{part.key}.{word}", getattr(part, word), problem, "leave it out of this scene")
    faults.raise_if_any()


def states_in_use(A: np.ndarray) -> np.ndarray:
    """Indices of the motion's states in A (n, n) and of states on which others depend; all else decays in a tick."""
    keep = np.arange(len(A))
    while True:
        some = keep[(keep < 12) | np.any(A[np.ix_(keep, keep)] != 0.0, axis=0)]
        if len(some) == len(keep):
            return some
        keep = some


def _model(
    A: np.ndarray, B: np.ndarray, dt: float, states: tuple[str, ...], inputs: Sequence[str], motion: Motion
) -> LinearModel:
    if not (np.all(np.isfinite(A)) and np.all(np.isfinite(B))):
        problem = "has no linear model: a member a little beside it fails within a period"
        raise refusal("about", "the motion", problem, "give another motion, or a shorter step")
    about = {name: getattr(motion, name)[0] for name in FIELDS}
    C = np.eye(12, len(A))
    return LinearModel(A, B, C, np.zeros((12, B.shape[1])), dt, states, tuple(inputs), about)
