"""What varies from member to member, and the members' numbers, block by block."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp import scene as scenes
from lgvi_warp import vehicle as vehicles
from lgvi_warp.distributions import Distribution, uniforms
from lgvi_warp.errors import Faults, closest
from lgvi_warp.scene import Scene

# Parameters that are symmetric matrices, and stay so when they vary.
MATRICES = tuple(f"vehicle.{name}" for name in vehicles.SYMMETRIC)
STATES = ("position", "attitude", "velocity", "angular_velocity")


@dataclass(frozen=True, eq=False)
class Members:
    """A run of m members. Parameters have a leading dimension of 1 (shared) or m (varied), in the scene's names.

    position (m, 3) [m], attitude (m, 3, 3) body to inertial, velocity (m, 3) [m/s], angular_velocity (m, 3) [rad/s].
    indices (m,): which members they are, and seed: what their random numbers are keyed by, in a subset as in the whole.
    """

    parameters: dict[str, np.ndarray]
    position: np.ndarray
    attitude: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    indices: np.ndarray
    seed: int

    @property
    def count(self) -> int:
        """m."""
        return len(self.position)


class Ensemble:
    """A scene and what varies in it.

    scene: the Scene. members: how many, >= 1. seed: whole number >= 0. vary: name -> distribution; names are every number
    that the scene has: "vehicle.mass", "drag.quadratic", "current.velocity" (a term's name or type, and its field), ...
    (`scene.parameters()` lists them), and what the scene's start gives ("start.position", "start.angular_velocity", ...).
    One law varies every entry; of a symmetric matrix, the entries on and above the diagonal (of a diagonal one, those on
    it). A draw depends on the seed, the member's index and the name only.

    Raises SceneError naming every fault; members that would be unphysical are counted and the first is shown.
    """

    def __init__(self, scene: Scene, members: int = 1, seed: int = 0, vary: Mapping[str, Distribution] | None = None):
        faults = Faults()
        if not isinstance(scene, Scene):
            faults.add("scene", scene, "is no Scene", "give lw.Scene(...) or lw.Scene.load(path)")
        if vary is not None and not (isinstance(vary, Mapping) and all(isinstance(name, str) for name in vary)):
            faults.add("vary", vary, "does not map names to distributions", 'give {"vehicle.mass": lw.Normal(...)}')
        faults.raise_if_any()
        settings = scenes.EnsembleSettings(members, seed, dict(vary or {}))
        self._setup(scene, settings, {})

    @classmethod
    def from_scene(cls, scene: Scene) -> Ensemble:
        """The ensemble that the scene file describes; one member if it describes none."""
        settings = scene.ensemble_settings or scenes.EnsembleSettings()
        return cls(scene, settings.members, settings.seed, settings.vary)

    @classmethod
    def from_states(
        cls,
        scene: Scene,
        position: Any,
        attitude: Any,
        velocity: Any,
        angular_velocity: Any,
        parameters: Mapping[str, Any] | None = None,
    ) -> Ensemble:
        """Members with given states: (n, 3) [m], (n, 3, 3) body to inertial, (n, 3) [m/s, body], (n, 3) [rad/s, body].

        parameters: name -> array of length n ("vehicle.inertia": (n, 3) or (n, 3, 3)), names as in `vary`. States that
        are not finite are let through: the run gives such a member its status. Raises SceneError for wrong shapes and
        unphysical values.
        """
        faults = Faults()
        states = dict(zip(STATES, (position, attitude, velocity, angular_velocity), strict=True))
        explicit = {f"start.{key}": _floats(faults, key, value) for key, value in states.items()}
        faults.raise_if_any()
        n = len(explicit["start.position"]) if explicit["start.position"].ndim else 0
        if n == 0:
            faults.add("position", position, "holds no member", "give arrays of length 1 or more")
        for key, value in explicit.items():
            shape = (n, 3, 3) if key == "start.attitude" else (n, 3)
            if value.shape != shape:
                faults.add(key, value, f"has shape {value.shape}", f"give an array of shape {shape}")
        base = scene.parameters()
        faults.keys("", parameters or {}, base)
        faults.raise_if_any()
        R = explicit["start.attitude"]
        bad = np.isfinite(R).all(axis=(1, 2)) & ~scenes.rotations(R)
        if bad.any():
            what = f"is not a rotation to 1e-9 ({bad.sum()} of {n} members)"
            faults.add(f"attitude of member {bad.argmax()}", R[bad.argmax()], what, "give R^T R = I, det R = 1")
        for key, value in (parameters or {}).items():
            explicit[key] = _explicit_parameter(faults, key, value, (n, *base[key].shape))
        faults.raise_if_any()
        ensemble = cls.__new__(cls)
        ensemble._setup(scene, scenes.EnsembleSettings(n), explicit)
        return ensemble

    def _setup(self, scene: Scene, settings: scenes.EnsembleSettings, explicit: dict[str, np.ndarray]) -> None:
        self.scene, self.members, self.seed = scene, int(settings.members), int(settings.seed)
        self.vary: dict[str, Distribution] = dict(settings.vary)
        self._settings, self._explicit = settings, explicit
        self._start = {f"start.{key}": value for key, value in scene.start.given().items()}
        if explicit:
            self._start = {key: value for key, value in explicit.items() if key.startswith("start.")}
        self._base = scene.parameters()
        self.indices = np.arange(self.members)
        self._check_names()
        self._check_physical()

    def _check_names(self) -> None:
        faults = Faults("ensemble.vary.")
        known = [*self._base, *self._start]
        for name, law in self.vary.items():
            if name not in known:
                others = [key for key in known if key.split(".")[0] == name.split(".")[0]]
                hint = f"the scene gives {', '.join(others)}" if name[6:] in scenes.SHAPES else closest(name, known)
                faults.add(f'"{name}"', law, "does not name what the scene has", hint)
            elif not isinstance(law, Distribution):
                faults.add(f'"{name}"', law, "is not a distribution", "give lw.Normal(std=...) or another")
            elif name == "start.attitude":
                faults.add(f'"{name}"', law, "cannot vary by entry", "give rotation_vector or euler_deg and vary it")
            else:
                self._check_shape(faults, name, law)
        faults.raise_if_any()

    def _check_shape(self, faults: Faults, name: str, law: Distribution) -> None:
        shape = self._drawn_base(name).shape
        try:
            good = np.broadcast_shapes(shape, *(np.shape(number) for number in law.numbers())) == shape
        except ValueError:
            good = False
        if not good:
            wanted = f"one number or {' x '.join(map(str, shape))}, one per component" if shape else "one number"
            faults.add(f'"{name}"', law, f"does not fit a quantity of shape {shape}", f"give {wanted}")

    def _check_physical(self) -> None:
        varied = {name for name in (*self.vary, *self._explicit) if name in self._base}
        if not varied:
            return
        faults = Faults()
        with np.errstate(over="ignore", invalid="ignore"):
            p = self.parameters(0, self.members)
            checks = _vehicle_checks(p, varied)
            for one in (*self.scene.terms, *self.scene.events):
                own = self.own(one, p)
                if any(f"{one.key}.{name}" in varied for name in own):
                    checks |= {f"{one.key}.{name}": bad for name, bad in one.unphysical(own).items()}
        for key, bad in checks.items():
            if np.any(bad):
                self._note_unphysical(faults, key, np.broadcast_to(bad, max(len(bad), 1)), p)
        faults.raise_if_any()

    def _note_unphysical(self, faults: Faults, key: str, bad: np.ndarray, p: dict[str, np.ndarray]) -> None:
        first = int(np.argmax(bad))
        value = sum(
            p[name][first % len(p[name])] for name in key.split(" + ") if p[name].ndim == p[key.split(" + ")[-1]].ndim
        )
        drawn = any(name in self.vary for name in key.split(" + "))
        remedy = "use a smaller spread, TruncatedNormal or LogNormal" if drawn else "give finite, physical values"
        what = f"is unphysical ({int(bad.sum())} of {len(bad)} members)"
        faults.add(f"{key} of member {first}", value, what, remedy)

    @staticmethod
    def own(term: Any, parameters: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """A term's own numbers, by field, out of all parameters."""
        return {name: parameters[f"{term.key}.{name}"] for name in term.parameters()}

    def _drawn_base(self, name: str) -> np.ndarray:
        """The scene's value of a quantity that is drawn: of a symmetric matrix, its upper triangle or its diagonal."""
        base = np.asarray(self._start[name] if name in self._start else self._base[name])
        if name not in MATRICES:
            return base
        return np.diag(base) if _diagonal(base) else base[np.triu_indices(len(base))]

    def _value(self, name: str, first: int, stop: int) -> np.ndarray:
        """Values of the members first to stop, or of all as one: a leading dimension of stop - first, or of 1."""
        if name in self._explicit:
            return self._explicit[name][first:stop]
        whole = np.asarray(self._start[name] if name in self._start else self._base[name])
        if name not in self.vary:
            return whole[None]
        base = self._drawn_base(name)
        u = uniforms(self.seed, name, first, stop - first, max(1, base.size)).reshape(stop - first, *base.shape)
        drawn = self.vary[name].quantile(u, base)
        return _matrices(drawn, _diagonal(whole), len(whole)) if name in MATRICES else drawn

    def parameters(self, first: int, stop: int) -> dict[str, np.ndarray]:
        """Parameters of the members first to stop, shared ones with a leading dimension of 1."""
        return {name: self._value(name, first, stop) for name in self._base}

    def select(self, first: int, stop: int) -> Members:
        """The numbers of the members first to stop (not included). Raises IndexError where there are none."""
        if not 0 <= first < stop <= self.members:
            raise IndexError(f"members {first} to {stop} of {self.members}")
        m = stop - first
        start = {key.removeprefix("start."): self._value(key, first, stop) for key in self._start}
        R = np.broadcast_to(scenes.resolve_attitude(start), (m, 3, 3))
        if "velocity_inertial" in start:
            # Written out: the sum's order, and so the bits, must not depend on how many members are asked for.
            v = start["velocity_inertial"]
            nu = R[:, 0] * v[:, :1] + R[:, 1] * v[:, 1:2] + R[:, 2] * v[:, 2:]
        else:
            nu = start["velocity"]
        position, nu, Om = (np.broadcast_to(x, (m, 3)) for x in (start["position"], nu, start["angular_velocity"]))
        return Members(self.parameters(first, stop), position, R, nu, Om, self.indices[first:stop], self.seed)

    def varied(self) -> list[str]:
        """Names of the parameters that have a number for each member."""
        return [name for name in self._base if name in self.vary or name in self._explicit]

    def subset(self, indices: Sequence[int]) -> Ensemble:
        """These members, in this order, as an ensemble of its own with the same numbers."""
        chosen = [self.select(int(i), int(i) + 1) for i in indices]
        b, R, nu, Om = (np.concatenate([getattr(one, name) for one in chosen]) for name in STATES)
        parameters = {name: np.concatenate([one.parameters[name] for one in chosen]) for name in self.varied()}
        ensemble = Ensemble.from_states(self.scene, b, R, nu, Om, parameters)
        ensemble.indices, ensemble.seed = self.indices[np.asarray(indices, dtype=int)], self.seed
        return ensemble

    def explicit(self) -> dict[str, np.ndarray]:
        """States and parameters that were given as arrays, by name, (n, ...); empty for an ensemble that is drawn."""
        return dict(self._explicit)

    def to_dict(self) -> dict[str, Any]:
        """members, seed and vary as in a scene file, and the names that were given as arrays."""
        return self._settings.to_dict() | ({"explicit": sorted(self._explicit)} if self._explicit else {})


def _vehicle_checks(p: Mapping[str, np.ndarray], varied: set[str]) -> dict[str, np.ndarray]:
    """Name -> (n,), which members' numbers of vehicle and environment are unphysical."""
    checks: dict[str, np.ndarray] = {}
    if "vehicle.mass" in p:
        mass = p["vehicle.mass"][:, None, None] * np.eye(3) + p["vehicle.added_mass"]
        heavy = np.isfinite(p["vehicle.mass"]) & (p["vehicle.mass"] > 0.0)
        checks |= {
            "vehicle.mass": ~heavy,
            "vehicle.inertia": ~_positive_definite(p["vehicle.inertia"]),
            "vehicle.mass + vehicle.added_mass": heavy & ~_positive_definite(mass),
        }
    else:
        rigid, added = "vehicle.rigid_body_mass_matrix", "vehicle.added_mass_matrix"
        checks |= {rigid: ~_positive_definite(p[rigid]), f"{rigid} + {added}": ~_positive_definite(p[rigid] + p[added])}
    for key in ("vehicle.center_of_buoyancy", "vehicle.center_of_gravity"):
        if key in p:
            checks[key] = ~np.isfinite(p[key]).all(axis=1)
    for key in ("vehicle.buoyancy", "vehicle.weight", "environment.gravity"):
        if key in p:
            checks[key] = ~(np.isfinite(p[key]) & (p[key] >= 0.0))
    checks["environment.water_density"] = ~(
        np.isfinite(p["environment.water_density"]) & (p["environment.water_density"] > 0)
    )
    return {key: bad for key, bad in checks.items() if any(name in varied for name in key.split(" + "))}


def _diagonal(matrix: np.ndarray) -> bool:
    return not np.any(matrix - np.diag(np.diag(matrix)))


def _matrices(drawn: np.ndarray, diagonal: bool, size: int) -> np.ndarray:
    """Symmetric matrices (n, size, size) from their drawn diagonals or upper triangles."""
    if diagonal:
        return drawn[:, :, None] * np.eye(size)
    upper = np.zeros((len(drawn), size, size))
    rows, columns = np.triu_indices(size)
    upper[:, rows, columns] = upper[:, columns, rows] = drawn
    return upper


def _floats(faults: Faults, key: str, value: Any) -> np.ndarray:
    """A float64 copy, which may hold NaN: the caller's later writes to his array do not reach the ensemble."""
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        faults.add(key, value, "is not numeric", "give an array of numbers")
        return np.empty(0)


def check_names(vary: Mapping[str, Distribution], parameters: Sequence[str]) -> None:
    """Refuse names that a scene with these parameters has not. Raises SceneError."""
    faults = Faults("ensemble.vary.")
    known = [*parameters, *(f"start.{name}" for name in scenes.SHAPES)]
    for name, law in vary.items():
        if name not in known:
            faults.add(f'"{name}"', law, "does not name what a scene has", closest(name, known))
    faults.raise_if_any()


def _explicit_parameter(faults: Faults, key: str, value: Any, shape: tuple[int, ...]) -> np.ndarray:
    array = _floats(faults, key, value)
    if key in MATRICES and array.shape == shape[:2]:
        return array[:, :, None] * np.eye(shape[1])
    if array.shape != shape:
        also = f" or {shape[:2]}" if key in MATRICES else ""
        faults.add(key, value, f"has shape {array.shape}", f"give an array of shape {shape}{also}")
    elif key in MATRICES and np.any(np.abs(array - np.swapaxes(array, 1, 2)) > 1e-9 * np.abs(array).max()):
        faults.add(key, "...", "holds a matrix that is not symmetric", "give symmetric matrices")
    return array


def _positive_definite(matrices: np.ndarray) -> np.ndarray:
    """Which symmetric matrices (n, d, d) are positive definite; False where a number is not finite."""
    finite = np.isfinite(matrices).all(axis=(1, 2))
    safe = np.where(finite[:, None, None], matrices, np.eye(matrices.shape[-1]))
    return np.asarray(finite & (np.linalg.eigvalsh(safe)[:, 0] > 0.0))
