"""Faults of a scene: all of them in one message, each with its key, its value and the remedy."""

from __future__ import annotations

import contextlib
import difflib
import functools
import reprlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from lgvi_warp.common.real_numbers import NotReal, holds_words, real_numbers

# So many faults are said one by one, the rest are counted: a file may have a million of them.
MOST_FAULTS = 20
# Characters of one fault: its head, and its end, which has the remedy.
HEAD, END = 1500, 500
# Characters of a value, and of a name, in a message.
LONGEST_VALUE, LONGEST_NAME = 80, 200


class SceneError(ValueError):
    """A scene, an ensemble or a setting that is refused.

    Args:
        faults: One text per fault. Of more than 20 the first 20 are kept.
        more: How many there are besides.

    `faults` holds the texts, each on one line; `more` how many there are that it does not hold.
    """

    def __init__(self, faults: Iterable[str], more: int = 0):
        every = list(faults)
        self.faults = tuple(one_line(fault) for fault in every[:MOST_FAULTS])
        self.more = more + len(every) - len(self.faults)
        count = len(self.faults) + self.more
        lines = [f"{count:,} faults:"] * (count != 1) + list(self.faults)
        super().__init__("\n  ".join(lines + [f"and {self.more:,} more"] * (self.more > 0)))

    def __reduce__(self) -> tuple[Any, ...]:
        """Made again from its faults, in the process that asked."""
        return SceneError, (self.faults, self.more)

    def prefixed(self, prefix: str) -> SceneError:
        """The same faults, each with a word before it that says where."""
        return SceneError((prefix + fault for fault in self.faults), self.more)


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


# So many of the names that are known are said.
MOST_KNOWN = 60


def closest(word: Any, known: Iterable[str]) -> str:
    """ "did you mean ..." or the list of what is known."""
    names = [str(name) for name in known]
    text = word[:LONGEST_VALUE] if isinstance(word, str) else shown(word)
    near = [name for name in names if name.endswith(f".{text}")]
    near = near or difflib.get_close_matches(text, names, n=1, cutoff=0.6)
    more = f" and {len(names) - MOST_KNOWN:,} more" if len(names) > MOST_KNOWN else ""
    return f"did you mean {near[0]!r}?" if near else f"known: {', '.join(names[:MOST_KNOWN])}{more}"


class _Brief(reprlib.Repr):
    """repr() of a value of any size, as long as a message shows of it: neither memory nor time grow with the value."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel = 12
        self.maxlist = self.maxtuple = self.maxdict = self.maxset = self.maxfrozenset = LONGEST_VALUE
        self.maxstring = self.maxother = 4 * LONGEST_VALUE

    def repr_dict(self, x: dict[Any, Any], level: int) -> str:
        """In the order of the user, which reprlib sorts."""
        if level <= 0:
            return "{...}"
        items = [f"{self.repr1(k, level - 1)}: {self.repr1(x[k], level - 1)}" for k, _ in zip(x, range(self.maxdict))]  # noqa: B905
        return "{" + ", ".join(items + ["..."] * (len(x) > self.maxdict)) + "}"

    def repr_str(self, x: str, level: int) -> str:
        """From its beginning."""
        return repr(x[: self.maxstring])

    def repr_int(self, x: int, level: int) -> str:
        """Python writes no whole number of more than some thousand digits."""
        return (
            repr(x) if x.bit_length() < 1000 else f"<a whole number of about {round(x.bit_length() * 0.30103)} digits>"
        )


_brief = _Brief()


def shown(value: Any) -> str:
    """A value on one line, cut where it is long."""
    if isinstance(value, np.ndarray):
        value = value[tuple(slice(LONGEST_VALUE) for _ in value.shape)].tolist()
    elif isinstance(value, np.generic):
        value = value.item()
    text = " ".join(_brief.repr(value).split())
    return text if len(text) <= LONGEST_VALUE else text[: LONGEST_VALUE - 3] + "..."


def cut(name: Any) -> str:
    """A name in a message, which a file may have written without end."""
    text = name if isinstance(name, str) else shown(name)
    return text if len(text) <= LONGEST_NAME else f"{text[:LONGEST_NAME]}..."


def one_line(fault: str) -> str:
    """A fault on one line of bearable length: what a file says may hold line ends, or codes that a terminal obeys."""
    text = fault if len(fault) <= HEAD + END else f"{fault[:HEAD]} ... {fault[-END:]}"
    return text if text.isprintable() else "".join(one if one.isprintable() else ascii(one)[1:-1] for one in text)


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
        self._prefix, self._found, self._more = prefix, list[str](), 0

    def add(self, key: str, value: Any, what: str, remedy: str | Callable[[], str]) -> None:
        """Note a fault: key = value: what is wrong; how to mend it.

        Args:
            key: What is wrong.
            value: Its value.
            what: What is wrong with it.
            remedy: How to mend it; a function where that takes time, called only for a fault that is said.
        """
        if len(self._found) >= MOST_FAULTS:
            self._more += 1
            return
        words = remedy if isinstance(remedy, str) else remedy()
        self._found.append(f"{self._prefix}{cut(key)} = {shown(value)}: {what}; {words}")

    @contextlib.contextmanager
    def including(self) -> Iterator[None]:
        """Take over the faults that are raised inside, and go on."""
        try:
            yield
        except SceneError as error:
            room = MOST_FAULTS - len(self._found)
            self._found.extend(error.faults[:room])
            self._more += error.more + len(error.faults[room:])

    def raise_if_any(self) -> None:
        """Raise SceneError with the faults noted."""
        if self._found:
            raise SceneError(self._found, self._more)

    def choice(self, key: str, value: Any, known: Iterable[Any]) -> bool:
        """The value must be one of those known."""
        known = list(known)
        good = any(value == k and type(value) is type(k) for k in known)
        if not good:
            self.add(key, value, "is not known", lambda: closest(value, known))
        return good

    def keys(self, key: str, given: Iterable[str], known: Iterable[str]) -> None:
        """Every given key must be one of those known; a mapping's values are shown."""
        known = list(known)
        for name in given:
            if name not in known:
                value = given[name] if isinstance(given, Mapping) else "..."
                remedy = functools.partial(closest, name, known)
                self.add(f"{key}.{name}" if key else name, value, "is an unknown key", remedy)

    def real(self, key: str, value: Any, remedy: str = "give numbers") -> np.ndarray | None:
        """A new float64 array of the same numbers, which may be NaN; None after noting a fault."""
        try:
            return real_numbers(value)
        except NotReal as error:
            self.add(key, value, error.what, error.remedy or remedy)
            return None

    def finite(self, key: str, value: Any, shape: tuple[int, ...] | None = None, unit: str = "") -> np.ndarray | None:
        """A finite float64 array, of this shape if one is given; None after noting a fault."""
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
        if holds_words(value):
            self.finite(key, value, (size,), unit)  # says so
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
