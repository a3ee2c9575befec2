# SPDX-License-Identifier: Apache-2.0
"""Faults of a scene, collected into one message: each with its key, its value and its remedy."""

from __future__ import annotations

import contextlib
import functools
import math
import reprlib
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from lgvi_warp.common.real_numbers import NotReal, holds_words, plain, real_numbers
from lgvi_warp.common.sentences import sentences, with_stop

# Most faults in one message; the rest are only counted, since a file may have a million of them.
MOST_FAULTS = 20
# Characters kept of a long fault: its beginning, and its end, which has the remedy.
HEAD, END = 1500, 500
# Most characters of a value, and of a name, in a message.
LONGEST_VALUE, LONGEST_NAME = 80, 200


class SceneError(ValueError):
    """Raised if a scene, an ensemble or a setting is refused; the message lists every fault and its remedy.

    Args:
        faults: One text per fault. If there are more than 20 texts, the first 20 are kept.
        more: Number of further faults without a text; 0 by default.

    Attributes:
        faults: The texts that are kept, each on one line.
        more: Number of faults without a text in `faults`.

    Examples:
        >>> import lgvi_warp as lw
        >>> try:
        ...     lw.Vehicle(mass=-1.0, inertia=[0.1, 0.1, 0.1])
        ... except lw.SceneError as error:
        ...     print(error)
        vehicle.mass = -1.0 is not positive. Give a number above 0 [kg].
    """

    def __init__(self, faults: Iterable[str], more: int = 0):
        texts = list(faults)
        self.faults = tuple(with_stop(one_line(fault)) for fault in texts[:MOST_FAULTS])
        self.more = more + len(texts) - len(self.faults)
        count = len(self.faults) + self.more
        lines = [f"{count:,} faults:"] * (count != 1) + list(self.faults)
        super().__init__("\n  ".join(lines + [f"and {self.more:,} more"] * (self.more > 0)))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the faults, so that another process can raise the same error."""
        return type(self), (self.faults, self.more), vars(self)

    def prefixed(self, prefix: str) -> SceneError:
        """Return the same faults with a prefix that says where they are.

        Args:
            prefix: Text to put before each fault.

        Returns:
            A new error; this error is not changed.
        """
        return SceneError((f"{prefix}{fault}" for fault in self.faults), self.more)


def refusal(key: str, value: Any, problem: str, remedy: str) -> SceneError:
    """Make the error of a single fault."""
    return SceneError([sentences(f"{cut(key)} = {brief(value)}", problem, remedy)])


class NoSuchMembers(SceneError, IndexError):  # noqa: N818
    """Raised for members that a run or an ensemble does not have."""


class UnknownArgument(SceneError, TypeError):  # noqa: N818
    """Raised for an unknown keyword argument of a function or a class."""


class MembersFailed(RuntimeError):  # noqa: N818
    """Raised if members failed in a run with on_failure="raise"; the result of the run is kept.

    Args:
        text: The message.
        result: The whole `Result` of the run, kept as an attribute.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=8, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> fast = scene.with_numbers({"start.angular_velocity": [0.0, 900.0, 0.0]})
        >>> try:
        ...     lw.solve(fast, "rk4", h=0.1, t1=2.0, on_failure="raise")
        ... except lw.MembersFailed as error:
        ...     error.result.status.counts()
        {'non_finite': 1}
    """

    def __init__(self, text: str, result: Any):
        super().__init__(text)
        self.result = result

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the result with the text, so that another process can raise the same error."""
        return type(self), (str(self), self.result), vars(self)


