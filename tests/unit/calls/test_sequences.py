# SPDX-License-Identifier: Apache-2.0
"""A sequence may be given as a list, tuple, array, column, range, iterator or generator, with the same bits."""

import pytest

from tests.support.sequences import GOOD, called, state_of, ways_of

CALLED = called()


def read(path, arguments):
    return state_of(CALLED[path](**arguments))


def cases(path):
    """(arguments, name of the one that is a list) of a public name."""
    return [(good, name) for good in GOOD[path] for name, value in good.items() if isinstance(value, list)]


@pytest.mark.parametrize("path", GOOD)
def test_every_way_of_giving_a_sequence_has_the_same_bits(path):
    different = []
    for good, name in cases(path):
        expected = read(path, good)
        for way, give in ways_of(good[name]).items():
            try:
                found = read(path, {**good, name: give(good[name])})
            except Exception as error:
                different.append(f"{path}({name}={way}): {type(error).__name__}: {error}")
                continue
            if found != expected:
                different.append(f"{path}({name}={way})")
    assert different == []
