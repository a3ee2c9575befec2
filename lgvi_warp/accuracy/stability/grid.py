# SPDX-License-Identifier: Apache-2.0
"""Members of a stability map: the quantities along its two axes, and the state and parameters of every cell."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import items_of, whole_number
from lgvi_warp.common.errors import Faults, closest
from lgvi_warp.physics import notation, vehicle
from lgvi_warp.physics import rates as member_rates
from lgvi_warp.physics.fields import FIELDS, TABLE
from lgvi_warp.physics.terms.drag import Drag
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.store.layout import parameter_units

# Names of axes that are no parameters of the scene -> unit and label.
SPECIAL = {
    "h": ("s", "step h"),
    "angular_velocity": (TABLE["angular_velocity"].unit, "|angular velocity|"),
    "speed": (TABLE["speed"].unit, "speed"),
    "added_mass_ratio": ("1", "largest added mass / mass"),
    "drag_number": ("1/s", "largest drag rate (l + 2 q |v|) / I"),
}
# Their units in pictures; stores write them another way.
ENVIRONMENT = {"environment.gravity": "m/s2", "environment.water_density": "kg/m3"}
ALIASES = {"start.angular_velocity": "angular_velocity", "start.velocity": "speed", "omega": "angular_velocity"}
# Largest number of starts of all cells: some gigabytes.
MOST_MEMBERS = 10_000_000
FORM = '"NAME", "NAME=LOW:HIGH" or "NAME=LOW:HIGH:linear", with ":scale" or ":set" at the end for parameters'


@dataclass(frozen=True)
class Axis:
    """Axis of a stability map: a quantity and the range of its values.

    Attributes:
        name: "h": step [s]; "angular_velocity" [rad/s] or "speed" [m/s]: magnitude at the start (the direction is
            kept); "added_mass_ratio": largest added mass divided by the mass [1]; "drag_number": largest damping rate
            by drag at the start [1/s] (the step times this rate is the drag number); or a name of scene.parameters().
        low: lowest value; None derives it from the scene.
        high: highest value; None derives it from the scene.
        log: True spaces the values by equal ratios, False by equal differences. Default True.
        scaled: True multiplies the parameter by each value of the axis, False sets the parameter to this value. Default
            None: a number is set; a vector or matrix is multiplied.

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.studies.Axis.parse("vehicle.mass=50:500:linear").values(4)
        array([ 50., 200., 350., 500.])
    """

    name: str
    low: float | None = None
    high: float | None = None
    log: bool = True
    scaled: bool | None = None

    @classmethod
    def parse(cls, text: str) -> Axis:
        """Read an axis from a text.

        Args:
            text: "NAME", "NAME=LOW:HIGH" or "NAME=LOW:HIGH:linear", with ":scale" or ":set" at the end for parameters.

        Returns:
            The axis, with the default of each field that the text does not give.

        Raises:
            SceneError: if the text has another form.
        """
        name, equals, rest = str(text).partition("=")
        faults, words = Faults(), rest.split(":") if equals else []
        low, high, log, scaled = None, None, True, None
        try:
            if equals:
                low, high = float(words[0]), float(words[1])
            for word in words[2:]:
                if word in ("log", "linear"):
                    log = word == "log"
                elif word in ("scale", "set"):
                    scaled = word == "scale"
                else:
                    raise ValueError
        except (ValueError, IndexError):
            faults.add("axis", text, "is not understood", f"write {FORM}")
        faults.raise_if_any()
        return cls(name.strip(), low, high, log, scaled)

    @property
    def key(self) -> str:
        """Name of the axis with aliases replaced."""
        return ALIASES.get(self.name, self.name)

    def values(self, points: int) -> np.ndarray:
        """List the values along the axis. Both ends of its range must be given.

        Args:
            points: number of values.

        Returns:
            Values from low to high (points,), in the unit of the axis.
        """
        points = whole_number("points", points, 1)
        assert self.low is not None
        assert self.high is not None
        return np.geomspace(self.low, self.high, points) if self.log else np.linspace(self.low, self.high, points)


@dataclass(frozen=True, eq=False)
class Line:
    """Axis of a finished map.

    Attributes:
        name: name of the quantity, with aliases replaced.
        label: text for a figure.
        unit: unit of the values.
        log: True if a figure draws the axis on a logarithmic scale.
        values: the k values along the axis (k,) [unit].
    """

    name: str
    label: str
    unit: str
    log: bool
    values: np.ndarray

    def to_dict(self) -> dict[str, Any]:
        """Convert the axis to plain types for JSON.

        Returns:
            Fields of the axis, with the values as a list.
        """
        return vars(self) | {"values": self.values.tolist()}

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Line:
        """Build an axis from the content of a JSON file.

        Args:
            content: a dict as returned by `to_dict`.

        Returns:
            The axis.
        """
        return cls(**content | {"values": np.asarray(content["values"], dtype=np.float64)})


def axis_of(axis: Any) -> Axis:
    """Axis from a user's description: an Axis, a text for Axis.parse, or (name, low, high)."""
    if isinstance(axis, Axis):
        return axis
    items = items_of(axis) or ()
    if len(items) == 3:
        return Axis(*items)
    return Axis.parse(axis)


