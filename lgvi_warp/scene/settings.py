"""To be said in one sentence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.machine import DTYPES
from lgvi_warp.common.real_numbers import holds_words
from lgvi_warp.common.status import CHECKS, ON_FAILURE
from lgvi_warp.methods.method import Method
from lgvi_warp.sampling.designs import sampling_of
from lgvi_warp.sampling.distributions import named as laws
from lgvi_warp.statistics import until as stopping
from lgvi_warp.statistics.base import from_list

# Of one ensemble, whatever its sampling: a kernel keys a member's noise by its index in a signed word of 32 bits.
MOST_MEMBERS = 2**31


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
            object.__setattr__(self, "statistics", from_list(self.statistics, "run.statistics"))
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
