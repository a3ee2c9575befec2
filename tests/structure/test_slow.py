"""slow.txt names tests that there are: a line that names none would leave nothing out, and a test renamed come back."""

import pytest

from tests.conftest import COLLECTED, SLOW


def test_every_line_names_a_test(pytestconfig):
    if any("::" in argument for argument in pytestconfig.args):
        pytest.skip("single tests were asked for")
    names = pytestconfig.stash[COLLECTED]
    files = {name.split("::")[0] for name in names}
    lines = [line.removeprefix("!") for line in SLOW]
    assert [line for line in lines if line.split("::")[0] in files and not any(n.startswith(line) for n in names)] == []


def test_an_exception_is_one_of_something():
    left = tuple(line for line in SLOW if not line.startswith("!"))
    assert all(line[1:].startswith(left) for line in SLOW if line.startswith("!"))
