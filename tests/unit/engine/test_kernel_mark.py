# SPDX-License-Identifier: Apache-2.0
"""`make quick` leaves out what is marked `kernel`: a test without the mark can load none."""

import pytest
import warp._src.context as context


def test_a_kernel_is_refused_to_a_test_without_the_mark():
    with pytest.raises(pytest.fail.Exception, match=r"the kernel toy: mark it with @pytest.mark.kernel"):
        context.Module("toy", None).load("cpu")


@pytest.mark.kernel
def test_the_mark_lets_a_test_load():
    assert context.Module.load.__module__ == "warp._src.context"
