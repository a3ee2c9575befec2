"""A scene: one vehicle, its environment, the terms that act and the state it starts from."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from lgvi_warp import events, laws, notation, terms
from lgvi_warp import statistics as kinds
from lgvi_warp.errors import Faults, SceneError
from lgvi_warp.machine import DTYPES
from lgvi_warp.method import Method
from lgvi_warp.names import alike, folded
from lgvi_warp.real_numbers import holds_words
from lgvi_warp.sampling import sampling_of
from lgvi_warp.statistics import until as stopping
from lgvi_warp.status import CHECKS, ON_FAILURE
from lgvi_warp.vehicle import Vehicle

ATTITUDES = ("attitude", "rotation_vector", "quaternion_wxyz", "euler_deg")
VELOCITIES = ("velocity", "velocity_inertial")
SHAPES = {
    "position": (3,),
    "attitude": (3, 3),
    "rotation_vector": (3,),
    "quaternion_wxyz": (4,),
    "euler_deg": (3,),
    "velocity": (3,),
    "velocity_inertial": (3,),
    "angular_velocity": (3,),
}
UNITS = {"position": "m", "rotation_vector": "rad", "euler_deg": "deg", "velocity": "m/s", "velocity_inertial": "m/s",
         "angular_velocity": "rad/s"}  # fmt: skip
# Of one ensemble, whatever its sampling: a kernel keys a member's noise by its index in a signed word of 32 bits.
MOST_MEMBERS = 2**31


@dataclass(frozen=True)
class Environment:
    """gravity [m/s2] (may be 0), water_density [kg/m3]. Raises SceneError for what is negative or not finite."""

    gravity: float = 9.80665
    water_density: float = 1025.0

    def __post_init__(self) -> None:
        faults = Faults("environment.")
        faults.number("gravity", self.gravity, "m/s2", least=0.0)
        faults.positive("water_density", self.water_density, "kg/m3")
        faults.raise_if_any()

    def to_dict(self) -> dict[str, float]:
        """As in a scene file."""
        return {"gravity": float(self.gravity), "water_density": float(self.water_density)}


@dataclass(frozen=True, eq=False)
class Start:
    """The state at t = 0. What is left out is zero, or no rotation.

    position (3,) [m], inertial (north, east, down). Attitude, body to inertial, in one of four ways: attitude (3, 3),
    rotation_vector (3,) [rad], quaternion_wxyz (4,) (any length), euler_deg (roll, pitch, yaw) [deg]. Velocity in one
    of two: velocity (3,) [m/s, body axes] or velocity_inertial (3,) [m/s]. angular_velocity (3,) [rad/s, body axes].

    Raises SceneError naming every fault.
    """

    position: Any = None
    attitude: Any = None
    rotation_vector: Any = None
    quaternion_wxyz: Any = None
    euler_deg: Any = None
    velocity: Any = None
    velocity_inertial: Any = None
    angular_velocity: Any = None

    def __post_init__(self) -> None:
        faults = Faults("start.")
        for names in (ATTITUDES, VELOCITIES):
            given = [name for name in names if getattr(self, name) is not None]
            if len(given) > 1:
                faults.add(" and ".join(given), "...", "say the same thing twice", "keep one of them")
        for name, shape in SHAPES.items():
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, faults.finite(name, value, shape, UNITS.get(name, "")))
        self._check_attitude(faults)
        faults.raise_if_any()

    def _check_attitude(self, faults: Faults) -> None:
        R, q = self.attitude, self.quaternion_wxyz
        if R is not None and not notation.rotations(R):
            faults.add(
                "attitude",
                R,
                "is not a rotation (R^T R = I, det R = 1, to 1e-9)",
                "give more digits, or quaternion_wxyz",
            )
        if q is not None and not np.any(q):
            faults.add("quaternion_wxyz", q, "is zero", "give a quaternion that is not")

    def given(self) -> dict[str, np.ndarray]:
        """What the user gave, and zeros for the rest: position, one attitude, one velocity, angular_velocity."""
        chosen = {name: getattr(self, name) for name in SHAPES if getattr(self, name) is not None}
        for names in (("position",), ATTITUDES[1:], VELOCITIES, ("angular_velocity",)):
            alternatives = ATTITUDES if names == ATTITUDES[1:] else names
            if not any(name in chosen for name in alternatives):
                chosen[names[0]] = np.zeros(SHAPES[names[0]])
        return chosen

    def to_dict(self) -> dict[str, Any]:
        """As in a scene file: what was given."""
        return {name: getattr(self, name).tolist() for name in SHAPES if getattr(self, name) is not None}


def resolve_attitude(values: Mapping[str, np.ndarray]) -> np.ndarray:
    """R (n, 3, 3), body to inertial, from whichever way the attitude was given, each (n, ...)."""
    if "attitude" in values:
        return np.asarray(values["attitude"])
    if "quaternion_wxyz" in values:
        return notation.matrix_from_quaternion(values["quaternion_wxyz"])
    if "euler_deg" in values:
        return notation.matrix_from_euler_deg(values["euler_deg"])
    return notation.matrix_from_rotation_vector(values["rotation_vector"])


KEEP = ("all", "none", "failed")


def check_keep(faults: Faults, key: str, keep: Any, members: int | None = None) -> None:
    """Which members' samples to keep: all, none, those that failed (not those that an event stopped), or some by index."""
    if isinstance(keep, str):
        faults.choice(key, keep, KEEP)
        return
    indices = np.asarray(keep) if isinstance(keep, list | tuple | np.ndarray | range) else np.array(None)
    whole = indices.ndim == 1 and indices.size > 0 and indices.dtype.kind in "iu" and not np.ma.is_masked(keep)
    if not whole or np.any(indices < 0):
        faults.add(key, keep, "names no members", f"give {', '.join(map(repr, KEEP))}, or a list of indices from 0")
    elif members is not None and np.any(indices >= members):
        faults.add(
            key, int(indices.max()), f"is beyond the last of {members} members", f"give indices up to {members - 1}"
        )


