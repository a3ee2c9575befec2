# SPDX-License-Identifier: Apache-2.0
"""Length of an argument's path from `lw.solve` to the kernel."""

import pytest

from tests.house.path import climbs, walked


@pytest.mark.slow  # the watched run takes long
def test_the_step_passes_few_places_on_its_way_to_the_kernel():
    stays = walked("h")
    assert {"solve", "Request.plan", "class TimeGrid"} <= {name for name, *_ in stays}
    assert len(stays) <= 25
    assert len({file for *_, file in stays}) <= 15
    assert climbs(stays) <= 6