class StabilityGrid:
    """Every cell of a map of two axes, with several starts in each.

    Members are numbered (y, x, direction); the direction changes fastest. The first direction is the scene's own start;
    the others are turned at random. The scene's [ensemble] is ignored.

    points: number of cells (nx, ny).
    base: the scene's start as one member.
    rate: angular rate of the fastest motion at the scene's start [rad/s].
    step: the step if no axis varies it; by default run.step of the scene [s].
    shape: (ny, nx, directions).
    state: position, attitude, velocity and angular velocity of every member (n, ...).
    varied: name -> values of the parameters that differ between members (n, ...).
    direction: name -> unit vectors (n, 3) of velocity and angular velocity, body axes.
    h: step of every member (n,) [s].
    """

    def __init__(
        self, scene: Scene, x: Any, y: Any, points: Sequence[int], directions: int, seed: int, h: float | None
    ):
        faults = Faults()
        axes = []
        for description in (x, y):
            with faults.including():
                axes.append(axis_of(description))
        for name, counts in (("points", points), ("directions", (directions,))):
            if any(isinstance(k, bool) or not isinstance(k, int) or k < 1 for k in counts):
                faults.add(name, counts, "is not a whole number above 0", "give how many")
        if len(points) != 2:
            faults.add("points", points, "are not two numbers", "give how many along each axis")
        if not faults and (members := points[0] * points[1] * directions) > MOST_MEMBERS:
            problem = f"make {members:,} members, more than {MOST_MEMBERS:,}"
            faults.add("points", points, problem, "give fewer points or directions")
        faults.raise_if_any()
        self.scene = _prepared(scene, [axis.key for axis in axes])
        self.base = Ensemble(self.scene, 1).select(0, 1)
        self.rate = self._rate()
        self.x, self.y = (self._ranged(faults, axis) for axis in axes)
        if self.x.key == self.y.key:
            faults.add("x, y", self.x.name, "is on both axes", "give two different names")
        self.step = self.scene.run.step if h is None else faults.positive("h", h)
        if "h" not in (self.x.key, self.y.key) and self.step is None and not faults:
            faults.add("h", h, "is missing, and is on no axis", "give h=0.01 or [run] step")
        faults.raise_if_any()
        self.shape = (points[1], points[0], directions)
        self._values = self.y.values(points[1]), self.x.values(points[0])
        self._build(np.random.default_rng(seed))

    def _rate(self) -> float:
        """Largest rate of spin, Munk and restoring oscillation at the scene's start [rad/s]; 1 if all are zero."""
        m = self.base
        rates = member_rates.rates(m.parameters, m.velocity, m.angular_velocity)
        return float(max(rates[name][0] for name in ("rotation", "munk", "restoring"))) or 1.0

    def _ranged(self, faults: Faults, axis: Axis) -> Axis:
        """Complete the range of an axis; add errors in it to the faults."""
        known = [*SPECIAL, *self.base.parameters]
        if axis.key not in known:
            faults.add("axis", axis.name, "is not a parameter of the scene", closest(axis.name, known))
            return axis
        low, high = self._default(axis)
        low, high = low if axis.low is None else axis.low, high if axis.high is None else axis.high
        for value in (low, high):
            positive = axis.log or axis.key in SPECIAL
            number = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
            if not number or not math.isfinite(value) or (positive and value <= 0.0):
                faults.add(f"axis {axis.name}", value, "is not a finite number" + " above 0" * positive,
                           f"give a range: {FORM}")  # fmt: skip
                return replace(axis, low=1.0, high=2.0)
        if not low < high:
            faults.add(f"axis {axis.name}", [low, high], "does not rise", "give the lower end first")
        shared = self.base.parameters.get(axis.key)
        if axis.scaled is False and shared is not None and shared[0].ndim:
            faults.add(f"axis {axis.name}", axis.name, f"has shape {shared[0].shape} and cannot be set to one number",
                       "leave out :set, so that it is multiplied")  # fmt: skip
        if axis.key == "drag_number" and not np.any(self._drag_rate()):
            faults.add("axis", axis.name, "scales drag, which is zero at the scene's start",
                       "give a start with velocity, or a linear coefficient")  # fmt: skip
        return replace(axis, low=float(low), high=float(high))

    def _default(self, axis: Axis) -> tuple[Any, Any]:
        """Default range of an axis, derived from the scene."""
        w, m = self.rate, self.base
        speed = float(np.linalg.norm(m.velocity)) or 1.0
        known = {
            "h": (0.01 / w, 4.0 / w),
            "angular_velocity": (0.1 * w, 10.0 * w),
            "speed": (0.1 * speed, 10.0 * speed),
            "added_mass_ratio": (0.01, 100.0),
            "drag_number": (0.01 * w, 100.0 * w),
        }
        if axis.key in known:
            return known[axis.key]
        if self.scaled(axis) or m.parameters[axis.key][0].ndim:
            return 0.1, 10.0
        value = float(m.parameters[axis.key][0])
        return (0.1 * value, 10.0 * value) if value > 0.0 else (None, None)

    def scaled(self, axis: Axis) -> bool:
        """True if a parameter is multiplied by the values of an axis."""
        if axis.key in SPECIAL:
            return False
        return bool(self.base.parameters[axis.key][0].ndim) if axis.scaled is None else axis.scaled

    def line(self, axis: Axis, values: np.ndarray) -> Line:
        """Convert an axis and its values to an axis of a finished map."""
        if axis.key in SPECIAL:
            unit, label = SPECIAL[axis.key]
        elif self.scaled(axis):
            unit, label = "1", f"{axis.key} / the scene's"
        else:
            unit, label = ENVIRONMENT.get(axis.key) or parameter_units(self.scene)[axis.key], axis.key
        return Line(axis.key, label, unit, axis.log, values)

    @property
    def lines(self) -> tuple[Line, Line]:
        """Both axes of the finished map, x and y."""
        return self.line(self.x, self._values[1]), self.line(self.y, self._values[0])

    def _drag_rate(self) -> np.ndarray:
        m = self.base
        return member_rates.drag_rate(m.parameters, vehicle.inertia6(m.parameters), m.velocity, m.angular_velocity)

    def _build(self, rng: np.random.Generator) -> None:
        """Compute the state, the step and the parameters of every member."""
        n, d = math.prod(self.shape), self.shape[2]
        self.state = {name: np.repeat(getattr(self.base, name), n, axis=0) for name in FIELDS}
        self.varied: dict[str, np.ndarray] = {}
        self.direction: dict[str, np.ndarray] = {}
        for name in ("velocity", "angular_velocity"):
            start = getattr(self.base, name)[0]
            size = np.linalg.norm(start)
            # A vector of zero length gets a direction off the body's axes, for an axis that sets its size.
            unit = start / size if size > 0.0 else np.full(3, 3.0**-0.5)
            turns = notation.matrix_from_rotation_vector(rotation_vectors(rng, d))
            self.direction[name] = np.tile(turns @ unit, (n // d, 1))
            self.state[name] = size * self.direction[name]
        self.h = np.full(n, self.step or 0.0)
        cells = np.meshgrid(*self._values, np.zeros(d), indexing="ij")
        # Masses first: drag rates depend on them.
        axes = zip((self.y, self.x), cells[:2], strict=True)
        for axis, values in sorted(axes, key=lambda pair: pair[0].key in SPECIAL):
            self._apply(axis, values.ravel())

    def _apply(self, axis: Axis, values: np.ndarray) -> None:
        key = axis.key
        if key == "h":
            self.h = values
        elif key in ("angular_velocity", "speed"):
            name = "velocity" if key == "speed" else key
            self.state[name] = values[:, None] * self.direction[name]
        elif key == "added_mass_ratio":
            self._apply_added_mass(values)
        elif key == "drag_number":
            rate = self._drag_rate()
            for term in member_rates.drag_keys(self.base.parameters):
                for kind in ("linear", "quadratic"):
                    self._scale(f"{term}.{kind}", values / rate)
        elif self.scaled(axis):
            self._scale(key, values)
        else:
            self.varied[key] = values

    def _scale(self, key: str, factors: np.ndarray) -> None:
        base = self.varied.get(key, self.base.parameters[key])
        self.varied[key] = factors.reshape(-1, *(1,) * (base.ndim - 1)) * base

    def _apply_added_mass(self, values: np.ndarray) -> None:
        p = self.base.parameters
        full = "vehicle.added_mass_matrix" in p
        key = "vehicle.added_mass_matrix" if full else "vehicle.added_mass"
        largest = np.linalg.eigvalsh(p[key][:, :3, :3])[:, -1]
        mass = self.varied.get("vehicle.mass", vehicle.dry_mass(p))
        if largest[0] > 0.0:
            self._scale(key, values * mass / largest)
        else:
            # A vehicle without added mass gets that of a slender body: none along x.
            size = 6 if full else 3
            self.varied[key] = (values * mass)[:, None, None] * np.diag(([0.0, 1.0, 1.0, 0.0, 0.0, 0.0])[:size])

    def parameters(self, members: np.ndarray) -> dict[str, np.ndarray]:
        """All parameters of some members: name -> values with leading dimension k, or 1 if all members share them."""
        return {name: self.varied[name][members] if name in self.varied else value
                for name, value in self.base.parameters.items()}  # fmt: skip

    def fleet(self, members: np.ndarray) -> Ensemble:
        """Build an ensemble of some members."""
        b, R, nu, Om = (self.state[name][members] for name in FIELDS)
        varied = {name: value[members] for name, value in self.varied.items()}
        return Ensemble.from_states(self.scene, b, R, nu, Om, varied)

    def rates(self) -> dict[str, np.ndarray]:
        """Rates of every member at its start: names of accuracy.stability.limits.LIMITS -> rate (n,) [rad/s or 1/s]."""
        every = np.arange(len(self.h))
        return member_rates.rates(self.parameters(every), self.state["velocity"], self.state["angular_velocity"])

    def columns(self) -> list[tuple[float, np.ndarray]]:
        """List each step [s], the shortest first, and the indices of the members that use it."""
        steps, step_index = np.unique(self.h, return_inverse=True)
        return [(float(h), np.flatnonzero(step_index == i)) for i, h in enumerate(steps)]


def rotation_vectors(rng: np.random.Generator, n: int) -> np.ndarray:
    """Rotation vectors of uniformly random attitudes (n, 3) [rad]; the first is zero."""
    q = rng.normal(size=(n, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(np.linalg.norm(q[:, 1:], axis=1), q[:, 0])
    vectors = q[:, 1:] / np.linalg.norm(q[:, 1:], axis=1, keepdims=True) * angle[:, None]
    vectors[0] = 0.0
    return vectors


def _prepared(scene: Scene, names: Sequence[str]) -> Scene:
    """The scene without its ensemble. If the map varies drag and the scene has none, drag on every axis is added."""
    terms = list(scene.terms)
    parameters = {key: np.asarray(value)[None] for key, value in scene.parameters().items()}
    if "drag_number" in names and not member_rates.drag_keys(parameters):
        terms.append(Drag(linear=np.diag(vehicle.inertia6(parameters)[0])))
    return replace(scene, ensemble_settings=None, terms=terms)