class Interrupted(KeyboardInterrupt):
    """Raised if a run in memory was interrupted; its finished members are kept.

    Args:
        text: The message.
        result: The `Result` of the finished members, kept as an attribute.
    """

    def __init__(self, text: str, result: Any):
        super().__init__(text)
        self.result = result

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the result with the text, so that another process can raise the same error."""
        return type(self), (str(self), self.result), vars(self)


class NothingToDraw(ValueError):  # noqa: N818
    """Raised if a picture would be empty; the message says why."""


# Whether the package is on the package index: as pyproject.toml says (tests/house/test_published.py).
PUBLISHED = False


def install(extra: str) -> str:
    """Command that installs an extra, from the package index or from a clone."""
    return f"pip install 'lgvi-warp[{extra}]'" if PUBLISHED else f"in the clone of lgvi_warp, pip install '.[{extra}]'"


class MissingExtra(ImportError):  # noqa: N818
    """Raised if a library of one of the package's extras is not installed."""

    def __init__(self, purpose: str, library: str, extra: str):
        super().__init__(f"{purpose} need {library}: {install(extra)}", name=library)
        self.what, self.library, self.extra = purpose, library, extra

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the parts of the message, so that another process can raise the same error."""
        return type(self), (self.what, self.library, self.extra), vars(self)


# Most known names in one message.
MOST_KNOWN = 60


def closest(word: Any, known: Iterable[str]) -> str:
    """Suggest the known name nearest to a word."""
    from lgvi_warp.common.nearest import meant  # loaded where something is wrong

    names = tuple(map(str, known))
    near = meant(word[:LONGEST_VALUE] if isinstance(word, str) else brief(word), names)
    more = f" and {len(names) - MOST_KNOWN:,} more" if len(names) > MOST_KNOWN else ""
    return near or f"known: {', '.join(names[:MOST_KNOWN])}{more}"


def among(value: Any, known: Iterable[Any]) -> bool:
    """Tell whether a value, which may be of any type, is one of the known values."""
    kind = str if isinstance(value, np.str_) else type(value)
    return any(kind is type(k) and value == k for k in known)


class _Brief(reprlib.Repr):
    """repr() of a value, with bounded length, memory and time even for very large values."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel = 12
        self.maxlist = self.maxtuple = self.maxdict = self.maxset = self.maxfrozenset = LONGEST_VALUE
        self.maxstring = self.maxother = 4 * LONGEST_VALUE

    def repr_dict(self, x: dict[Any, Any], level: int) -> str:
        """Show a dict in the user's order; reprlib would sort it."""
        if level <= 0:
            return "{...}"
        items = [f"{self.repr1(k, level - 1)}: {self.repr1(x[k], level - 1)}" for k, _ in zip(x, range(self.maxdict))]  # noqa: B905
        return "{" + ", ".join(items + ["..."] * (len(x) > self.maxdict)) + "}"

    def repr_str(self, x: str, level: int) -> str:
        """Show the beginning of a text."""
        return repr(x[: self.maxstring])

    def repr_int(self, x: int, level: int) -> str:
        """Show a whole number, or only its number of digits: Python refuses to print thousands of digits."""
        digits = round(x.bit_length() * 0.30103)
        return repr(x) if x.bit_length() < 1000 else f"<a whole number of about {digits} digits>"


_brief = _Brief()


def brief(value: Any) -> str:
    """Show any value on one line of a message: its repr, cut after 80 characters."""
    if isinstance(value, np.ndarray):
        value = value[tuple(slice(LONGEST_VALUE) for _ in value.shape)].tolist()
    elif isinstance(value, np.generic):
        value = value.item()
    text = " ".join(_brief.repr(value).split())
    return text if len(text) <= LONGEST_VALUE else text[: LONGEST_VALUE - 3] + "..."


def cut(name: Any) -> str:
    """Shorten a name for a message, since a file may contain a name of any length."""
    text = name if isinstance(name, str) else brief(name)
    return text if len(text) <= LONGEST_NAME else f"{text[:LONGEST_NAME]}..."


def one_line(fault: str) -> str:
    """Convert a fault to one printable line of limited length.

    A file may contain line ends, or control codes that a terminal would execute.
    """
    return printable(fault if len(fault) <= HEAD + END else f"{fault[:HEAD]} ... {fault[-END:]}")


def printable(text: str, kept: str = "") -> str:
    """Show control characters, which a terminal would execute, as text."""
    return text if text.isprintable() else "".join(c if c.isprintable() or c in kept else ascii(c)[1:-1] for c in text)


def ragged(value: Any) -> bool:
    """Tell whether nested lists have different lengths, so that NumPy makes no array of them."""
    try:
        np.asarray(value)
    except ValueError:
        return True
    return False


