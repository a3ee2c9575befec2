# SPDX-License-Identifier: Apache-2.0
"""`lw.gym.VectorEnv`: many vehicles as one vector environment of Gymnasium; a step is a period of the controller."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import listed
from lgvi_warp.common.errors import Faults, MissingExtra, brief, closest, ragged, refusal
from lgvi_warp.common.machine import DTYPES
from lgvi_warp.common.real_numbers import answered
from lgvi_warp.common.sentences import sentences
from lgvi_warp.common.times import whole_steps
from lgvi_warp.control.callback import Callback
from lgvi_warp.engine.block import Block
from lgvi_warp.engine.host_callback import CallbackInput
from lgvi_warp.engine.plan import Plan
from lgvi_warp.extensions.learning.episodes import Episodes
from lgvi_warp.extensions.learning.observations import bounds, observer
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.physics.terms.control_wrench import COMPONENTS
from lgvi_warp.runs.request import Request, ensemble_of, longest
from lgvi_warp.sampling.members import Members
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.scene.settings import MOST_MEMBERS

# Of (t, y, r), or (t, y, r, actions): see `Vehicles`.
OfTicks = Callable[..., Any]


class Vehicles:
    """Vehicles as a vector environment of Gymnasium; one step is one period of the scene's controller.

    An action is a demand or the commands of an actuator, held until the next tick. An observation holds measured values,
    including sensor errors, and wanted values. A vehicle that fails, or that an event of the scene stops, is terminated.
    Each episode of each environment is a different member of the ensemble, with its own draws of all varied numbers. The
    scene's control laws stay active: actions that are demands are added to the demands of the laws.

    `observe`, `reward` and `terminated` may be functions of (t, y, r): the time since the environments began [s], the measured
    and the wanted values (`lw.control.CallbackInput`) of m vehicles at once.

    Args:
        fleet: An ensemble, or a scene with an ensemble of its own. The scene must have a controller.
        observe: Names of numbers, as listed in docs/controllers/gym.md and including the inputs of `lw.control.Policy`; or a
            function that returns (m, k).
        act: "demand", the default: actions are added to the laws' demands. "command": actions are the commands of the only
            term that takes commands. With the key of a term, actions are the commands of this term. They replace
            the commands that the laws would give.
        reward: Function that returns rewards (m,), with the actions (m, n) as an optional fourth argument; by default 0.
        terminated: Function that returns truth values (m,), True for each episode to end; None by default.
        duration: Length of an episode [s], after which it is truncated. By default the duration of the scene's [run]; without
            such a duration, episodes are not truncated.
        num_envs: Number of environments; by default the number of members of the ensemble.
        outputs: Components of the demand that the actions set, among "X", "Y", "Z", "K", "M", "N"; all by default.
        scale: Demand or command at an action of 1, one number for all or one for each; actions are then in [-1, 1]. By
            default, actions are demands in N and N m without bounds, or commands in their unit within their limits.
        instead_of: Keys of laws that the actions replace; by default none. A `Callback` is always replaced.
        autoreset_mode: gymnasium.vector.AutoresetMode or its value: "NextStep" (default), "SameStep" or "Disabled".
        method: A name or a Method; by default the scene's.
        h: Step [s]; by default the scene's.
        dtype: Type of the kernel's numbers and of observations, "float64" or "float32"; by default the scene's.
        width: Number of vehicles in a packet; by default chosen for the CPU.

    Attributes:
        members: Indices of the members in the environments at present, (num_envs,).
        time: Time since all environments began [s].

    Raises:
        SceneError: If an argument is invalid; the message lists every fault.
        MissingExtra: If Gymnasium is not installed.
    """

    metadata: dict[str, Any]

    def __init__(
        self,
        fleet: Ensemble | Scene,
        *,
        observe: Sequence[str] | OfTicks,
        act: str = "demand",
        reward: OfTicks | None = None,
        terminated: OfTicks | None = None,
        duration: float | None = None,
        num_envs: int | None = None,
        outputs: Sequence[str] = COMPONENTS,
        scale: Any = None,
        instead_of: str | Sequence[str] = (),
        autoreset_mode: Any = "NextStep",
        method: str | Method | None = None,
        h: float | None = None,
        dtype: str | None = None,
        width: int | None = None,
    ):
        # What `__reduce__` makes a copy by.
        self._made_of = {name: value for name, value in locals().items() if name not in ("self", "__class__")}
        gymnasium = needed()
        ensemble = ensemble_of(fleet)
        faults, names = Faults(), tuple(listed("instead_of", instead_of, "keys of laws"))
        controller = ensemble.scene.controller
        if controller is None:
            faults.add(
                "controller", None, "is not in the scene", "give [controller] with its period, guidance and sensors"
            )
            faults.raise_if_any()
        to = _actuator(faults, act, ensemble.scene)
        known = [law.key for law in controller.laws]
        for name in names:
            faults.choice("instead_of", name, known)
        modes = {mode.value: mode for mode in gymnasium.vector.AutoresetMode}
        mode = getattr(autoreset_mode, "value", autoreset_mode)
        faults.choice("autoreset_mode", mode, modes)
        self._observe = observe if callable(observe) else observer(faults, observe, _wishes(controller))
        for key, value in (("reward", reward), ("terminated", terminated)):
            if value is not None and not callable(value):
                faults.add(key, value, "is not a function", f"give {key}(t, y, r)")
        self._reward, self._terminated = reward, terminated
        self._with_actions = reward is not None and callable(reward) and _arguments(reward) > 3
        self.num_envs = ensemble.members if num_envs is None else num_envs
        if not isinstance(self.num_envs, int | np.integer) or not 1 <= self.num_envs < MOST_MEMBERS:
            faults.add("num_envs", num_envs, "is not a number of environments", "give a whole number from 1")
        outputs = listed("outputs", outputs, "demands")
        for i, name in enumerate(outputs):
            faults.choice(f"outputs[{i}]", name, COMPONENTS)
            if name in outputs[:i]:
                faults.add(f"outputs[{i}]", name, "is named twice", "leave one of them out")
        duration = ensemble.scene.run.duration if duration is None else duration
        if duration is not None:
            faults.positive("duration", duration)
        faults.raise_if_any()
        self._limits = None if callable(observe) else bounds(observe, ensemble)
        self._fleet = _acted(ensemble, names, to)
        self._random = _endless(ensemble)
        self._noise_seed = ensemble.seed
        self._seed(ensemble.seed)
        self._plan = self._planned(method, h, dtype, width)
        self._periods = _whole_periods(duration, controller.every(self._plan.grid.h) * self._plan.grid.h)
        # Whose episode has ended, and how many periods each has lasted.
        self._begun, self._done = False, np.zeros(self.num_envs, bool)
        self._periods_made = np.zeros(self.num_envs, np.int64)
        self._columns = None if to else [COMPONENTS.index(name) for name in outputs]
        self._spaces(gymnasium, to, scale)
        self.metadata = {"render_modes": [], "autoreset_mode": modes[mode]}
        self._mode = mode

    def _planned(self, method: Any, h: float | None, dtype: str | None, width: int | None) -> Plan:
        """The plan of a run of the largest possible length."""
        scene = self._fleet.scene
        t1 = longest(scene, scene.run.step if h is None else h)
        members = max(self.num_envs, self._fleet.members) if self._random else self._fleet.members
        planned = self._fleet.with_seed(self._fleet.seed, members) if self._random else self._fleet
        save = SaveAt(fields=("position",))
        request = Request(planned, method, h, t1, save, dtype, width=width, checks="safe", on_failure="freeze")
        plan = request.plan()
        plan.compile()
        return plan

    def _spaces(self, gymnasium: Any, to: str | None, scale: Any) -> None:
        """Set the spaces of actions and observations, from the first members."""
        self._index = np.arange(self.num_envs)
        # Episodes that each environment has begun before this one, and the one among all that is prepared next.
        self._numbers = np.zeros(self.num_envs, np.int64)
        self._prepared = np.full(self.num_envs, -1)
        self._episodes = Episodes(self._plan, self._drawn(self._episode_of(self._numbers)))
        controller = self._plan.kernel_choice.controller
        assert controller is not None
        size = controller.bus.commands[to][1] if to else len(self._columns or ())
        faults, self._scale = Faults(), None
        if scale is not None:
            value = faults.finite("scale", scale)
            if value is not None and value.shape not in ((), (size,)):
                faults.add("scale", scale, f"has shape {value.shape}", f"give a number, or {size}")
            faults.raise_if_any()
            self._scale, most = value, np.ones(size)
        elif to:
            most = np.broadcast_to(controller.actuators[to].parameters()["limit"], size)
        else:
            most = np.full(size, np.inf)
        kind = np.dtype(DTYPES[self._plan.dtype])
        box, batched = gymnasium.spaces.Box, gymnasium.vector.utils.batch_space
        self._answer = np.zeros((self.num_envs, size if to else len(COMPONENTS)))
        self._kind = kind
        if self._limits is not None:
            self._limits = self._limits.astype(kind)
        observed = self._seen(*self._episodes.signals())
        self.single_action_space = box(-most.astype(kind), most.astype(kind), dtype=kind.type)
        low, high = (-np.inf, np.inf) if self._limits is None else self._limits
        self.single_observation_space = box(low, high, observed.shape[1:], kind.type)
        self.action_space = batched(self.single_action_space, self.num_envs)
        self.observation_space = batched(self.single_observation_space, self.num_envs)

    def _seed(self, seed: int) -> None:
        """Use this seed for all draws from now on."""
        self._source = self._fleet.with_seed(seed, MOST_MEMBERS if self._random else None)
        self._noises = 0 if self._random else int(self._source.indices.max()) + 1

    def _drawn(self, episodes: np.ndarray) -> Members:
        """The members of episodes, counted over all environments. A member that is used again gets other noise."""
        times, places = np.divmod(episodes, self._source.members)
        subset = self._source.subset(places)
        members = subset.select(0, len(places))
        subset.check_block(0, len(places), members.parameters)
        if self._source.varied() and not self._plan.serves(subset, Block(0, len(places)), members):
            problem = "needs what the first members that were drawn do not"
            remedy = "give the ensemble more members, among which is such a one"
            raise refusal("fleet", f"a member of {places.min()} to {places.max()}", problem, remedy)
        # One seed keys the noise of all lanes.
        indices = (members.indices + times * self._noises) % MOST_MEMBERS
        return replace(members, indices=indices, seed=self._noise_seed)

    @property
    def time(self) -> float:
        """Time since all environments began [s], the time t of forces and guidance that depend on time."""
        return self._episodes.steps * self._plan.grid.h

    @property
    def members(self) -> np.ndarray:
        """Indices of the members (num_envs,) in the environments at present."""
        return self._episode_of(self._numbers) % self._source.members

    def _episode_of(self, numbers: np.ndarray) -> np.ndarray:
        """Index of an episode among those of all environments, from the number of earlier episodes of its environment."""
        return self._index + numbers * self.num_envs

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin new episodes of all environments, with the time at 0, or of the environments in options["reset_mask"].

        Args:
            seed: Seed of all draws from now on; episodes are counted from 0 again. By default (None), episodes use the
                next members of the present seed. The first seed is that of the ensemble.
            options: {"reset_mask": truth values (num_envs,)}; None (default) for all environments.

        Returns:
            (observations of all environments, {}).

        Raises:
            TypeError: If the seed is not a whole number, or the mask not an array of truth values.
            ValueError: If the shape of the mask is not (num_envs,), or the mask is False throughout.
        """
        if seed is not None and not isinstance(seed, int | np.integer):
            raise TypeError(f"seed = {brief(seed)} is not a whole number. Give one for all environments")
        super().reset(seed=seed)  # type: ignore[misc]  # of gymnasium.vector.VectorEnv
        mask = _mask(options, self.num_envs)
        all_begin = mask.all() or not self._begun
        if seed is not None:
            self._seed(int(seed))
            self._prepared[:] = -1
            self._numbers[mask] = 0
        elif self._begun:
            self._numbers[mask] += 1
        self._periods_made[mask] = 0
        self._done[mask] = False
        if all_begin:
            if seed is not None:
                self._noise_seed = int(seed)
            self._done[:] = False
            self._prepared[:] = -1
            self._episodes.begin(self._drawn(self._episode_of(self._numbers)))
            self._observed = self._seen(*self._episodes.signals())
        else:
            self._observed = self._observed.copy()
            self._observed[mask] = self._restarted(np.flatnonzero(mask))
        self._begun = True
        return self._observed.copy(), {}

    def step(self, actions: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Apply the actions for one period of the controller.

        Args:
            actions: (num_envs, n), in the order of `outputs` or of the commands. Actions are not clipped here, since the
                actuators have limits.

        Returns:
            (observations, rewards, terminations, truncations, infos). If vehicles failed or were stopped by an event, infos
            has "status" (see `lw.Status`) and the mask "_status". With autoreset "SameStep" it also has the entries that
            Gymnasium requires.

        Raises:
            ValueError: If the shape of the actions is not (num_envs, n), or they are not real numbers.
            ResetNeeded: Before the first `reset`; with autoreset "Disabled" after an episode has ended; and after
                2^31 integration steps, when all environments must be reset.
        """
        return self._stepped(actions, self._mode)

    def _stepped(
        self, actions: Any, mode: str
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """`step` with a given autoreset mode."""
        last, episodes = self._done, self._episodes
        if not self._begun or (mode == "Disabled" and last.any()):
            raise needed().error.ResetNeeded("an episode has ended, or none has begun: call reset first")
        if episodes.steps + episodes.every > self._plan.grid.steps:
            raise needed().error.ResetNeeded("steps are counted up to 2^31: reset all environments")
        wanted = answered("actions", actions)
        if wanted.shape != self.action_space.shape:
            raise ValueError(f"actions have shape {wanted.shape}. Give {self.action_space.shape}")
        scaled = wanted if self._scale is None else wanted * self._scale
        if self._columns is None:
            self._answer = scaled
        else:
            self._answer[:, self._columns] = scaled
        episodes.advance(self._answer)
        self._periods_made += 1
        y, r = episodes.signals()
        status = episodes.status()
        ended = status != 0
        if np.any(ended & ~last):
            self._tick_at_ends(np.flatnonzero(ended & ~last), y, r)
        observed = self._seen(y, r)
        rewards = self._rewarded(y, r, actions)
        terminations = ended if self._terminated is None else ended | self._truth(self._terminated(self.time, y, r))
        truncations = self._periods_made >= self._periods
        infos: dict[str, Any] = {"status": status, "_status": ended.copy()} if ended.any() else {}
        if mode == "NextStep" and last.any():
            again = np.flatnonzero(last)
            self._begin_next(again)
            observed[again] = self._restarted(again)
            rewards[again], terminations[again], truncations[again] = 0.0, False, False
            for mask in infos.values():
                mask[again] = 0
        self._done = terminations | truncations
        if mode == "SameStep" and self._done.any():
            again = np.flatnonzero(self._done)
            final = np.full(self.num_envs, None, dtype=object)
            final[again] = list(observed[again])
            infos = {
                "final_obs": final,
                "_final_obs": self._done.copy(),
                "final_info": infos,
                "_final_info": self._done.copy(),
            }
            self._begin_next(again)
            observed[again] = self._restarted(again)
            self._done = np.zeros(self.num_envs, bool)
        self._observed = observed
        return observed.copy(), rewards, terminations, truncations, infos

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the constructor's arguments: the copy is a new environment that has not begun."""
        return _remade, (self._made_of,)

    def _begin_next(self, envs: np.ndarray) -> None:
        self._numbers[envs] += 1
        self._periods_made[envs] = 0

    def _restarted(self, envs: np.ndarray) -> np.ndarray:
        """Start the present episodes of some environments, and return their first observations."""
        following = self._numbers + 1
        following[envs] -= 1
        wanted = self._episode_of(following)
        if np.any(self._prepared[envs] != wanted[envs]):
            # Many at once: one that has begun will need the one after that, before long.
            stale = np.flatnonzero(self._prepared != wanted)
            padded = np.append(stale, np.repeat(stale[-1:], self._episodes.room_for(len(stale)) - len(stale)))
            self._episodes.prepare(stale, self._drawn(wanted[padded]))
            self._prepared[stale] = wanted[stale]
        return self._seen(*self._episodes.restart(envs))

    def _tick_at_ends(self, envs: np.ndarray, y: CallbackInput, r: CallbackInput) -> None:
        """Replace the values of ended vehicles in y and r by the values in their final states."""
        for signals, part in zip((y, r), self._episodes.signals_of(envs), strict=True):
            for name, value in vars(part).items():
                if value is not None:
                    getattr(signals, name)[envs] = value

    def _seen(self, y: CallbackInput, r: CallbackInput) -> np.ndarray:
        """Observations of some environments."""
        observed = answered("observe", self._observe(self.time, y, r)).astype(self._kind)
        if observed.ndim != 2 or len(observed) != len(y.heading):
            raise ValueError(f"observe: returned shape {observed.shape}. Return ({len(y.heading)}, k), a row for each")
        return observed if self._limits is None else np.clip(observed, *self._limits)

    def _rewarded(self, y: CallbackInput, r: CallbackInput, actions: Any) -> np.ndarray:
        if self._reward is None:
            return np.zeros(self.num_envs)
        more = (np.asarray(actions),) if self._with_actions else ()
        rewards = answered("reward", self._reward(self.time, y, r, *more))
        if rewards.shape != (self.num_envs,):
            raise ValueError(f"reward: returned shape {rewards.shape}. Return ({self.num_envs},)")
        return rewards

    def _truth(self, values: Any) -> np.ndarray:
        regular = not isinstance(values, np.ma.MaskedArray) and not ragged(values)
        terminated = np.asarray(values) if regular else None
        if terminated is None or terminated.dtype.kind != "b":
            terminated = answered("terminated", values) != 0.0
        if terminated.shape != (self.num_envs,):
            raise ValueError(f"terminated: returned shape {terminated.shape}. Return ({self.num_envs},)")
        return terminated


def step_by(mode: str, env: Vehicles, actions: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict]:
    """A step of an environment with the autoreset mode of another library, whatever the environment's own mode."""
    return env._stepped(actions, mode)


def needed() -> Any:
    """The module gymnasium, or an error if it is not installed."""
    try:
        import gymnasium
    except ImportError as error:
        raise MissingExtra("environments", "gymnasium", "gym") from error
    return gymnasium


@functools.cache
def _vector_env() -> type:
    """`Vehicles` as a subclass of Gymnasium's VectorEnv, created at its first use, since Gymnasium may be absent."""
    base = needed().vector.VectorEnv
    return type("VectorEnv", (Vehicles, base), {"__doc__": Vehicles.__doc__, "__module__": __name__})


def _remade(made_of: dict[str, Any]) -> Any:
    return _vector_env()(**made_of)


def __getattr__(name: str) -> Any:
    if name == "VectorEnv":
        return _vector_env()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def _whole_periods(duration: float | None, period: float) -> float:
    """Number of periods of an episode; infinite without a duration."""
    if duration is None:
        return np.inf
    count = round(duration / period)
    if count < 1 or whole_steps(duration, period) is None:
        raise refusal("duration", duration, f"is not a whole number of periods of {period:.9g} s", "give a multiple")
    return count


def _nothing(size: int, t: float, y: CallbackInput, r: CallbackInput, members: np.ndarray) -> np.ndarray:
    """The answer of the callback if no environment gives one: zeros."""
    return np.zeros((len(members), size))


def _actuator(faults: Faults, act: Any, scene: Any) -> str | None:
    """Key of the term that takes the actions as commands; None if actions are demands."""
    able = [term.key for term in scene.terms if term.channels]
    if act == "demand" or act in able:
        return None if act == "demand" else str(act)
    if act != "command":
        faults.add("act", act, "is not known", closest(act, ["demand", "command", *able]))
    elif len(able) != 1:
        faults.add("act", act, f"may be that of {len(able)} terms", f"give one of {', '.join(map(repr, able))}")
    return able[0] if able else None


def _acted(fleet: Ensemble, names: Sequence[str], to: str | None) -> Ensemble:
    """The same members, with the callback that applies the actions."""
    scene: Any = fleet.scene
    controller = scene.controller
    channels = {term.key: term.channels for term in scene.terms}
    callback = Callback(functools.partial(_nothing, channels[to] if to else len(COMPONENTS)), to=to, name="actions")
    laws = [law for law in controller.laws if law.key not in names and not isinstance(law, Callback)]
    allocation = [part for part in controller.allocation if part.type and part.to != to]
    return fleet.in_scene(replace(scene, controller=replace(controller, laws=[*laws, callback], allocation=allocation)))


def _wishes(controller: Any) -> tuple[str, ...]:
    return tuple(wish for part in controller.guidance for wish in part.gives)


def _endless(fleet: Ensemble) -> bool:
    """Whether any number of members can be drawn: they are drawn at random, and the user has not selected some of them."""
    every = np.array_equal(fleet.indices, np.arange(fleet.members))
    return fleet.sampling.kind == "random" and not fleet.explicit() and every


def _arguments(function: Callable[..., Any]) -> int:
    """Number of positional arguments of a function."""
    kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    return sum(item.kind in kinds for item in inspect.signature(function).parameters.values())


def _mask(options: Mapping[str, Any] | None, count: int) -> np.ndarray:
    """Mask of the environments to reset."""
    mask = (options or {}).get("reset_mask")
    if mask is None:
        return np.ones(count, bool)
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
        raise TypeError(f"options['reset_mask'] = {brief(mask)} is not a NumPy array of truth values. Give one")
    if mask.shape != (count,) or not mask.any():
        problem = f"has shape {mask.shape} and {int(mask.sum())} True"
        raise ValueError(sentences("options['reset_mask']", problem, f"give shape ({count},) with one True at least"))
    return mask
