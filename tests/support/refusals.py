# SPDX-License-Identifier: Apache-2.0
"""What a user reads where a call is refused."""

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
