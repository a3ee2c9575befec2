# SPDX-License-Identifier: Apache-2.0
"""Evaluation of a single term with numbers packed as for a run, and random views, for `check_law`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import warp as wp

from lgvi_kernels.advance.examine import COLUMNS, OUT_FIELDS, make_examine
from lgvi_warp.common import warp_setup
from lgvi_warp.common.errors import SceneError, refusal
from lgvi_warp.common.machine import register_width
from lgvi_warp.common.sentences import capital
from lgvi_warp.common.warp_setup import build_lock
from lgvi_warp.engine import kernel_cache
from lgvi_warp.engine.arrays import Group, Lanes, LawArrays, put_rows
from lgvi_warp.engine.kernel_choice import declared, seeing_roles
from lgvi_warp.physics import inertia, notation, vehicle
from lgvi_warp.physics.inertia import Frame
from lgvi_warp.physics.terms.base import PackingContext, Term
from lgvi_warp.physics.vehicle import Vehicle
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.scene.start import Environment

# Length [s] and step number of the kick at which laws are evaluated, and those of another.
KICK, STEP = 0.01, 3
OTHER_KICK, OTHER_STEP = 0.37, 11
# Other body axes and another origin [m], as a method might choose them: a law must not depend on them.
TURN = notation.matrix_from_rotation_vector(np.array([0.4, -0.7, 1.2]))
ORIGIN = np.array([0.1, -0.2, 0.15])


@dataclass(frozen=True)
class Views:
    """States and times at which a law is evaluated.

    attitude: (k, 3, 3), body to inertial; position: (k, 3) [m], inertial; velocity: (k, 3) [m/s] and rate: (k, 3)
    [rad/s], body axes; time: (k,) [s], the same for all lanes of a packet.
    """

    attitude: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    rate: np.ndarray
    time: np.ndarray

    def moved(self, axis: int, by: float) -> Views:
        """The views with every position displaced by a length [m] along an inertial axis."""
        return replace(self, position=self.position + by * np.eye(3)[axis])

    def turned(self, axis: int, by: float) -> Views:
        """The views with every attitude rotated by an angle [rad] about one of its body axes."""
        return replace(self, attitude=self.attitude @ notation.matrix_from_rotation_vector(by * np.eye(3)[axis]))

    def elsewhere(self) -> Views:
        """The same states, expressed in body axes that are rotated by TURN and have their origin at ORIGIN."""
        return Views(
            self.attitude @ TURN,
            self.position + notation.rotate_out(self.attitude, ORIGIN[None]),
            (self.velocity + np.cross(self.rate, ORIGIN)) @ TURN,
            self.rate @ TURN,
            self.time,
        )

    def description(self, i: int) -> str:
        """Describe one view in words, for a message."""
        turn = notation.quaternion_from_matrix(self.attitude[i])
        where = f"at position {short(self.position[i])} m, quaternion {short(turn)}, t = {self.time[i]:.3g} s"
        return f"{where}, velocity {sizes(self.velocity[i])} m/s, rate {sizes(self.rate[i])} rad/s"


# Most views of a check.
MOST_SAMPLES = 1_000_000


def of_scene(scene: Any) -> Scene:
    """The scene in which a law is checked: the user's scene, or a simple one for None."""
    if scene is None:
        return simple_scene()
    if not isinstance(scene, Scene):
        raise refusal("scene", scene, "is not a Scene", "give lw.Scene(...), or leave it out")
    return scene


def simple_scene() -> Scene:
    """A scene of one vehicle without symmetry, for laws that are checked without a scene.

    Returns: A vehicle of 20 kg, slightly heavy, with different inertias in all axes and a centre of buoyancy off all axes.
    """
    body = Vehicle(
        20.0,
        inertia=(1.5, 4.0, 4.5),
        added_mass=(5.0, 22.0, 25.0),
        buoyancy=190.0,
        center_of_buoyancy=(0.01, 0.005, -0.02),
    )
    return Scene(body, Environment())


REMEDY = (
    "return what the role adds to (w, D, f, state); name fields as the View and params() do; import the operators of "
    "lanes that are used; no `if` on a lane, no plain number times a lane: docs/develop/add_a_force.md"
)