class Faults:
    """Collects faults, so that a user sees all of them at once."""

    def __init__(self, prefix: str = ""):
        self._prefix, self._found, self._more = prefix, list[str](), 0

    def add(self, key: str, value: Any, problem: str, remedy: str | Callable[[], str]) -> None:
        """Add one fault, as the sentence "key = value problem. Remedy"."""
        if len(self._found) >= MOST_FAULTS:
            self._more += 1
            return
        words = remedy if isinstance(remedy, str) else remedy()
        self._found.append(sentences(f"{self._prefix}{cut(key)} = {brief(value)}", problem, words))

    @contextlib.contextmanager
    def including(self) -> Iterator[None]:
        """Add the faults of a SceneError raised inside the `with` block, and continue after it."""
        try:
            yield
        except SceneError as error:
            room = MOST_FAULTS - len(self._found)
            self._found.extend(error.faults[:room])
            self._more += error.more + len(error.faults[room:])

    def raise_if_any(self) -> None:
        """Raise all collected faults at once."""
        if self._found:
            raise SceneError(self._found, self._more)

    def choice(self, key: str, value: Any, known: Iterable[Any]) -> bool:
        """Check that a value is allowed; add a fault otherwise."""
        # Of tables that extensions add to no list is made where the value is in them.
        looked_up = isinstance(known, Container) and not isinstance(known, Sequence)
        good = looked_up and isinstance(value, str) and value in known
        good = good or among(value, known := list(known))
        if not good:
            self.add(key, value, "is not known", lambda: closest(value, known))
        return good

    def keys(self, key: str, keys: Iterable[str], known: Iterable[str]) -> None:
        """Check that every key is allowed; add a fault for each other key."""
        known = list(known)
        for name in keys:
            if name not in known:
                value = keys[name] if isinstance(keys, Mapping) else "..."
                remedy = functools.partial(closest, name, known)
                self.add(f"{key}.{name}" if key else name, value, "is an unknown key", remedy)

    def real(self, key: str, value: Any, remedy: str = "give numbers") -> np.ndarray | None:
        """Read real numbers, which may be NaN, as a new float64 array; None after adding a fault."""
        try:
            return real_numbers(value)
        except NotReal as error:
            self.add(key, value, error.what, error.remedy or remedy)
            return None

    def finite(self, key: str, value: Any, shape: tuple[int, ...] | None = None, unit: str = "") -> np.ndarray | None:
        """Read finite numbers, of a given shape or of any, as a read-only float64 array; None after adding a fault."""
        wanted = "a number" if shape == () else f"numbers of shape {shape}" if shape else "numbers"
        remedy = f"give {wanted}" + (f" [{unit}]" if unit else "")
        array = self.real(key, value, remedy)
        if array is None:
            return None
        if shape is not None and array.shape != shape:
            self.add(key, value, f"has shape {array.shape}", remedy)
        elif not np.all(np.isfinite(array)):
            self.add(key, value, "is not finite", remedy)
        else:
            array.setflags(write=False)
            return array
        return None

    def number(
        self, key: str, value: Any, unit: str = "", least: float = -np.inf, most: float = np.inf
    ) -> float | None:
        """Read one finite number from `least` to `most`; None after adding a fault."""
        array = self.finite(key, value, (), unit)
        if array is None:
            return None
        if least <= array <= most:
            return float(array)
        problem = f"is below {least:g}" if array < least else f"is above {most:g}"
        bounds = (f" {word} {bound:g}" for word, bound in (("from", least), ("to", most)) if math.isfinite(bound))
        self.add(key, value, problem, "give a number" + (f" [{unit}]" if unit else "") + "".join(bounds))
        return None

    def positive(self, key: str, value: Any, unit: str = "s") -> float | None:
        """Read one finite number above 0; None after adding a fault."""
        if type(value) is float and 0.0 < value < math.inf:
            return value
        array = self.finite(key, value, (), unit)
        if array is not None and array <= 0.0:
            self.add(key, value, "is not positive", f"give a number above 0 [{unit}]")
            return None
        return None if array is None else float(array)

    def symmetric(self, key: str, value: Any, unit: str, size: int = 3) -> np.ndarray | None:
        """Read an exactly symmetric float64 matrix, or the diagonal of a diagonal matrix; None after adding a fault."""
        value = plain(value)
        if holds_words(value):
            self.finite(key, value, (size,), unit)  # notes the fault
            return None
        if ragged(value):
            array = np.zeros(0)
        else:
            array = np.asarray(value, dtype=object) if isinstance(value, list | tuple) else np.asarray(value)
        if array.shape == (size,):
            diagonal = self.finite(key, value, (size,), unit)
            return None if diagonal is None else np.diag(diagonal)
        if array.shape != (size, size):
            wanted = f"{size} numbers or a symmetric {size}x{size} matrix [{unit}]"
            problem = f"has shape {array.shape}" if array.size else "is not a matrix"
            self.add(key, value, problem, f"give {wanted}")
            return None
        matrix = self.finite(key, value, (size, size), unit)
        if matrix is None:
            return None
        if np.abs(matrix - matrix.T).max() > 1e-9 * np.abs(matrix).max():
            self.add(key, value, "is not symmetric", "give a symmetric matrix")
            return None
        # Symmetric entries keep their bits, also where halving would underflow or the sum overflow.
        return np.where(matrix == matrix.T, matrix, 0.5 * matrix + 0.5 * matrix.T)

    def __bool__(self) -> bool:
        """Tell whether a fault was added."""
        return bool(self._found)
