# SPDX-License-Identifier: Apache-2.0
"""The table of a controller's signals: where each lies in what a tick notes, and what its page says."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from lgvi_kernels.advance.noting import ALL_NOTES, BITS_OF_ROWS, NOTED, bit
from lgvi_warp.control.base import Bus
from lgvi_warp.control.signals import CHANNELS, SAVED, SIGNALS, has_shape, ordered, row_of
from lgvi_warp.physics.fields import FIELDS

PAGE = Path(__file__).parents[3] / "docs" / "controllers" / "signals.md"


def test_every_row_that_a_tick_notes_is_a_signal():
    for group, size in NOTED.items():
        rows = [
            range(signal.row, signal.row + math.prod(signal.field.shape))
            for signal in SIGNALS.values()
            if signal.group == group
        ]
        assert set().union(*rows) == set(range(size)), group


def test_a_signal_is_noted_by_one_bit():
    assert {group: len(bits) for group, bits in BITS_OF_ROWS.items()} == NOTED
    for name, signal in SIGNALS.items():
        if signal.group in NOTED:
            rows = range(signal.row, signal.row + math.prod(signal.field.shape))
            assert len({bit(signal.group, row) for row in rows}) == 1, name
    assert sum({bit(group, row) for group, bits in BITS_OF_ROWS.items() for row in range(len(bits))}) == ALL_NOTES


def test_rows_of_the_memory():
    bus = Bus.of({"fins": 2, "thrusters": 3})
    noted = {"demand": 50, "measured": 56, "reference": 78}
    assert row_of("command", bus, noted) == 0
    assert row_of("unmet", bus, noted) == bus.unmet == 5
    assert row_of("actuator", bus, noted) == bus.report == 11
    assert row_of("demand", bus, noted) == 50
    # Depth is the third number of the position.
    assert row_of("measured_depth", bus, noted) == 58
    assert row_of("reference_depth", bus, noted) == 80


def test_order_and_shapes():
    assert tuple(SAVED) == (*FIELDS, *SIGNALS)
    assert len(SAVED) == len(FIELDS) + len(SIGNALS)
    assert ordered(["demand", "command", "position", "demand"]) == ("position", "command", "demand")
    shapes = {name: tuple(np.shape(np.zeros(SIGNALS[name].field.shape))) for name in SIGNALS if name not in CHANNELS}
    assert all(has_shape(name, shape) and not has_shape(name, (*shape, 1)) for name, shape in shapes.items())
    assert has_shape("command", (8,))
    assert not any(has_shape("actuator", shape) for shape in ((), (0,), (2, 2)))


@pytest.mark.needs("navigation")
def test_the_page_lists_all():
    rows = re.findall(r"^\| `(\w+)` \| (\(.*?\)) \| (.*?) \|", PAGE.read_text(), re.MULTILINE)
    assert [name for name, _, _ in rows] == list(SIGNALS)
    for name, shape, unit in rows:
        field = SIGNALS[name].field
        wanted = ("(channels,)", "that of each actuator") if name in CHANNELS else (str(field.shape), field.unit)
        assert (shape, unit) == wanted, name