class TermBench:
    """A term, or a part of a controller, with its numbers and the kernels that evaluate it alone, one kernel per width.

    roles: roles in its device code; count: number of views, or of members; width: width of the first kernel.
    parameters: parameters of the scene, including the term's own; own: parameters of the term, by name.
    """

    def __init__(self, term: Term, module: Any, scene: Scene, count: int, seed: int, roles: Iterable[str],
                 widths: Sequence[int], make: Callable[..., Any] = make_examine, remedy: str = REMEDY):  # fmt: skip
        self.term, self.module, self.count, self.seed, self.width = term, module, count, seed, widths[0]
        self.roles = tuple(role for role in roles if hasattr(module, role))
        numbers = scene.parameters() | {f"{term.key}.{name}": value for name, value in term.parameters().items()}
        self.parameters = {name: np.asarray(value)[None] for name, value in numbers.items()}
        self.own = {name: self.parameters[f"{term.key}.{name}"] for name in term.parameters()}
        warp_setup.start()
        self.kernels = {width: built(term, module, width, make, remedy) for width in widths}
        self.Params = np.dtype(self.kernels[self.width].Params.numpy_dtype())


class Device:
    """Arrays of a kernel: a term's numbers, table and memory packed as for a run, and the kernel's output."""

    def __init__(self, bench: TermBench, packed: Any, width: int, fields: int, scratch: int = 0, bus: int = 0):
        self.kernel, self.packets, self.fields = bench.kernels[width], bench.count // width, fields
        Params = self.kernel.Params
        self.laws = LawArrays(self.packets, [(Params, np.dtype(Params.numpy_dtype()))], self.kernel.Lane)
        self.laws.write([Group([packed], [False])], scratch, bus)
        self.out = wp.zeros((self.packets, fields), dtype=self.kernel.Lane, device="cpu")

    def launch(self, *arguments: Any, repeats: int = 1) -> None:
        """Launch the kernel for all packets, `repeats` times."""
        inputs = [self.laws.structs[0].array, self.laws.table.array, *arguments, self.laws.memory.array, self.out]
        with build_lock:
            wp.launch(self.kernel.kernel, self.packets * repeats, inputs, device="cpu")

    def written(self) -> np.ndarray:
        """Output of the last launch (count, fields), a copy."""
        out = self.out.numpy().reshape(self.packets, self.fields, -1).transpose(0, 2, 1)
        return np.array(out.reshape(-1, self.fields))


class Bench(TermBench):
    """A term that is evaluated at random views, and at special views: at rest and along single axes.

    packets: the term's numbers on the device; set once packed() has been checked.
    """

    packets: Bank

    def __init__(self, term: Term, module: Any, scene: Scene, packets: int, seed: int):
        width = register_width("float64")
        super().__init__(term, module, scene, packets * width, seed, COLUMNS, (width,))
        self.roles = (*self.roles, *seeing_roles(module))
        self.noisy = bool(getattr(module, "NOISE", False))
        around = scene.start.given()["position"]
        self.views = random_views(packets, width, seed, around)
        self.corners = tuple(corner_views(packets, width, around))

    def context(self, parameters: Mapping[str, np.ndarray], elsewhere: bool = False) -> PackingContext:
        """Make the context that packed() receives; parameters: of the scene by name, each (1, ...) or (n, ...)."""
        return packing_context(parameters, self.count, self.seed, KICK, elsewhere)

    def at(self, views: Views, h: float = KICK, step: int = STEP) -> dict[str, np.ndarray]:
        """Evaluate every role of the law: arrays (count, numbers) by role; h [s], step: length and number of the step."""
        return self.packets.evaluate(views, h, step)


class Bank(Device):
    """A law's numbers in some context, after the law has stored its memory at some views."""

    def __init__(self, bench: Bench, context: PackingContext, views: Views):
        packed = bench.term.packed(Ensemble.own(bench.term, context.parameters), context)
        super().__init__(bench, packed, bench.width, OUT_FIELDS)
        self.bench = bench
        self.run_device(views, 0)

    @property
    def memory(self) -> Any:
        """Memory of the law, a Warp array (packets, rows) of lanes; the second half is a backup."""
        return self.laws.memory.array

    def evaluate(self, views: Views, h: float = KICK, step: int = STEP) -> dict[str, np.ndarray]:
        """Evaluate every role of the law, and its energy if it has one: arrays (count, numbers) by role."""
        out = self.run_device(views, -1, h, step)
        roles = (*self.bench.roles, *["energy"] * hasattr(self.bench.module, "energy"))
        return {role: out[:, COLUMNS[role][0] : sum(COLUMNS[role])] for role in roles}

    def run_device(self, views: Views, second: int, h: float = KICK, step: int = STEP) -> np.ndarray:
        """Evaluate the law once at each view: (k, OUT_FIELDS); h: length of the kick, or of the time before views [s]."""
        flat = [views.attitude.reshape(-1, 9), views.position, views.velocity, views.rate]
        rows = np.concatenate(flat, axis=1)
        lanes = Lanes(self.packets, rows.shape[1], self.kernel.Lane)
        put_rows(lanes.view, rows)
        times = wp.array(views.time[:: self.bench.width], dtype=wp.float64, device="cpu")
        self.launch(lanes.array, times, wp.float64(h), step, second)
        return self.written()


