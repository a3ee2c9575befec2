# SPDX-License-Identifier: Apache-2.0
"""Identity of functions: different for different ones, the same in every process."""

import functools
import operator
import os
import subprocess
import sys
import threading
import types

import numpy as np
import pytest

from lgvi_warp.common.identity import UNKNOWN, comparable, identity


def module(text, name="laws_of_a_test"):
    """A module of the user's with this source, as an import makes it."""
    made = types.ModuleType(name)
    exec(compile(text, f"{name}.py", "exec"), made.__dict__)
    return made


def law(text):
    """The function `law` of a module with this source."""
    return module(text).law


def factory(k):
    """A law whose gain is in its closure."""

    def law(x):
        return k * x

    return law


class Gains:
    """A law with state."""

    def __init__(self, k):
        self.k = k

    def __call__(self, x):
        return self.k * x

    def bound(self, x):
        return -self.k * x


class Slotted:
    """A law whose state is in slots, one of them of a name that Python changes."""

    __slots__ = ("__k",)

    def __init__(self, k):
        self.__k = k

    def __call__(self, x):
        return self.__k * x


class Hidden(Gains):
    """A law whose pickle says nothing of its state."""

    def __reduce__(self):
        return Hidden, (0.0,)


def added(a, x):
    return a + x


# Two texts of a module each, whose functions are called the same and do something else.
PAIRS = {
    "name of what is called": ("import numpy as np\ndef law(x): return np.maximum(x, 1.0)",
                               "import numpy as np\ndef law(x): return np.minimum(x, 1.0)"),
    "constant": ("def law(x): return 2.0 * x", "def law(x): return 3.0 * x"),
    "kind of a constant": ("def law(x): return x / 2", "def law(x): return x / 2.0"),
    "sign of zero": ("def law(x): return x, 0.0", "def law(x): return x, -0.0"),
    "default": ("def law(x, k=1.0): return k * x", "def law(x, k=2.0): return k * x"),
    "default by name": ("def law(x, *, k=1.0): return k * x", "def law(x, *, k=2.0): return k * x"),
    "global": ("K = 1.0\ndef law(x): return K * x", "K = 2.0\ndef law(x): return K * x"),
    "array": ("import numpy as np\nK = np.ones(2000)\ndef law(x): return K * x",
              "import numpy as np\nK = np.ones(2000); K[1000] = 2.0\ndef law(x): return K * x"),
    "list": ("K = [1.0, 2.0]\ndef law(x): return K[0] * x", "K = [1.5, 2.0]\ndef law(x): return K[0] * x"),
    "constant tuple": ("def law(x): return x[(1, 2)]", "def law(x): return x[(1, 3)]"),
    "inner lambda": ("def law(x): return (lambda y: 2.0 * y)(x)", "def law(x): return (lambda y: 3.0 * y)(x)"),
    "method": ("def law(x): return x.max()", "def law(x): return x.min()"),
    "helper": ("def helper(x): return x + 1.0\ndef law(x): return helper(x)",
               "def helper(x): return x + 2.0\ndef law(x): return helper(x)"),
    "helper of a helper": ("def a(x): return x\ndef b(x): return a(x)\ndef law(x): return b(x)",
                           "def a(x): return -x\ndef b(x): return a(x)\ndef law(x): return b(x)"),
    "class": ("class G:\n    k = 1.0\ndef law(x): return G.k * x", "class G:\n    k = 2.0\ndef law(x): return G.k * x"),
    "base of a class": ("class B: k = 1.0\nclass G(B): pass\ndef law(x): return G.k * x",
                        "class B: k = 2.0\nclass G(B): pass\ndef law(x): return G.k * x"),
    "recursion": ("def law(n): return 1 if n < 2 else n * law(n - 1)", "def law(n): return 1 if n < 3 else n * law(n - 1)"),
    "caught": ("def law(x):\n    try: return 1 / x\n    except ZeroDivisionError: return 0.0",
               "def law(x):\n    try: return 1 / x\n    except ValueError: return 0.0"),
    "set": ("def law(x): return x in {'a', 'b'}", "def law(x): return x in {'a', 'c'}"),
    "decorator": ("import functools\ndef twice(f):\n    @functools.wraps(f)\n    def g(x): return 2.0 * f(x)\n    return g\n"
                  "@twice\ndef law(x): return x",
                  "import functools\ndef twice(f):\n    @functools.wraps(f)\n    def g(x): return 3.0 * f(x)\n    return g\n"
                  "@twice\ndef law(x): return x"),
    "cached": ("import functools\n@functools.lru_cache\ndef law(x): return x",
               "import functools\n@functools.lru_cache\ndef law(x): return -x"),
}  # fmt: skip


@pytest.mark.parametrize("single, compared", PAIRS.values(), ids=PAIRS)
def test_functions_of_one_name_that_differ(single, compared):
    first, again, second = identity(law(single)), identity(law(single)), identity(law(compared))
    assert first == again != second
    assert UNKNOWN not in (first, second)