@dataclass(frozen=True)
class RunSettings:
    """The [run] section of a scene file: method, step [s], duration [s], save_every [s], dtype. Raises SceneError.

    solver, iterations, tolerance, rtol, atol: of the method, as in Method. checks, on_failure: as in solve.
    statistics: tables as in [[run.statistics]] or Statistic objects; keep: "all" samples of members, "none", "failed", or
    indices of members; until: a table as in [run.until], or an Until.
    """

    method: str = "psi_s"
    step: float | None = None
    duration: float | None = None
    save_every: float | None = None
    dtype: str = "float64"
    solver: str | None = None
    iterations: int | str | None = None
    tolerance: float | None = None
    rtol: float | None = None
    atol: float | None = None
    checks: str = "safe"
    on_failure: str = "freeze"
    keep: Any = "all"
    statistics: Sequence[Any] = ()
    until: Any = None

    def __post_init__(self) -> None:
        faults = Faults("run.")
        check_keep(faults, "keep", self.keep)
        with faults.including():
            object.__setattr__(self, "statistics", kinds.from_list(self.statistics, "run.statistics"))
        if self.until is not None:
            with faults.including():
                object.__setattr__(self, "until", stopping.from_dict(self.until))
        for name in ("step", "duration", "save_every"):
            if getattr(self, name) is not None:
                faults.positive(name, getattr(self, name))
        faults.choice("dtype", self.dtype, DTYPES)
        faults.choice("checks", self.checks, CHECKS)
        faults.choice("on_failure", self.on_failure, ON_FAILURE)
        if not isinstance(self.method, str):
            faults.add("method", self.method, "is not a text", 'give the name of a method, such as "psi_s"')
        else:
            with faults.including():
                try:
                    self.method_of(self.method)
                except SceneError as error:
                    raise error.prefixed("run.") from None
        faults.raise_if_any()

    def method_of(self, name: str | None = None) -> Method:
        """The method of this section; of another name, without what this section says of its own. Raises SceneError."""
        if name is not None and name != self.method:
            return Method(name)
        given = {key: getattr(self, key) for key in ("solver", "iterations", "tolerance", "rtol", "atol")}
        return Method(self.method, **{key: value for key, value in given.items() if value is not None})

    def to_dict(self) -> dict[str, Any]:
        """As in a scene file: what is not left to the default, and the method and dtype."""
        kept = {"method", "dtype"}
        for one in fields(self):
            value = getattr(self, one.name)
            if not isinstance(value, type(one.default)) or value != one.default:
                kept.add(one.name)
        content = {key: value for key, value in vars(self).items() if key in kept}
        if "statistics" in content:
            content["statistics"] = [one.to_dict() for one in self.statistics]
        if "until" in content:
            content["until"] = self.until.to_dict()
        return content


