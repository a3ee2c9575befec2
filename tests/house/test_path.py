# SPDX-License-Identifier: Apache-2.0
"""How far an argument of `lw.solve` goes before the kernel has it."""

import pytest

from tests.house.path import climbs, walked


@pytest.mark.slow  # the watched run takes long
def test_the_step_passes_few_places_on_its_way_to_the_kernel():
    stays = walked("h")
    assert {"solve", "Request.plan", "class TimeGrid"} <= {name for name, *_ in stays}
    assert len(stays) <= 25
    assert len({file for *_, file in stays}) <= 15
    assert climbs(stays) <= 6
