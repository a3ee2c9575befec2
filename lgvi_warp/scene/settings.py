# SPDX-License-Identifier: Apache-2.0
"""Settings of a scene file: its sections [run] and [ensemble]."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import members_of
from lgvi_warp.common.declared import checked, positive, read, text, whole, word
from lgvi_warp.common.errors import Faults, SceneError, among
from lgvi_warp.common.machine import DTYPES
from lgvi_warp.common.real_numbers import is_whole
from lgvi_warp.common.status import CHECKS, ON_FAILURE
from lgvi_warp.methods.method import Method
from lgvi_warp.sampling.designs import sampling_of
from lgvi_warp.sampling.designs.base import Sampling
from lgvi_warp.sampling.distributions import named as distributions

# Largest ensemble: a kernel keys a member's noise by its index, a signed word of 32 bits.
MOST_MEMBERS = 2**31


KEEP = ("all", "none", "failed")
# Where kernels run, and what is said of any other place.
DEVICES = ("cpu",)
NO_DEVICE = "is not a device of a run: runs are on CPU cores", 'leave it out, or give "cpu"'


def check_device(device: Any) -> None:
    """Refuse a device that cannot run."""
    faults = Faults()
    if not among(device, DEVICES):
        faults.add("device", device, *NO_DEVICE)
    faults.raise_if_any()


def read_keep(key: str, keep: Any, members: int | None = None) -> str | list[int]:
    """Read the choice of members whose samples are kept: one of KEEP, or rising indices."""
    if not isinstance(keep, str):
        return sorted(set(members_of(key, keep, members).tolist()))
    faults = Faults()
    faults.choice(key, keep, KEEP)
    faults.raise_if_any()
    return str(keep)


@dataclass(frozen=True)
class RunSettings:
    """The section [run] of a scene file.

    Args:
        method: Name of the integration method; with None (default), a run chooses it by the terms of the scene.
        step: Length of a step [s]; None if the call of solve gives it.
        duration: Simulated time [s]; None if the call of solve gives it.
        save_every: Time between samples [s]; None if the call of solve gives it.
        save_fields: Names of the samples, as `fields` of SaveAt; None (default) for the motion.
        dtype: Number type of the computation; by default "float64".
        solver: As in Method.
        iterations: As in Method.
        tolerance: As in Method.
        rtol: As in Method.
        atol: As in Method.
        checks: As in solve; by default "safe".
        on_failure: As in solve; by default "freeze".
        device: As in solve; by default "cpu", the only device.
        keep: Members whose samples are kept: "all" (default), "none", "failed", or a list of indices.
        statistics: Tables as in [[run.statistics]], or Statistic objects; by default none.
        until: A table as in [run.until], or an Until; None for a fixed number of members (default).

    Raises:
        SceneError: If a setting is invalid; the message lists every fault.
    """

    method: str | None = text("is not a text", 'give the name of a method, such as "psi_s"', None)
    step: float | None = positive(None, unit="s")
    duration: float | None = positive(None, unit="s")
    save_every: float | None = positive(None, unit="s")
    save_fields: Sequence[str] | None = None
    dtype: str = word("float64", known=DTYPES)
    solver: str | None = None
    iterations: int | str | None = None
    tolerance: float | None = None
    rtol: float | None = None
    atol: float | None = None
    checks: str = word("safe", known=CHECKS)
    on_failure: str = word("freeze", known=ON_FAILURE)
    device: str = checked(lambda value: among(value, DEVICES), *NO_DEVICE, "cpu")
    keep: Any = "all"
    statistics: Sequence[Any] = ()
    until: Any = None

    def __post_init__(self) -> None:
        faults = Faults("run.")
        with faults.including():
            object.__setattr__(self, "keep", read_keep("run.keep", self.keep))
        if self.save_fields is not None:
            from lgvi_warp.control.signals import check_names

            object.__setattr__(self, "save_fields", check_names(faults, "save_fields", self.save_fields))
        # Most scenes have neither statistics nor a stopping rule: their import is a quarter of that of a scene.
        if self.statistics or not isinstance(self.statistics, tuple):
            from lgvi_warp.statistics.base import from_list

            with faults.including():
                object.__setattr__(self, "statistics", from_list(self.statistics, "run.statistics"))
        if self.until is not None:
            from lgvi_warp.statistics import until

            with faults.including():
                object.__setattr__(self, "until", until.from_dict(self.until))
        read(self, faults)
        if isinstance(self.method, str | None):
            with faults.including():
                try:
                    self.method_of(self.method)
                except SceneError as error:
                    raise error.prefixed("run.") from None
        faults.raise_if_any()

    def method_of(self, name: str | None = None) -> Method:
        """The method of this section with its options, by default "psi_s"; or the method `name` with default options."""
        set_here = Method.name if self.method is None else self.method
        if name is not None and not among(name, (set_here,)):
            return Method(name)
        return Method(set_here, **self.method_options)

    @property
    def method_options(self) -> dict[str, Any]:
        """The method options that this section gives, by name."""
        options = {key: getattr(self, key) for key in ("solver", "iterations", "tolerance", "rtol", "atol")}
        return {key: value for key, value in options.items() if value is not None}

    def to_dict(self) -> dict[str, Any]:
        """The section [run] of a scene file: dtype and every setting that differs from its default, by name."""
        names = {"dtype"}
        for setting in fields(self):
            value = getattr(self, setting.name)
            if not isinstance(value, type(setting.default)) or value != setting.default:
                names.add(setting.name)
        content = {key: value for key, value in vars(self).items() if key in names}
        if "statistics" in content:
            content["statistics"] = [statistic.to_dict() for statistic in self.statistics]
        if "until" in content:
            content["until"] = self.until.to_dict()
        if "save_fields" in content:
            content["save_fields"] = list(content["save_fields"])
        return content


@dataclass(frozen=True)
class EnsembleSettings:
    """The section [ensemble] of a scene file.

    Args:
        members: Number of members, from 1 to 2**31; by default the number is chosen as in Ensemble.
        seed: Whole number from 0; by default 0.
        vary: {name of a number: distribution}, as in Ensemble; by default nothing varies.
        sampling: Design of the points: a name, an object such as lw.designs.Grid(...), or a table; by default "random".
        indices: Indices of the members to run; None for all (default).

    Raises:
        SceneError: If a setting is invalid; the message lists every fault.
    """

    members: int | None = whole(1, "is not a whole number from 1", "give 1 or more", None)
    seed: int = whole(0, "is not a whole number from 0", "give 0 or more", 0)
    vary: Mapping[str, Any] = field(default_factory=dict)
    sampling: Any = "random"
    indices: Any = None

    def __post_init__(self) -> None:
        faults = Faults("ensemble.")
        if (read(self, faults)["members"] or 0) > MOST_MEMBERS:
            problem = f"are more members than the {MOST_MEMBERS} that there can be"
            faults.add("members", self.members, problem, f"give {MOST_MEMBERS} or less")
        if self.indices is not None:
            with faults.including():
                count = self.members if is_whole(self.members, 1) else None
                chosen = members_of("ensemble.indices", self.indices, count)
                object.__setattr__(self, "indices", chosen.tolist())
        if isinstance(self.vary, Mapping):
            named = {", ".join(key) if isinstance(key, tuple) else key: value for key, value in self.vary.items()}
            for key, distribution in named.items():
                with faults.including():
                    named[key] = distributions.as_distribution(f'vary."{key}"', distribution)
            object.__setattr__(self, "vary", named)
        with faults.including():
            object.__setattr__(self, "sampling", sampling_of(self.sampling))
        faults.raise_if_any()

    def to_dict(self) -> dict[str, Any]:
        """The section [ensemble] of a scene file: the seed and every setting that differs from its default, by name."""
        return section(self.members, self.seed, self.vary, self.sampling, self.indices)


def section(
    members: int | None, seed: int, vary: Mapping[str, Any], sampling: Sampling, indices: Any
) -> dict[str, Any]:
    """Return the section [ensemble] of a scene file for checked settings."""
    content: dict[str, Any] = {} if members is None else {"members": int(members)}
    content["seed"] = int(seed)
    if vary:
        content["vary"] = {name: distribution.to_dict() for name, distribution in vary.items()}
    if sampling.kind != "random":
        content["sampling"] = sampling.to_dict()
    return content | ({} if indices is None else {"indices": np.asarray(indices).tolist()})