OBJECTS = {
    "closure": (factory(1.0), factory(2.0)),
    "closure of an array": (factory(np.zeros(3)), factory(np.array([0.0, 0.0, 1e-300]))),
    "shape of an array": (factory(np.zeros(4)), factory(np.zeros((2, 2)))),
    "precision of an array": (factory(np.zeros(4, np.int64)), factory(np.zeros(4))),
    "lambdas of a loop": tuple(lambda x, k=k: k * x for k in (1.0, 2.0)),
    "callable object": (Gains(1.0), Gains(2.0)),
    "bound method": (Gains(1.0).bound, Gains(2.0).bound),
    "methods of one object": (Gains(1.0).bound, Gains(1.0).__call__),
    "slots": (Slotted(1.0), Slotted(2.0)),
    "beside its pickle": (Hidden(1.0), Hidden(2.0)),
    "partial": (functools.partial(added, 1.0), functools.partial(added, 2.0)),
    "partial by name": (functools.partial(added, a=1.0), functools.partial(added, a=2.0)),
    "ufunc": (np.maximum, np.minimum),
    "C function": (operator.add, operator.sub),
    "method of a C object": (np.random.default_rng(1).normal, np.random.default_rng(2).normal),
    "vectorized": (np.vectorize(factory(1.0)), np.vectorize(factory(2.0))),
    "masked": (factory(np.ma.array([1.0, 2.0], mask=[0, 1])), factory(np.ma.array([1.0, 2.0], mask=[0, 0]))),
    "library": (Gains(np), Gains(operator)),
    "objects": (factory(np.array([1, "a"], object)), factory(np.array([1, "b"], object))),
}


@pytest.mark.parametrize("single, compared", OBJECTS.values(), ids=OBJECTS)
def test_objects_that_differ(single, compared):
    assert len({identity(single), identity(compared), UNKNOWN}) == 3
    assert identity(single) == identity(single)


def test_circles_end():
    held = []
    held += [held, lambda: held]
    other = []
    other += [other, lambda: (other, 1)]
    assert len({identity(held[1]), identity(other[1]), UNKNOWN}) == 3
    gains = Gains(1.0)
    gains.me = gains
    assert identity(gains) not in (identity(Gains(1.0)), UNKNOWN)
    deep = []
    for _ in range(100_000):
        deep = [deep]
    assert identity(factory(deep)) == UNKNOWN


def test_what_is_named_as_global_counts_and_what_is_not_does_not():
    text = "K = 1.0\nOTHER = {}\ndef law(x): return K * x"
    assert identity(law(text.format(1.0))) == identity(law(text.format(2.0) + "\n# moved\n\n"))
    moved = "\n\n\n# further down\nK = 1.0\nOTHER = 3.0\ndef law(x): return K * x"
    assert identity(law(moved)) == identity(law(text.format(1.0)))


def test_state_that_changes_is_another_function():
    count = {"n": 0}

    def counting(x):
        count["n"] += 1
        return x

    before = identity(counting)
    counting(1.0)
    assert identity(counting) != before


def test_modules_of_the_user_are_followed_by_what_is_named_of_them(monkeypatch):
    text = "import helpers_of_a_test\ndef law(x): return helpers_of_a_test.inner.gain(x)"
    found = []
    for gain, rest in ((1.0, "a"), (2.0, "a"), (1.0, "b")):
        helpers = module(f"rest = {rest!r}", "helpers_of_a_test")
        helpers.inner = module(f"def gain(x): return {gain} * x", "helpers_of_a_test.inner")
        monkeypatch.setitem(sys.modules, "helpers_of_a_test", helpers)
        found.append(identity(law(text)))
    assert found[0] == found[2] != found[1]
    late = "def law(x):\n    import helpers_of_a_test\n    return helpers_of_a_test.inner.gain(x)"
    assert identity(law(late)) != UNKNOWN
    monkeypatch.delitem(sys.modules, "helpers_of_a_test")
    assert identity(law(late)) == UNKNOWN


@pytest.mark.parametrize("function", [
    law("import threading\nlock = threading.Lock()\ndef law(x):\n    with lock: return x"),
    law("def law(x): return eval('x + 1')"), law("def law(x): return open('gain').read()"),
    np.frompyfunc(added, 2, 1), Gains(module("k = 1")), factory(x for x in [1]), threading.Lock().acquire,
], ids=["lock", "eval", "open", "ufunc", "module", "generator", "method of a lock"])  # fmt: skip
def test_in_doubt_nothing_is_told(function):
    assert identity(function) == UNKNOWN
    assert identity(function, "1") == identity(added, "1") != identity(function, "2")


def test_only_what_is_of_one_kind_can_be_compared():
    one, other = identity(factory(1.0)), identity(factory(2.0))
    assert comparable(one, other)
    assert comparable(identity(added, 1), identity(added, 2))
    assert not comparable(one, UNKNOWN)
    assert not comparable(UNKNOWN, UNKNOWN)
    assert not comparable(one, identity(added, 1))
    assert not comparable(one, "cpython-000 " + one.partition(" ")[2])


SCRIPT = """
import sys
sys.path.insert(0, {folder!r})
from laws_in_a_file import law, other
from lgvi_warp.common.identity import identity
print(identity(law), identity(other))
"""
LAWS = """
import numpy as np
import warp as wp
WORDS = {"a", "b", "c", ("d", 1), frozenset({"e", "f"})}
class Law:
    def __init__(self): self.k, self.words = np.arange(3.0), {"one": WORDS}
    def __call__(self, x): return x in {"u", "v", "w"} or self.words
law = Law().__call__
@wp.func
def on_device(x: float): return wp.sin(x)
def other(x): return law(on_device(x)), Law, np.linalg.norm
"""


@pytest.mark.ci
def test_it_is_the_same_in_every_process(tmp_path):
    """Hashes of texts, and so the order of sets, and places in memory differ between processes."""
    (tmp_path / "laws_in_a_file.py").write_text(LAWS)
    script = SCRIPT.format(folder=str(tmp_path))
    told = {subprocess.run([sys.executable, "-c", script], env={**os.environ, "PYTHONHASHSEED": seed},
                           check=True, capture_output=True, text=True).stdout for seed in ("0", "1", "77")}  # fmt: skip
    assert len(told) == 1
    assert UNKNOWN not in told.pop()