@dataclass(frozen=True)
class EnsembleSettings:
    """The [ensemble] section: members, seed, what varies (name -> distribution), how it is sampled (sampling/).

    members: None for as many as the sampling has, or one. indices: which of them to run, all by default.
    Raises SceneError.
    """

    members: int | None = None
    seed: int = 0
    vary: Mapping[str, Any] = field(default_factory=dict)
    sampling: Any = "random"
    indices: Any = None

    def __post_init__(self) -> None:
        faults = Faults("ensemble.")
        for name, least in (("members", 1), ("seed", 0)):
            value = getattr(self, name)
            if name == "members" and value is None:
                continue
            if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
                faults.add(name, value, f"is not a whole number from {least}", f"give {least} or more")
            elif name == "members" and value > MOST_MEMBERS:
                what = f"are more members than the {MOST_MEMBERS} that there can be"
                faults.add(name, value, what, f"give {MOST_MEMBERS} or less")
        if self.indices is not None and not _whole_numbers(self.indices):
            faults.add("indices", self.indices, "is no list of whole numbers from 0", "give members: indices = [17]")
        if isinstance(self.vary, Mapping):
            named = {", ".join(key) if isinstance(key, tuple) else key: law for key, law in self.vary.items()}
            for key, law in named.items():
                with faults.including():
                    named[key] = laws.as_law(f'vary."{key}"', law)
            object.__setattr__(self, "vary", named)
        with faults.including():
            object.__setattr__(self, "sampling", sampling_of(self.sampling))
        faults.raise_if_any()

    def to_dict(self) -> dict[str, Any]:
        """As in a scene file."""
        content: dict[str, Any] = {} if self.members is None else {"members": int(self.members)}
        content["seed"] = int(self.seed)
        if self.vary:
            content["vary"] = {name: distribution.to_dict() for name, distribution in self.vary.items()}
        if self.sampling.kind != "random":
            content["sampling"] = self.sampling.to_dict()
        return content | ({} if self.indices is None else {"indices": np.asarray(self.indices).tolist()})


