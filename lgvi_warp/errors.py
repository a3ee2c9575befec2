"""Faults of a scene: all of them in one message, each with its key, its value and the remedy."""

from __future__ import annotations

import contextlib
import difflib
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np


class SceneError(ValueError):
    """A scene, an ensemble or a setting that is refused. `faults` holds one text per fault."""

    def __init__(self, faults: Iterable[str]):
        self.faults = tuple(faults)
        head = "" if len(self.faults) == 1 else f"{len(self.faults)} faults:\n  "
        super().__init__(head + "\n  ".join(self.faults))

    def __reduce__(self) -> tuple[Any, ...]:
        """Made again from its faults, in the process that asked."""
        return SceneError, (self.faults,)


class MembersFailed(RuntimeError):  # noqa: N818
    """Members failed in a run with on_failure="raise". `result` holds all that the run came to: nothing is lost."""

    def __init__(self, text: str, result: Any):
        super().__init__(text)
        self.result = result


class Interrupted(KeyboardInterrupt):
    """A run in memory was interrupted. `result` holds the members that were finished: nothing of them is lost."""

    def __init__(self, text: str, result: Any):
        super().__init__(text)
        self.result = result


class NothingToDraw(ValueError):  # noqa: N818
    """A picture that would be empty: the message says why."""


class MissingExtra(ImportError):  # noqa: N818
    """A library that is not installed, of one of the package's extras.

    Args:
        what: What needs it, as "plots".
        library: Its name as pip knows it.
        extra: The extra of lgvi-warp that brings it.
    """

    def __init__(self, what: str, library: str, extra: str):
        super().__init__(f"{what} need {library}: pip install 'lgvi-warp[{extra}]'", name=library)
        self.library, self.extra = library, extra


def closest(word: str, known: Iterable[str]) -> str:
    """ "did you mean ..." or the list of what is known."""
    names = [str(name) for name in known]
    near = [name for name in names if name.endswith(f".{word}")]
    near = near or difflib.get_close_matches(str(word), names, n=1, cutoff=0.6)
    return f"did you mean {near[0]!r}?" if near else f"known: {', '.join(names)}"


def shown(value: Any) -> str:
    """A value on one line, cut where it is long."""
    text = " ".join(repr(value.tolist() if isinstance(value, np.ndarray | np.generic) else value).split())
    return text if len(text) <= 80 else text[:77] + "..."


def holds_bool(value: Any) -> bool:
    """Whether a truth value hides among numbers: [true, 1.0] would pass for [1.0, 1.0]."""
    return isinstance(value, bool) or (isinstance(value, list | tuple) and any(holds_bool(item) for item in value))


def ragged(value: Any) -> bool:
    """Whether lists within lists differ in length, so that NumPy makes no array of them."""
    try:
        np.asarray(value)
    except ValueError:
        return True
    return False


class Faults:
    """Collects faults, so that a user sees all of them at once."""

    def __init__(self, prefix: str = ""):
        self._prefix, self._found = prefix, list[str]()

    def add(self, key: str, value: Any, what: str, remedy: str) -> None:
        """Note a fault: key = value: what is wrong; how to mend it."""
        self._found.append(f"{self._prefix}{key} = {shown(value)}: {what}; {remedy}")

    @contextlib.contextmanager
    def including(self) -> Iterator[None]:
        """Take over the faults that are raised inside, and go on."""
        try:
            yield
        except SceneError as error:
            self._found.extend(error.faults)

    def raise_if_any(self) -> None:
        """Raise SceneError with every fault noted."""
        if self._found:
            raise SceneError(self._found)

    def choice(self, key: str, value: Any, known: Iterable[Any]) -> bool:
        """The value must be one of those known."""
        known = list(known)
        good = any(value == k and type(value) is type(k) for k in known)
        if not good:
            self.add(key, value, "is not known", closest(value, known))
        return good

    def keys(self, key: str, given: Iterable[str], known: Iterable[str]) -> None:
        """Every given key must be one of those known; a mapping's values are shown."""
        known = list(known)
        for name in given:
            if name not in known:
                value = given[name] if isinstance(given, Mapping) else "..."
                self.add(f"{key}.{name}" if key else name, value, "is an unknown key", closest(name, known))

    def finite(self, key: str, value: Any, shape: tuple[int, ...] | None = None, unit: str = "") -> np.ndarray | None:
        """A finite float64 array, of this shape if one is given; None after noting a fault."""
        wanted = "a number" if shape == () else f"numbers of shape {shape}" if shape else "numbers"
        remedy = f"give {wanted}" + (f" [{unit}]" if unit else "")
        try:
            array = np.array(value)
            if array.dtype.kind not in "iuf" or holds_bool(value):
                raise ValueError
            array = array.astype(np.float64)
        except (ValueError, TypeError):
            self.add(key, value, "is not numeric", remedy)
            return None
        if shape is not None and array.shape != shape:
            self.add(key, value, f"has shape {array.shape}", remedy)
        elif not np.all(np.isfinite(array)):
            self.add(key, value, "is not finite", remedy)
        else:
            array.setflags(write=False)
            return array
        return None

    def number(self, key: str, value: Any, unit: str = "", least: float = -np.inf) -> float | None:
        """A finite number not below `least`; None after noting a fault."""
        array = self.finite(key, value, (), unit)
        if array is None:
            return None
        if array < least:
            self.add(key, value, f"is below {least:g}", f"give a number [{unit}] from {least:g}")
            return None
        return float(array)

    def positive(self, key: str, value: Any, unit: str = "s") -> float | None:
        """A finite number above 0; None after noting a fault."""
        array = self.finite(key, value, (), unit)
        if array is not None and array <= 0.0:
            self.add(key, value, "is not positive", f"give a number above 0 [{unit}]")
            return None
        return None if array is None else float(array)

    def symmetric(self, key: str, value: Any, unit: str, size: int = 3) -> np.ndarray | None:
        """A symmetric matrix, or the diagonal of one; None after noting a fault."""
        if ragged(value):
            array = np.zeros(0)
        else:
            array = np.asarray(value, dtype=object) if isinstance(value, list | tuple) else np.asarray(value)
        if array.shape == (size,):
            diagonal = self.finite(key, value, (size,), unit)
            return None if diagonal is None else np.diag(diagonal)
        if array.shape != (size, size):
            wanted = f"{size} numbers or a symmetric {size}x{size} matrix [{unit}]"
            what = f"has shape {array.shape}" if array.size else "is no matrix"
            self.add(key, value, what, f"give {wanted}")
            return None
        matrix = self.finite(key, value, (size, size), unit)
        if matrix is None:
            return None
        if np.abs(matrix - matrix.T).max() > 1e-9 * np.abs(matrix).max():
            self.add(key, value, "is not symmetric", "give a symmetric matrix")
            return None
        # What is symmetric keeps its bits, subnormal and largest numbers too.
        return np.where(matrix == matrix.T, matrix, 0.5 * matrix + 0.5 * matrix.T)

    def __bool__(self) -> bool:
        """Whether a fault was noted."""
        return bool(self._found)
