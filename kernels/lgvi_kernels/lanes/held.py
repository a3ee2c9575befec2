# SPDX-License-Identifier: Apache-2.0
"""Commands that a controller holds over a period, as actuators read them."""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, mul, ones, positive, sub  # noqa: F401
from lgvi_kernels.lanes.tick import delayed_key, held_key
from lgvi_kernels.lanes.view import remembered

_Held, _Delayed = held_key(), delayed_key()


# Definitions of one name at module level become overloads: the key's type chooses.
@wp.func
def held_command(view: Any, key: _Held, i: int):
    """Command i of an actuator, the same over a period."""
    return remembered(view, key.row + i)


@wp.func
def held_command(view: Any, key: _Delayed, i: int):  # noqa: F811
    since = (view.h.dtype(view.step) + view.h.dtype(0.5)) * ones(view.b.x) - remembered(view, key.begin)
    return positive(since, remembered(view, key.row + i), remembered(view, key.old + i))
