# SPDX-License-Identifier: Apache-2.0
"""Functions and classes that refuse an unknown keyword and suggest the nearest known one; NumPy is not imported."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

from lgvi_warp.common.sentences import capital

F = TypeVar("F", bound=Callable[..., Any])

# Of the flags of a function's code: it takes any keyword.
CO_VARKEYWORDS = 8
# Where the constructor of a class says for which one it checks keywords.
MARK = "_checks_keywords_of"
# Names of arguments in other packages, and what they are called here.
ELSEWHERE = {
    "h": ("dt", "step", "stepsize", "step_size", "timestep", "time_step", "delta_t"),
    "t1": ("duration", "end", "t_end", "t_final", "tf", "tmax", "t_max", "stop", "horizon"),
    "members": ("n", "size", "count", "samples", "n_members", "n_samples"),
    "fleet": ("ensemble", "scene"),
    "of": ("quantity", "output", "outputs"),
    "save": ("saveat", "save_at", "every"),
}


def near_names(*takers: Callable[..., Any]) -> Callable[[F], F]:
    """Decorator: the function refuses an unknown keyword and suggests the nearest known one.

    takers: Functions that receive its `**settings`.
    """

    def decorate(call: F) -> F:
        names = arguments_of(call, *takers)
        if names is None:
            return call
        known = frozenset(names)

        @functools.wraps(call)
        def wrapper(*args: Any, **settings: Any) -> Any:
            if not known.issuperset(settings):
                refuse_unknown(call, settings, names)
            return call(*args, **settings)

        return wrapper  # type: ignore[return-value]

    return decorate


def near_keywords(kind: type) -> None:
    """Make a public class refuse an unknown keyword with the nearest known one, as functions do; once, at first use."""
    init = kind.__init__  # type: ignore[misc]
    # One that Python's own classes have takes no keywords by name: of an enumeration, or where a tuple has names.
    if not hasattr(init, "__code__") or getattr(init, MARK, None) is kind or (names := arguments_of(init)) is None:
        return
    known = frozenset(names)

    @functools.wraps(init)
    def wrapper(self: Any, *args: Any, **settings: Any) -> None:
        # A subclass has keywords of its own, which it hands on.
        if type(self) is kind and not known.issuperset(settings):
            refuse_unknown(kind, settings, names)
        init(self, *args, **settings)

    setattr(wrapper, MARK, kind)
    kind.__init__ = wrapper  # type: ignore[misc]


def arguments_of(*functions: Any) -> tuple[str, ...] | None:
    """Keywords of functions, the first of which passes its `**settings` on; None if the last one takes any keyword."""
    names = dict[str, None]()
    for function in functions:
        while hasattr(function, "__wrapped__"):
            function = function.__wrapped__
        code = function.__code__
        names |= dict.fromkeys(code.co_varnames[code.co_posonlyargcount : code.co_argcount + code.co_kwonlyargcount])
    any_word = code.co_flags & CO_VARKEYWORDS
    return None if any_word else tuple(name for name in names if name not in {"self", "cls"})


def refuse_unknown(call: Any, settings: Iterable[str], names: Iterable[str] | None) -> None:
    """Raise a SceneError, which is also a TypeError, for the first unknown keyword."""
    from lgvi_warp.common.errors import UnknownArgument
    from lgvi_warp.common.nearest import nearest

    names = tuple(names or ())
    word = next(name for name in settings if name not in names)
    meant = next((name for name in names if word.casefold() in ELSEWHERE.get(name, ())), None) or nearest(word, names)
    remedy = f"did you mean {meant!r}?" if meant else f"known: {', '.join(names)}"
    raise UnknownArgument([f"{call.__qualname__}() got an unexpected keyword argument {word!r}. {capital(remedy)}"])
