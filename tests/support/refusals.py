# SPDX-License-Identifier: Apache-2.0
"""Texts for users, above all refusals."""

import pytest

import lgvi_warp as lw


def faults(make, *arguments, **named):
    """The faults with which a call is refused, one text each."""
    with pytest.raises(lw.SceneError) as caught:
        make(*arguments, **named)
    return caught.value.faults


def refused(make, *arguments, **named):
    """The whole message with which a call is refused."""
    with pytest.raises(lw.SceneError) as caught:
        make(*arguments, **named)
    return str(caught.value)


def says(text, *parts):
    """Check that a text has all these parts, or a table these names; a failure names those that it lacks."""
    missing = [part for part in parts if part not in text]
    assert not missing, f"{missing} are not in {text!r}"