def _whole_numbers(value: Any) -> bool:
    """Whether it is a list of one or more whole numbers from 0."""
    try:
        if holds_words(value):
            return False
        array = np.asarray(value)
    except ValueError:
        return False
    plain = not np.ma.is_masked(value)
    return bool(array.ndim == 1 and len(array) > 0 and array.dtype.kind in "iu" and plain and array.min() >= 0)


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything that one simulated vehicle needs. Weight, buoyancy and restoring moment follow from the vehicle.

    terms: what else acts, such as lw.Drag(...), or tables as in a scene file. events: what stops a member, such as
    lw.Surface(). controller: this version knows none, and says so. run, ensemble_settings: what a scene file holds
    besides. Raises SceneError naming every fault.
    """

    vehicle: Vehicle
    environment: Environment = field(default_factory=Environment)
    terms: Sequence[Any] = ()
    start: Start = field(default_factory=Start)
    controller: Any = None
    run: RunSettings = field(default_factory=RunSettings)
    ensemble_settings: EnsembleSettings | None = None
    events: Sequence[Any] = ()

    def __post_init__(self) -> None:
        faults = Faults()
        with faults.including():
            object.__setattr__(self, "terms", terms.from_list(self.terms))
        with faults.including():
            object.__setattr__(self, "events", events.from_list(self.events))
        if not faults:
            self._check_names(faults)
        if self.controller is not None:
            remedy = "leave it out; a held or scheduled wrench and thrusters' commands are terms"
            faults.add("controller", self.controller, "is not known to this version", remedy)
        for name, kind in (("vehicle", Vehicle), ("environment", Environment), ("start", Start), ("run", RunSettings)):
            if not isinstance(getattr(self, name), kind):
                faults.add(name, getattr(self, name), f"is no {kind.__name__}", f"give lw.{kind.__name__}(...)")
        faults.raise_if_any()

    def _check_names(self, faults: Faults) -> None:
        """Terms and events have different names, on every file system."""
        keys = [one.key for one in (*self.terms, *self.events)]
        counts = Counter(keys)
        for key in sorted({one.key for one in self.events}):
            if folded(key) in terms.RESERVED:
                faults.add("events", key, "is the name of a section of the scene", f'write name = "{key}_event"')
            elif counts[key] > 1:
                faults.add("events", key, "is the name of two events or of a term too",
                           f'give each a name of its own: name = "{key}_2"')  # fmt: skip
        for first, other in alike(keys):
            what = f"is the same folder as {first!r} on file systems that do not tell capitals apart"
            faults.add("terms and events", other, what, f'give each a name of its own: name = "{other}_2"')

    def parameters(self) -> dict[str, np.ndarray]:
        """Every number that may vary by member, by name: "vehicle.mass", "drag.quadratic", ..., as this scene has it."""
        values = {f"vehicle.{name}": value for name, value in self.vehicle.parameters().items()}
        values["environment.gravity"] = np.asarray(float(self.environment.gravity))
        values["environment.water_density"] = np.asarray(float(self.environment.water_density))
        for one in (*self.terms, *self.events):
            values |= {f"{one.key}.{name}": value for name, value in one.parameters().items()}
        return values

    @classmethod
    def load(cls, path: str | os.PathLike[str], overrides: Mapping[str, Any] | None = None) -> Scene:
        """Read a scene file (TOML). overrides: dotted key -> value, replacing what the file says. Raises SceneError."""
        from lgvi_warp import scenefile

        return scenefile.load(path, overrides)

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Scene:
        """A scene from tables in the form of a scene file, such as the importers return. Raises SceneError."""
        from lgvi_warp import scenefile

        return scenefile.from_dict(content)

    @classmethod
    def named(cls, name: str, **sections: Any) -> Scene:
        """A scene of a vehicle that comes with the package (`lw.vehicles()` lists them), with its own terms and water.

        sections: as in a scene file; vehicle={...} and environment={...} replace single keys, a term in terms=[...]
        replaces the vehicle's of the same name or type or is added; start={...}, run={...}, events=[...].
        Raises SceneError naming every fault.
        """
        from lgvi_warp import scenefile

        return scenefile.from_dict({**sections, "vehicle": {**sections.get("vehicle", {}), "name": name}})

    def to_dict(self) -> dict[str, Any]:
        """In the shape of a scene file."""
        content: dict[str, Any] = {
            "vehicle": self.vehicle.to_dict(),
            "environment": self.environment.to_dict(),
            "start": self.start.to_dict(),
            "run": self.run.to_dict(),
        }
        if self.terms:
            content["terms"] = [term.to_dict() for term in self.terms]
        if self.events:
            content["events"] = [event.to_dict() for event in self.events]
        return content | ({"ensemble": self.ensemble_settings.to_dict()} if self.ensemble_settings else {})
