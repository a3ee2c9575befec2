# SPDX-License-Identifier: Apache-2.0
"""Metrics of commands, actuators and energy, the time to failure, and custom metrics."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from lgvi_warp.common.arguments import listed
from lgvi_warp.common.errors import Faults, among, closest, refusal
from lgvi_warp.common.identity import check_version
from lgvi_warp.common.real_numbers import NotReal, real_results
from lgvi_warp.common.sentences import sentences
from lgvi_warp.control.signals import CHANNELS, ENERGY_USED, SAVED, SIGNALS, field_of, ordered
from lgvi_warp.statistics.metrics.metric import Metric, OfOne, State, Ticks, Total
from lgvi_warp.statistics.values.quantity import Quantity, named

if TYPE_CHECKING:
    from lgvi_warp.sampling.members import Members
    from lgvi_warp.statistics.values.samples import Fields

# A command counts as at its limit from this part of it on: numbers of float32 are as close as that.
AT_LIMIT = 1.0 - 1e-6


class _AllOf(Quantity):
    """All numbers of some samples, concatenated: (k, d, n), where d is not known before the run."""

    def __call__(self, samples: Fields, members: Members) -> np.ndarray:
        k, n = len(samples.time), members.count
        columns = [np.moveaxis(samples[name].reshape(k, n, -1), 2, 1) for name in self.fields]
        return np.concatenate(columns, axis=1, dtype=np.float64)


def all_of(*names: str) -> Quantity:
    """Return all numbers of some samples as one quantity."""
    return _AllOf(", ".join(names), _nothing, field_of(names[0]).unit if names[0] in SIGNALS else "", ordered(names))


def _nothing(samples: Fields, members: Members) -> np.ndarray:
    """Empty input for metrics that need no samples."""
    return np.zeros((len(samples.time), members.count))


@dataclass(frozen=True, eq=False)
class OfChannels(Total):
    """A metric of all channels of a signal, or of one channel. Abstract.

    Args:
        of: "command" or "actuator", for the sum over all channels, whatever their units; or one channel, "command[2]".
    """

    def meant(self) -> Quantity:
        if among(self.of, CHANNELS):
            return _ALL[self.of]
        names = [*CHANNELS, *(f"{name}[0]" for name in CHANNELS)]
        if not isinstance(self.of, str) or self.of.split("[")[0] not in CHANNELS:
            raise refusal(f"{self.type}.of", self.of, "is not a signal of actuators", closest(str(self.of), names))
        return named(f"{self.type}.of", self.of, self.of)


_ALL = {name: all_of(name) for name in CHANNELS}


@dataclass(frozen=True, eq=False)
class Effort(OfChannels):
    """Metric: integral over time of |command| or |position|, summed over channels [unit of the commands times s].

    Each value is taken as constant until the next tick. For commands this is exact: they are held between ticks.

    Args:
        of: "command" (the default): commands after faults and before delays; "actuator": actuator positions after
            delay, fault, limit and lag; or one channel, such as "command[2]".
    """

    type: ClassVar[str] = "effort"
    form: ClassVar[str] = "{0} s"
    default: ClassVar[str | None] = "command"

    def added(self, state: State, ticks: Ticks) -> np.ndarray:
        return np.abs(ticks.before).sum(axis=1) * ticks.dt[:, None]


@dataclass(frozen=True, eq=False)
class Travel(OfChannels):
    """Metric: travel of the actuators: sum of |change per tick| over all ticks and channels [unit of the commands].

    Args:
        of: "actuator" (the default) or "command", as in `Effort`; or one channel, such as "actuator[2]".
    """

    type: ClassVar[str] = "travel"
    default: ClassVar[str | None] = "actuator"

    def added(self, state: State, ticks: Ticks) -> np.ndarray:
        return np.abs(ticks.x - ticks.before).sum(axis=1)


def _saturated(samples: Fields, members: Members) -> np.ndarray:
    """Mask (k, n) of members with some command at or beyond its limit."""
    at_limit = np.zeros((len(samples.time), members.count), bool)
    for key, (row, count) in samples.controller.bus.commands.items():
        limit = members.parameters.get(f"{key}.limit")
        if limit is not None:
            at_limit |= (np.abs(samples["command"][..., row : row + count]) >= AT_LIMIT * limit).any(axis=-1)
    return at_limit


@dataclass(frozen=True, eq=False)
class SaturationShare(OfOne, Total):
    """Metric: fraction of a member's running time during which at least one command is at or beyond its limit [1].

    The limit is the parameter `limit` of the term that receives the command. A term without a limit never saturates.

    Args:
        of: "command", the default.
    """

    type: ClassVar[str] = "saturation_share"
    form: ClassVar[str] = "1"
    default: ClassVar[str | None] = "command"
    called: ClassVar[str] = "the command"
    meaning: ClassVar[Quantity] = Quantity("command", _saturated, "1", ("command",))

    def added(self, state: State, ticks: Ticks) -> np.ndarray:
        return ticks.before[:, 0] * ticks.dt[:, None]

    def finish(self, state: State) -> np.ndarray:
        return state["sum"] / state["until"]


def _wrench_and_twist(samples: Fields, members: Members) -> np.ndarray:
    """The actuators' wrench and the vehicle's motion over ground (k, n, 12); also whether the wrench is held."""
    names = ("exerted", "velocity", "angular_velocity")
    columns = [samples[name].astype(np.float64, copy=False) for name in names]
    slow = any(term.memory for term in samples.controller.actuators.values())
    held = (members.parameters["controller.delay"] == 0.0) & (not slow)
    flags = np.broadcast_to(held.astype(np.float64)[:, None], (*columns[0].shape[:2], 1))
    return np.concatenate([*columns, flags], axis=-1)


@dataclass(frozen=True, eq=False)
class ActuatorEnergy(OfOne, Total):
    """Metric: mechanical energy of the actuators [J], the integral over time of the |power| of their wrench.

    The power is the product of `exerted` with velocity and angular velocity. `exerted` is the actuators' wrench after
    limits, lags, the loss of thrust due to the advance speed, and all faults, even faults unknown to the controller.
    The trapezoidal rule integrates the power between ticks. Without lags, limited rates and delays, the wrench is
    constant between ticks. Losses of motors and propellers are not included. `ElectricalEnergy` includes them, if the
    scene has an energy account.

    Args:
        of: "exerted", the default.
    """

    type: ClassVar[str] = "energy"
    form: ClassVar[str] = "J"
    default: ClassVar[str | None] = "exerted"
    called: ClassVar[str] = "the actuators' wrench"
    meaning: ClassVar[Quantity] = Quantity(
        "exerted",
        _wrench_and_twist,
        "W",
        ("velocity", "angular_velocity", "exerted"),
        tuple(f"exerted {i}" for i in range(13)),
    )

    def added(self, state: State, ticks: Ticks) -> np.ndarray:
        before, after = ticks.before, ticks.x
        last = np.where(after[:, 12:] > 0.0, before[:, :6], after[:, :6])
        powers = [np.abs((w * v).sum(axis=1)) for w, v in ((before[:, :6], before[:, 6:12]), (last, after[:, 6:12]))]
        return 0.5 * (powers[0] + powers[1]) * ticks.dt[:, None]


@dataclass(frozen=True, eq=False)
class ElectricalEnergy(OfOne, Total):
    """Metric: electrical energy that a member uses [J], from the account of `lw.terms.EnergyUse`.

    The energy from the first to the last tick counts, with the hotel load and all losses that the terms define. In a
    sweep over a scene with this account, "energy" also names this metric.

    Args:
        of: "energy_used", the default.
    """

    type: ClassVar[str] = "electrical_energy"
    default: ClassVar[str | None] = ENERGY_USED
    called: ClassVar[str] = "the energy used"
    meaning: ClassVar[Quantity] = named("electrical_energy.of", ENERGY_USED, ENERGY_USED)

    def added(self, state: State, ticks: Ticks) -> np.ndarray:
        return ticks.x[:, 0] - ticks.before[:, 0]


@dataclass(frozen=True, eq=False)
class TimeToFailure(OfOne):
    """Metric: time at which a member failed or an event stopped it [s]; infinite if it ran to the end.

    Only lw.statistics.MemberValues() includes all members. Other statistics leave out infinite times and failed
    members. lw.statistics.Outcome gives the probability that a member has ended by each time.

    Args:
        of: "end", the default.
        then: lw.statistics.MemberValues(), the default, or other statistics.
    """

    type: ClassVar[str] = "time_to_failure"
    form: ClassVar[str] = "s"
    default: ClassVar[str | None] = "end"
    called: ClassVar[str] = "the end"
    meaning: ClassVar[Quantity] = Quantity("end", _nothing, "s", ())

    def then_default(self) -> Sequence[Any]:
        from lgvi_warp.statistics.paths.member_values import MemberValues

        return [MemberValues()]

    def finish(self, state: State) -> np.ndarray:
        return state["ended"]


class TickSamples(dict[str, np.ndarray]):
    """Input of a custom metric at one tick: samples (n, ...) by name, time t [s], and time dt [s] since the last tick."""

    def __init__(self, samples: Mapping[str, np.ndarray], t: float, dt: float):
        super().__init__(samples)
        self.t, self.dt = t, dt


@dataclass(frozen=True, eq=False)
class CustomMetric(Metric):
    """Custom metric: a function of your own that is called at each tick for a block of n members.

    The function is called as function(state, tick). `state` is None at the first tick; later it is the value that the
    function returned at the tick before. `tick` has the samples of the n members by name, such as tick["position"] (n,
    3), the time tick.t [s], and the time since the last tick, tick.dt [s]. The function returns numbers (n,), or (m, n)
    for m numbers of each member. When a member stops or fails, its state no longer changes.

    Args:
        of: the function; the metric takes the function's name.
        fields: names of the samples that the function reads, as for lw.SaveAt.
        last: function that computes the metric (n,) from the last state; by default the metric is the last state.
        unit_of: unit of the metric, a text; by default "1".
        version: text or number that identifies the functions in sweeps and stores; change it whenever the functions
            change. None, the default: their code identifies them.
    """

    type: ClassVar[str] = "own_metric"

    fields: Any = ("position",)
    last: Callable[[np.ndarray], np.ndarray] | None = None
    unit_of: str = "1"
    version: Any = None

    def check(self, faults: Faults) -> None:
        super().check(faults)
        for name in listed("fields", self.fields, "names of fields"):
            faults.choice("fields", name, SAVED)
        check_version(faults, self.version)

    def meant(self) -> Quantity:
        if not callable(self.of):
            remedy = "give a function of (state, tick), such as def heel(state, tick): ..."
            raise refusal("own_metric.of", self.of, "is not a function", remedy)
        if not all(isinstance(name, str) and name in SAVED for name in self.fields):
            raise refusal(
                "own_metric.fields", self.fields, "are not names of samples", closest(str(self.fields), SAVED)
            )
        label = str(getattr(self.of, "__name__", type(self.of).__name__))
        return replace(all_of(*self.fields), name=label, labels=(label,), unit=self.unit_of)

    @property
    def key(self) -> str:
        return self.name or self.quantity.name

    def begin(self, x: np.ndarray) -> State:
        return {"own": self._asked(None, x, 0.0, 0.0)}

    def follow(self, state: State, ticks: Ticks) -> State:
        values = state["own"]
        for (t, x, alive), dt in zip(ticks.rows(ticks.x), ticks.dt, strict=True):
            values = np.where(alive, self._asked(values, x, float(t), float(dt)), values)
        return {"own": values}

    def finish(self, state: State) -> np.ndarray:
        values = state["own"] if self.last is None else self._real(self.last(state["own"]))
        if values.shape != state["begun"].shape:
            wanted = f"({len(state['begun'])},), a number for each member"
            raise ValueError(f"metric {self.key}: ended with shape {values.shape}. It must be {wanted}")
        return values

    def _asked(self, state: np.ndarray | None, x: np.ndarray, t: float, dt: float) -> np.ndarray:
        """Value of the function at a tick; x: (d, n)."""
        values = self._real(self.of(state, TickSamples(dict(self._divided(x)), t, dt)))
        if values.shape[-1:] != x.shape[1:] or (state is not None and values.shape != state.shape):
            wanted = f"(..., {x.shape[1]})" if state is None else f"{state.shape}"
            raise ValueError(f"metric {self.key} gave shape {values.shape}. It must be {wanted}, members last")
        return values

    def _real(self, values: Any) -> np.ndarray:
        try:
            return np.asarray(real_results(values), np.float64)
        except NotReal as error:
            raise ValueError(sentences(f"metric {self.key}", error.what, "return real numbers")) from None

    def _divided(self, x: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
        """The samples by name, (n, ...)."""
        names = self.quantity.fields
        shapes = {name: field_of(name).shape for name in names}
        channels = [name for name in names if name in CHANNELS]
        rest = len(x) - sum(int(np.prod(shapes[name])) for name in names if name not in CHANNELS)
        shapes |= {name: (rest // len(channels),) for name in channels}
        first = 0
        for name in names:
            size = int(np.prod(shapes[name]))
            yield name, x[first : first + size].T.reshape(x.shape[1], *shapes[name])
            first += size