def packing_context(
    parameters: Mapping[str, np.ndarray], count: int, seed: int, h: float, elsewhere: bool = False
) -> PackingContext:
    """Make the context that packed() receives.

    parameters: parameters of the scene by name, each (1, ...) or (n, ...).
    h: step [s].
    """
    M, _, Js = inertia.schur(inertia.blocks(vehicle.inertia6(parameters)))
    n, none = len(M), np.zeros((len(M), 3, 3))
    Q = np.broadcast_to(TURN if elsewhere else np.eye(3), (n, 3, 3))
    origin = np.broadcast_to(ORIGIN if elsewhere else np.zeros(3), (n, 3))
    M, Js = (np.swapaxes(Q, 1, 2) @ A @ Q for A in (M, Js))
    frame = Frame(Q, origin, origin, M, np.einsum("nii->ni", Js), none, none)
    return PackingContext(parameters, frame, np.arange(count), seed, h)


def built(term: Term, module: Any, width: int, make: Callable[..., Any], remedy: str) -> Any:
    """Compile the kernel that evaluates a law, or a part of a controller.

    make: function of (module, numbers, width, real) that returns kernel and types.
    """
    try:
        hash(module)
    except TypeError:
        advice = "give a module, or a class that holds the functions"
        raise SceneError(
            [
                f"{term.key}.device = {module!r} is not hashable, as the key of a compiled kernel must be. {capital(advice)}"
            ]
        ) from None
    try:
        examine = make(module, declared(term, module), width, wp.float64)
        kernel_cache.load(examine.kernel.module)
    except OSError:  # of the kernel cache
        raise
    except Exception as error:
        words = " ".join(str(error).split())
        raise SceneError([f"{term.key}.device = {module!r} does not compile: {words}. {capital(remedy)}"]) from error
    return examine


def random_views(packets: int, width: int, seed: int, around: np.ndarray) -> Views:
    """Random views; around: (3,) [m], mean of the positions, whose standard deviation is 4 m."""
    rng = np.random.default_rng(seed)
    k = packets * width
    quaternion, position, velocity, rate = rng.normal(size=(k, 4)), *rng.normal(size=(3, k, 3))
    R = notation.matrix_from_quaternion(quaternion)
    return Views(R, around + 4.0 * position, velocity, rate, np.repeat(rng.uniform(0.0, 10.0, packets), width))


def corner_views(packets: int, width: int, around: np.ndarray) -> Iterator[Views]:
    """Views at which careless device code divides by zero.

    Velocity and rate are zero, along one axis, or so small that their squares vanish. The attitude is the identity, the
    position is `around` or the origin, and the time is 0.

    around: (3,) [m], the first of the two positions.
    """
    axes = np.concatenate([np.eye(6), -np.eye(6)])
    twists = np.concatenate([np.zeros((1, 6)), axes, 1e-200 * axes])
    places = np.stack([around, np.zeros(3)])
    position = np.repeat(places, len(twists), axis=0)
    twists = np.tile(twists, (len(places), 1))
    k = packets * width
    for first in range(0, len(twists), k):
        some = np.arange(first, first + k) % len(twists)
        R = np.broadcast_to(np.eye(3), (k, 3, 3))
        yield Views(R, position[some], twists[some, :3], twists[some, 3:], np.zeros(k))


def short(values: np.ndarray) -> str:
    """Format numbers for a message, rounded to three decimals."""
    return str(np.round(np.asarray(values), 3).tolist())


def sizes(values: np.ndarray) -> str:
    """Format numbers (n,), some of them very small, for a message with three significant digits."""
    return "[" + ", ".join(f"{value:.3g}" for value in values) + "]"
