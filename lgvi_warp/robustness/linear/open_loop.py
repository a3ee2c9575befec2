# SPDX-License-Identifier: Apache-2.0
"""`loop`: open loop of each member at a law's demand or at commands; hold, lags and delay are as in the run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import explained
from lgvi_warp.common.errors import Faults, MissingExtra, closest, refusal
from lgvi_warp.common.near import near_names
from lgvi_warp.common.summaries import listed, plural
from lgvi_warp.criteria.running import step_of
from lgvi_warp.methods.method import Method
from lgvi_warp.physics.terms.control_wrench import COMPONENTS
from lgvi_warp.robustness.linear.bench import calm
from lgvi_warp.robustness.linear.disk import Response, grid_of
from lgvi_warp.robustness.linear.linearize import check_parts, of_the_mean
from lgvi_warp.robustness.linear.loops import LEAST_TICKS, Study
from lgvi_warp.robustness.linear.margins import GROUP
from lgvi_warp.robustness.linear.phase import loci
from lgvi_warp.robustness.linear.sampled_loop import SampledLoop
from lgvi_warp.runs.request import ensemble_of
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene

Matrices = tuple[np.ndarray, np.ndarray, np.ndarray]


@explained
@dataclass(frozen=True, repr=False)
class OpenLoops:
    """Open loop of each member as a linear model: x' = A x + B u, y = C x. The feedback u = -y closes the loop.

    x: k states, linear combinations of the loop's observed states; x': x one tick later; u: r inputs; y: r outputs.

    Attributes:
        at: place at which the loops are opened, as in `loop`.
        models: (A, B, C) of each member, (k, k), (k, r) and (r, k); None for a member without a loop.
        names: names of the inputs u and outputs y (r,): components of a demand, or commands.
        dt: the period [s].
        why: (n,), reason why a member has no loop, as in `lw.linear.margins`; "" if the member has a loop.
        messages: notes for the user, such as effects that linear loops leave out.
        members: number of members, n.
    """

    at: str
    models: tuple[Matrices | None, ...]
    names: tuple[str, ...]
    dt: float
    why: np.ndarray
    messages: tuple[str, ...] = ()

    @property
    def members(self) -> int:
        """The number of members, n."""
        return len(self.models)

    def __repr__(self) -> str:
        good = sum(model is not None for model in self.models)
        lost = "; ".join(f"{count:,}: {why}" for why, count in Counter(self.why.tolist()).most_common() if why)
        some = f"{good:,} of {plural(self.members, 'member')} ({lost})" if lost else plural(good, "member")
        inputs = "" if self.names == (self.at,) else f" ({listed(self.names)})"
        return "\n".join([*self.messages, f"The loop is opened at {self.at}{inputs} in {some}."])

    def frequencies(self) -> np.ndarray:
        """Choose frequencies for plots of all loops: a grid, and the frequencies of the loops' poles.

        Returns:
            Frequencies (k,) in increasing order, up to the Nyquist frequency [rad/s].
        """
        each = [grid_of(_response(model)) for model in self.models if model is not None]
        return np.unique(np.concatenate([np.zeros(0), *each])) / self.dt

    def response(self, frequencies: Any) -> np.ndarray:
        """Compute the frequency response L(e^(i w dt)) of each open loop, with L(z) = C (z - A)^-1 B.

        Args:
            frequencies: frequencies w (k,) [rad/s].

        Returns:
            Complex responses (n, k, r, r); NaN for members without a loop, and at frequencies of poles.
        """
        angles, r = np.asarray(frequencies, float) * self.dt, len(self.names)
        found = np.full((self.members, len(angles), r, r), np.nan, complex)
        for i, model in enumerate(self.models):
            if model is not None:
                with np.errstate(all="ignore"):
                    found[i] = _response(model)(angles)
        return np.where(np.isfinite(found), found, np.nan)

    def loci(self, frequencies: Any) -> np.ndarray:
        """Compute the characteristic loci: the eigenvalues of the frequency response L; for one input, L itself.

        Args:
            frequencies: frequencies w (k,) [rad/s].

        Returns:
            Eigenvalues (n, k, r), the largest first; NaN as in `response`.
        """
        L = self.response(frequencies)
        lost = np.isnan(L).any(axis=(2, 3))
        values = loci(np.where(lost[..., None, None], 0.0, L).reshape(-1, *L.shape[2:])).reshape(L.shape[:3])
        return np.where(lost[..., None], np.nan, values)

    def state_space(self, member: int = 0) -> Any:
        """Convert the open loop of a member to a StateSpace of python-control (extra: control).

        Args:
            member: index of the member; 0 by default.

        Returns:
            A control.StateSpace whose dt is the period.

        Raises:
            MissingExtra: If python-control is not installed.
            SceneError: If the member has no loop.
        """
        A, B, C = self._model(member)
        return _control().StateSpace(
            A, B, C, np.zeros((len(C), B.shape[1])), self.dt, inputs=self._signals("u"), outputs=self._signals("y")
        )

    def frd(self, member: int = 0, frequencies: Any = None) -> Any:
        """Convert the open loop's frequency response of a member to an FRD of python-control (extra: control).

        Args:
            member: index of the member; 0 by default.
            frequencies: k frequencies (k,) [rad/s]; None, the default: a grid, and the frequencies of the loop's poles.

        Returns:
            A control.FRD whose dt is the period.

        Raises:
            MissingExtra: If python-control is not installed.
            SceneError: If the member has no loop.
        """
        model, control = self._model(member), _control()
        w = grid_of(_response(model)) / self.dt if frequencies is None else np.asarray(frequencies, float)
        values = np.moveaxis(_response(model)(w * self.dt), 0, 2)
        return control.FRD(values, w, dt=self.dt, inputs=self._signals("u"), outputs=self._signals("y"))

    def _model(self, member: int) -> Matrices:
        if not 0 <= member < self.members:
            raise refusal("member", member, f"is none of {self.members}", "give an index from 0")
        model = self.models[member]
        if model is None:
            raise refusal("member", member, f"has no loop: {self.why[member]}", "give another")
        return model

    def _signals(self, letter: str) -> list[str]:
        """Names of signals for python-control, which allows neither duplicates nor dots."""
        return [f"{letter}_{name}".replace(".", "_") for name in self.names]


def _response(model: Matrices) -> Response:
    A, B, C = model
    return Response(A, B, -C)


def _control() -> Any:
    try:
        import control
    except ImportError as error:
        raise MissingExtra("state spaces", "control", "control") from error
    return control


@near_names()
def loop(
    fleet: Ensemble | Scene,
    at: str | None = None,
    *,
    about: float = 60.0,
    settle: float = 1200.0,
    method: str | Method | None = None,
    h: float | None = None,
) -> OpenLoops:
    """Open the control loop of each member at a demand or command, and return the open loop as a linear model.

    As in `lw.linear.margins`, the loop is linearised about the member's motion after `about` seconds, which must be
    steady. The closed loop need not be stable. Loops through other demands or commands stay closed.

    Args:
        fleet: An Ensemble, or a Scene whose [ensemble] is used; without waves and noise of the water.
        at: Place at which to open the loop: key of a law, such as "heading_pid" (all components of its demand); "X",
            "Y", "Z", "K", "M" or "N" (one component of all laws' demand); a command, such as "control_fins[0]"; or an
            actuator, such as "control_fins" (all its commands). None, the default: the whole demand of all laws.
        about: Time at which the loop is examined [s]; 60 by default.
        settle: Time by which a member must be steady [s]; 1200 by default.
        method: As in `lw.solve`; the scene's method by default.
        h: Step [s]; the scene's step by default.

    Returns:
        The open loops.

    Raises:
        SceneError: If an argument is wrong, or the scene does not allow a linear loop.

    Examples:
        >>> import lgvi_warp as lw
        >>> law = lw.control.HeadingPID(kp=2.0, kd=4.0)
        >>> controller = lw.Controller(period=0.1, guidance=[lw.control.SetPoint(heading=0.0)], laws=[law])
        >>> vehicle = lw.Vehicle(50.0, inertia=[4.0, 5.0, 6.0], buoyancy=490.3325)
        >>> drag = lw.terms.Drag(linear=[20.0, 20.0, 20.0, 8.0, 8.0, 8.0])
        >>> scene = lw.Scene(vehicle, terms=[lw.terms.ControlWrench(), drag], controller=controller)
        >>> opened = lw.linear.loop(scene, "heading_pid", method="rk4", h=0.02)
        >>> abs(opened.response([0.1, 1.0]))[0, :, 0, 0].round(3)
        array([2.542, 0.448])
    """
    ensemble = ensemble_of(fleet)
    scene: Any = ensemble.scene
    faults = Faults()
    for name, value in {"about": about, "settle": settle}.items():
        faults.positive(name, value)
    controller = scene.controller
    if controller is None:
        faults.add("controller", None, "is not in the scene, and a loop needs one", "give [controller]")
    faults.raise_if_any()
    commands = [f"{key}[{i}]" for key, term in controller.actuators.items() for i in range(term.channels)]
    chosen = [i for i, name in enumerate(commands) if at is not None and at in (name, name.rpartition("[")[0])]
    laws = [law.key for law in controller.laws]
    if not (at is None or chosen or at in laws or at in COMPONENTS):
        known = [*laws, *COMPONENTS, *controller.actuators, *commands]
        raise refusal("at", at, "is no law, component or command of the controller", closest(str(at), known))
    calm(scene, "open loops")
    scene, zeros, messages = of_the_mean(scene)
    check_parts(scene.controller, "an open loop")
    if varied := sorted(ensemble.varied_names.intersection(zeros)):
        raise refusal(varied[0], "...", "varies, where open loops take it as 0", "leave it out of what varies")
    ensemble = ensemble.in_scene(scene) if messages else ensemble
    seconds = LEAST_TICKS * float(controller.period)
    study = Study(ensemble, at if at in laws else None, about, settle, seconds, 1e-3, method, step_of(scene, h))
    if at in COMPONENTS and COMPONENTS.index(at) not in study.components:
        raise refusal("at", at, "is a component that no law demands", f"give one of {listed(_named(study.components))}")
    models: list[Matrices | None] = [None] * ensemble.members
    why: np.ndarray = np.full(len(models), "", dtype=object)
    for first in range(0, len(models), GROUP):
        places = np.arange(first, min(first + GROUP, len(models)))
        groups, why[places] = study.loops(places)
        for loops in groups:
            apart = () if chosen else study.components
            sampled = SampledLoop(study.bench, loops.places, loops.motion, loops.begin, apart)
            every = np.arange(len(loops.places))
            of_commands = sampled.opened_at_commands(loops.delay, every, chosen)
            for opened in of_commands if chosen else sampled.opened(loops.delay, every):
                if at in COMPONENTS:
                    opened = opened.at(study.components.index(COMPONENTS.index(at)))
                for i, model in zip(loops.places[opened.some], sampled.observed(opened), strict=True):
                    models[i] = (*model[:2], -model[2])
    names = [commands[i] for i in chosen] or ([at] if at in COMPONENTS else _named(study.components))
    texts = (*study.bench.plan.grid.messages, *messages)
    return OpenLoops(at or "all laws", tuple(models), tuple(names), study.period, why, texts)


def _named(components: Sequence[int]) -> list[str]:
    return [COMPONENTS[i] for i in components]
