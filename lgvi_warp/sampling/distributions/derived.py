# SPDX-License-Identifier: Apache-2.0
"""Numbers that custom functions compute from a few random factors."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.common.real_numbers import NotReal, real_results
from lgvi_warp.sampling.distributions.basic import Distribution
from lgvi_warp.sampling.distributions.joint import JointLaw
from lgvi_warp.sampling.distributions.named import as_distribution


class Derived(JointLaw):
    """Numbers computed from one or a few random factors: vary = {"drag.quadratic": Derived({...}, k=...)}.

    The key in `vary` lists the same numbers as `functions`, such as "drag.linear, drag.quadratic". A file cannot store
    functions: to use a run that was read from a file, give the ensemble again.

    Args:
        functions: Name of a number -> function that returns the number of each member. Arguments of the function have
            names of factors. Each is an array, shaped so that it can be multiplied by the scene's value of the number.
        factors: Distribution of each factor, for a single number. Where a distribution otherwise uses the scene's value
            (for example as its mean), it uses 1 here.

    Raises:
        SceneError: If an entry is not a function or not a distribution, or if an argument of a function is not a
            factor.

    Examples:
        >>> import lgvi_warp as lw
        >>> import numpy as np
        >>> drag = lw.terms.Drag(linear=np.ones(6), quadratic=np.full(6, 10.0))
        >>> scene = lw.Scene.named("sphere", terms=[drag])
        >>> both = {"drag.linear": lambda k: k * np.ones(6), "drag.quadratic": lambda k: k * np.full(6, 10.0)}
        >>> law = lw.distributions.Derived(both, k=lw.distributions.Uniform(low=0.9, high=1.1))
        >>> drawn = lw.Ensemble(scene, members=4, vary={"drag.linear, drag.quadratic": law}).parameters(0, 4)
        >>> bool(np.allclose(drawn["drag.quadratic"], 10.0 * drawn["drag.linear"]))
        True
    """

    kind: ClassVar[str] = "derived"
    several: ClassVar[bool] = True

    def __init__(self, functions: Mapping[str, Callable[..., Any]], **factors: Any):
        faults = Faults(f"{self.kind}.")
        if not isinstance(functions, Mapping) or not functions:
            faults.add(
                "functions", functions, "are not functions by name", 'give {"drag.quadratic": lambda k: k * base}'
            )
            faults.raise_if_any()
        if not factors:
            faults.add("factors", None, "are missing", "give k=lw.distributions.Normal(...)")
        laws = {}
        for name, value in factors.items():
            with faults.including():
                law = laws[name] = as_distribution(f"{self.kind}.{name}", value)
                if not isinstance(law, Distribution) or law.joint:
                    remedy = "give one of a single number, such as lw.distributions.Normal(std=0.1)"
                    faults.add(name, value, "is not a distribution of a single number", remedy)
        for name, function in functions.items():
            if not callable(function):
                faults.add(f'"{name}"', function, "is not a function", "give one, such as lambda k: k * base")
        takes = {name: _arguments(faults, name, function, laws) for name, function in functions.items()}
        faults.raise_if_any()
        for name, value in (("functions", dict(functions)), ("factors", laws), ("_takes", takes)):
            object.__setattr__(self, name, value)

    def __eq__(self, other: object) -> bool:
        return self is other

    __hash__ = object.__hash__

    functions: dict[str, Callable[..., Any]]
    factors: dict[str, Distribution]
    _takes: dict[str, list[str]]

    def ordered_as(self, labels: Sequence[str]) -> Derived:
        by_name = {name.replace(" ", ""): name for name in self.functions}
        wanted = [label.replace(" ", "") for label in labels]
        if sorted(by_name) != sorted(wanted):
            faults, known = Faults(f"{self.kind}."), ", ".join(self.functions)
            faults.add(
                "functions", known, f"are not of what varies, {', '.join(labels)}", "name the same numbers in both"
            )
            faults.raise_if_any()
        return Derived({by_name[label]: self.functions[by_name[label]] for label in wanted}, **self.factors)

    @property
    def own(self) -> Any:
        return tuple(self.functions.values()), tuple(law.own for law in self.factors.values())

    def fault(self, shapes: Sequence[tuple[int, ...]]) -> tuple[str, str] | None:
        if len(shapes) != len(self.functions):
            return f"has {len(self.functions)} functions, and {len(shapes)} numbers are named", "give one for each"
        for name, law in self.factors.items():
            if (wrong := law.fault([()])) is not None:
                return f"has a factor {name} that {wrong[0]}", wrong[1]
        return None

    def size(self, bases: Sequence[np.ndarray]) -> int:
        # One uniform number for each factor.
        return len(self.factors)

    def draw(self, u: np.ndarray, bases: Sequence[np.ndarray]) -> list[np.ndarray]:
        drawn = {name: law.quantile(u[:, i], np.array(1.0)) for i, (name, law) in enumerate(self.factors.items())}
        return [self._values(name, drawn, base) for name, base in zip(self.functions, bases, strict=True)]

    def _values(self, name: str, drawn: Mapping[str, np.ndarray], base: np.ndarray) -> np.ndarray:
        """The numbers (n, *shape) of one name."""
        n = len(next(iter(drawn.values())))
        arguments = {factor: drawn[factor].reshape(n, *[1] * base.ndim) for factor in self._takes[name]}
        faults = Faults(f"{self.kind}.")
        try:
            values = real_results(self.functions[name](**arguments)).astype(np.float64)
            return np.array(np.broadcast_to(values, (n, *base.shape)))
        except NotReal as error:
            faults.add(f'"{name}"', "...", error.what, "return an array of real numbers")
        except ValueError:
            wanted = f"({n}, {', '.join(map(str, base.shape))})".replace(", )", ",)")
            faults.add(
                f'"{name}"', "...", f"gave an array of shape {np.shape(values)}", f"return one of shape {wanted}"
            )
        faults.raise_if_any()
        raise AssertionError

    def to_dict(self) -> dict[str, Any]:
        names = {name: getattr(f, "__name__", type(f).__name__) for name, f in self.functions.items()}
        return {self.kind: {"functions": names} | {name: law.to_dict() for name, law in self.factors.items()}}


def _arguments(faults: Faults, name: str, function: Any, factors: Mapping[str, Any]) -> list[str]:
    """The factors that are arguments of a function, by name."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return list(factors)
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters):
        return list(factors)
    taken = [parameter.name for parameter in parameters if parameter.name in factors]
    for parameter in parameters:
        if parameter.name not in factors and parameter.default is parameter.empty:
            known = ", ".join(factors)
            faults.add(
                f'"{name}"',
                parameter.name,
                f"is not a factor, of {known}",
                "name arguments like factors: lambda k: ...",
            )
    return taken
