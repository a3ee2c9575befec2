# SPDX-License-Identifier: Apache-2.0
"""The core runs in a tree without extensions (`make test-core` runs its tests there too)."""

import pytest

from tests.support.core_alone import SMOKE, copy_of_core, run


@pytest.mark.slow
def test_the_core_stands_alone(tmp_path):
    assert not (copy_of_core(tmp_path) / "lgvi_warp" / "extensions").exists()
    assert run(tmp_path, "-c", SMOKE).returncode == 0
