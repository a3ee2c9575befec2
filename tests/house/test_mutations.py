# SPDX-License-Identifier: Apache-2.0
"""The faults that `make mutants` puts into the code: in what runs, one at a time, and never in words."""

from tests.support.mutations import mutants, parses

SOURCE = '''
"""Words 1 < 2."""
from typing import Any
__all__ = ["f", "g"]

def f(a: "1 < 2", b=3):
    """More words, 1 + 1."""
    if a < b and not a:
        raise ValueError(f"{a + 1} is below {b}", 7)
    total = max(a, b)
    total += a[0] * 2.0
    return total - g(b, a)

def __repr__():
    return 1 < 2
'''
EXPECTED = {
    "if a < b and not a:": {"if a <= b and not a:", "if a < b or not a:", "if a < b and (a):", "if True:", "if False:"},
    "total = max(a, b)": {"total = min(a, b)"},
    "total += a[0] * 2.0": {"pass", "total -= a[0] * 2.0", "total += a[1] * 2.0", "total += a[0] / 2.0",
                            "total += a[0] * 2.02", "total += a[0] * (-2.0)"},
    "return total - g(b, a)": {"return total + g(b, a)", "return total - g(a, b)", "return None"},
}  # fmt: skip


def test_each_line_has_the_faults_that_somebody_could_make():
    found = {}
    for mutant in mutants(SOURCE):
        assert parses(mutant.applied(SOURCE))
        assert mutant.applied(SOURCE).count("\n") == SOURCE.count("\n")
        before, after = mutant.shown(SOURCE)
        found.setdefault(before, set()).add(after)
    signature, raised = 'def f(a: "1 < 2", b=3):', 'raise ValueError(f"{a + 1} is below {b}", 7)'
    assert found.pop(signature) == {signature.replace("b=3", "b=4")}
    assert found.pop(raised) == {"pass"}
    assert found == EXPECTED


def test_device_code_returns_no_none():
    assert not any(mutant.text == "None" for mutant in mutants(SOURCE, device=True))
