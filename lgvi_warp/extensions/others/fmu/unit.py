# SPDX-License-Identifier: Apache-2.0
"""A vehicle as a unit of the FMI standard: its variables, and reading and setting their values."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lgvi_warp.common.errors import refusal
from lgvi_warp.common.status import Status
from lgvi_warp.control.callback import Callback
from lgvi_warp.control.controller import Controller
from lgvi_warp.control.set_point import SetPoint
from lgvi_warp.control.signals import ESTIMATE, NAVIGATION_ERROR, SIGNALS, saved_fields
from lgvi_warp.extensions.others.fmu.vehicle import SteppedVehicle
from lgvi_warp.physics import notation
from lgvi_warp.physics.fields import FIELDS, Field
from lgvi_warp.physics.terms.actuators import Commanded
from lgvi_warp.scene.names import numbers_of
from lgvi_warp.scene.scene import Scene
from lgvi_warp.scene.variations import MATRICES
from lgvi_warp.statistics.values.quantity import KNOWN
from lgvi_warp.store.layout import units_of_numbers

# What the inputs of a unit may be.
INPUTS = ("commands", "set_points")
# Numbers of more entries than this, such as those of tables, are no parameters.
MOST_ENTRIES = 64
# A time of the caller may be so far from a whole number of steps, in steps: many sums of a float's round-off.
SAME_STEP = 1e-6
SEED, STATUS = "seed", "status"
QUATERNION = Field("quaternion_wxyz", (4,), "1", "attitude as a unit quaternion, scalar first")
EULER = Field("euler", (3,), "rad", "roll, pitch and yaw, R = Rz(yaw) Ry(pitch) Rx(roll)")


@dataclass(frozen=True)
class Variable:
    """A single number of a unit. causality: "input", "parameter" or "output". start: Start value; None for outputs."""

    name: str
    causality: str
    unit: str
    meaning: str
    start: float | int | None = None

    @property
    def whole(self) -> bool:
        """Whether the variable is a whole number."""
        return self.name in (SEED, STATUS)


class VehicleUnit:
    """One vehicle with its actuators, its sensors and, unless commands are inputs, its controller.

    scene: A scene with a [run] step and method. inputs: "commands" of all terms that take them, instead of laws, guidance
    and allocation; or "set_points" of the guidance. variables: In the order of their value references.

    Raises:
        SceneError: If the scene cannot become a unit.
    """

    def __init__(self, scene: Scene, inputs: str):
        self.scene, self.seed = scene, 0 if scene.ensemble_settings is None else scene.ensemble_settings.seed
        self.h = scene.run.step
        if self.h is None:
            raise refusal("run.step", None, "is missing", "give [run] step, of which communication steps are multiples")
        self.of_commands = inputs == "commands"
        self._terms = [term for term in scene.terms if self.of_commands and term.channels and _held(scene, term)]
        self._guidance = [] if self.of_commands else _set_points(scene)
        acted = self._acted(scene)
        self._fields = self._outputs(acted)
        self.variables = tuple(self._variables())
        self._inputs = {variable.name: variable.start for variable in self.variables if variable.causality == "input"}
        self._values: dict[str, float | int] = {v.name: v.start for v in self.variables if v.start is not None}
        self._changed: set[str] = set()
        self._vehicle: SteppedVehicle | None = None
        self._shown: dict[str, float | int] | None = None
        self._late: str | None = None

    def _acted(self, scene: Scene) -> Scene:
        """The scene with a callback that applies the inputs."""
        if not self._terms:
            return scene
        own = {term.key: term for term in self._terms}
        free = [_free(term) if term.key in own else term for term in scene.terms]
        law = Callback(_nothing, to=list(own), name="inputs")
        if scene.controller is None:
            controller = Controller(period=self.h, laws=[law])  # type: ignore[arg-type]
        else:
            controller = replace(scene.controller, guidance=(), laws=[law], allocation=())
        return replace(scene, terms=free, controller=controller, ensemble_settings=None)

    def _outputs(self, acted: Scene) -> tuple[Field, ...]:
        """Fields of the outputs."""
        known = saved_fields(acted.controller)
        sensed = acted.controller is not None and len(acted.controller.sensors) > 0
        signals = [
            field
            for name, field in known.items()
            if name in SIGNALS and name != NAVIGATION_ERROR and sensed and SIGNALS[name].group in ("measured", ESTIMATE)
        ]
        return *(known[name] for name in FIELDS if name != "attitude"), QUATERNION, EULER, *signals

    def _variables(self) -> Iterator[Variable]:
        numbers = {name: np.asarray(value) for name, value in numbers_of(self.scene).items()}
        units = units_of_numbers(self.scene, numbers)
        held = "held from a tick to the next"
        for term in self._terms:
            # Limits are in the unit of what they limit.
            names = [f"{term.key}.limit[{i}]" for i in range(term.channels)]
            for i, unit in enumerate(units_of_numbers(self.scene, names).values()):
                start = float(term.command[i]) if isinstance(term, Commanded) else 0.0  # type: ignore[attr-defined]
                yield Variable(f"{term.key}.command[{i}]", "input", unit, f"command of {term.key}, {held}", start)
        wished = {f"{part.key}.{name}" for part in self._guidance for name in part.parameters()}
        for name in (name for name in numbers if name in wished):
            for label, number in _entries(name, numbers[name]):
                yield Variable(label, "input", units[name], f"set-point of {name}", number)
        driven = {f"{term.key}.{name}" for term in self._terms for name in ("command", *term.driven_fields)}
        for name in (name for name, value in numbers.items() if name not in wished | driven and not _unfit(value)):
            for label, number in _entries(name, numbers[name]):
                yield Variable(label, "parameter", units[name], f"number of the scene: {name}", number)
        yield Variable(SEED, "parameter", "1", "seed of the noise", self.seed)
        for field in self._fields:
            for label in field.labels:
                yield Variable(label.replace(", ", ","), "output", field.unit, field.meaning)
        codes = ", ".join(f"{status.value} {status.text}" for status in Status)
        yield Variable(STATUS, "output", "1", f"how the vehicle ended, 0 while it moves: {codes}")

    @property
    def time(self) -> float:
        """Time of the vehicle [s]."""
        return 0.0 if self._vehicle is None else self._vehicle.steps * self._vehicle.h

    def get(self, name: str) -> float | int:
        """The present value of a variable."""
        if name in self._values:
            return self._values[name]
        if self._shown is None:
            self._shown = self._show()
        return self._shown[name]

    def set(self, name: str, value: float | int) -> None:
        """Set an input, or a parameter before the first step. If a parameter is set later, the next step fails."""
        if value == self._values[name]:
            return
        fixed = name not in self._inputs
        if fixed and self.time > 0.0:
            # Told by the next step: what is raised here ends the process that imports the unit.
            self._late = f"{name} = {value} is a parameter, and the vehicle has moved. Reset the unit first"
            return
        self._values[name] = value
        if fixed:
            self._changed.add(name)
        if fixed or (self.time == 0.0 and not self.of_commands):
            self._vehicle = self._shown = None

    def begin(self) -> SteppedVehicle:
        """The vehicle; a new one at its start if one of its numbers was set since."""
        if self._vehicle is None:
            chosen = self._changed - {SEED}
            if not self.of_commands:
                chosen |= {name for name, start in self._inputs.items() if start != self._values[name]}
            scene = self._acted(self.scene.with_numbers({name: self._values[name] for name in sorted(chosen)}))
            signals = tuple(field.name for field in self._fields if field.name in SIGNALS)
            self._vehicle = SteppedVehicle(scene, int(self._values[SEED]), signals, tuple(self._set_points()))
        return self._vehicle

    def _set_points(self) -> dict[str, Any]:
        """The present numbers of set-points, by name."""
        numbers: dict[str, Any] = {}
        for part in self._guidance:
            for name, value in part.parameters().items():
                labels = [label for label, _ in _entries(f"{part.key}.{name}", value)]
                numbers[f"{part.key}.{name}"] = np.reshape([self._values[label] for label in labels], np.shape(value))
        return numbers

    def step(self, time: float, length: float) -> None:
        """Advance from a time [s] by a length of time [s], a whole number of steps.

        Raises:
            ValueError: If time and length do not fit, or the vehicle fails.
        """
        if self._late is not None:
            raise ValueError(self._late)
        vehicle = self.begin()
        last = (time + length) / vehicle.h
        if abs(time / vehicle.h - vehicle.steps) > SAME_STEP:
            raise ValueError(f"time {time:.9g} s: the vehicle is at {self.time:.9g} s. Go on from there")
        steps = round(last) - vehicle.steps if math.isfinite(last) else 0
        if steps < 1 or abs(last - round(last)) > SAME_STEP:
            problem = f"communication step {length:.9g} s is not a whole number of steps of {vehicle.h:.9g} s"
            raise ValueError(f"{problem}. Give a multiple, or export a scene with another [run] step")
        for name in (name for name in self._inputs if not math.isfinite(self._values[name])):
            raise ValueError(f"{name} = {self._values[name]} is not finite. Give a number")
        if not self.of_commands and vehicle.steps:
            vehicle.change(self._set_points())
        vehicle.advance(steps, np.array([self._values[name] for name in self._inputs]))
        self._shown = None
        if vehicle.status and not Status(vehicle.status).stopped:
            raise ValueError(f"the vehicle failed before {self.time:.9g} s: {Status(vehicle.status).text}")

    def _show(self) -> dict[str, float | int]:
        """Values of all outputs."""
        vehicle = self.begin()
        attitude = vehicle.values["attitude"]
        euler = KNOWN["euler"].function({"attitude": attitude[None, None]}, None)  # type: ignore[arg-type]
        others = {"quaternion_wxyz": notation.quaternion_from_matrix(attitude), "euler": np.asarray(euler)[0, 0]}
        shown: dict[str, float | int] = {STATUS: vehicle.status}
        for field in self._fields:
            values = others[field.name] if field.name in others else vehicle.values[field.name]
            labels = [label.replace(", ", ",") for label in field.labels]
            shown |= dict(zip(labels, np.ravel(values).tolist(), strict=True))
        return shown

    def remembered(self) -> dict[str, Any]:
        """The present state of the unit, as JSON values."""
        return {"values": dict(self._values), "changed": sorted(self._changed), "vehicle": self.begin().remembered()}

    def recall(self, state: Mapping[str, Any]) -> None:
        """Restore a state of this unit or of another instance of it."""
        if state["values"].keys() != self._values.keys():
            raise ValueError("the state is that of another unit: give one of this")
        if {n: state["values"][n] for n in state["changed"]} != {n: self._values[n] for n in self._changed}:
            self._vehicle = None
        self._values, self._changed, self._shown = dict(state["values"]), set(state["changed"]), None
        self._late = None
        self.begin().recall(state["vehicle"])


def _held(scene: Scene, term: Any) -> bool:
    """Whether the commands of a term are inputs; a term with its own schedule keeps the schedule."""
    return (scene.controller is not None and term.key in scene.controller.actuators) or getattr(term, "holds", True)


def _free(term: Any) -> Any:
    """The term with its own commands set to 0."""
    return term.with_fields({"command": np.zeros(term.channels)}) if isinstance(term, Commanded) else term


def _set_points(scene: Scene) -> list[SetPoint]:
    """Parts of the guidance whose numbers are inputs."""
    parts = () if scene.controller is None else scene.controller.guidance
    found = [part for part in parts if isinstance(part, SetPoint)]
    if not found:
        remedy = 'give [[controller.guidance]] type = "set_point", or inputs="commands"'
        raise refusal("inputs", "set_points", "need a set-point, which the scene has not", remedy)
    return found


def _entries(name: str, value: Any) -> Iterator[tuple[str, float]]:
    """(name, value) of each entry of a number of the scene; of a symmetric matrix, entries on and above the diagonal."""
    array = np.asarray(value, dtype=np.float64)
    for index in np.ndindex(*array.shape):
        if name not in MATRICES or index[0] <= index[1]:
            yield name + (f"[{','.join(map(str, index))}]" if index else ""), float(array[index])


def _unfit(value: np.ndarray) -> bool:
    """Whether a number cannot be a variable: it has too many entries, or is not finite."""
    return value.size > MOST_ENTRIES or value.dtype.kind not in "fiu" or not np.all(np.isfinite(value))


def _nothing(t: float, y: Any, r: Any, members: Any) -> Any:
    """Placeholder of the callback; the caller of the unit sets the answer of each tick."""
    raise AssertionError
