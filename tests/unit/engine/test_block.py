# SPDX-License-Identifier: Apache-2.0
"""Division of members into blocks: stores of all versions depend on it."""

import pytest

from lgvi_warp.engine.block import Block, block_size, blocks, default_threads, parts


@pytest.mark.parametrize(("members", "size"), [
    (1, 256), (256, 256), (16_383, 256), (16_384, 512), (32_767, 512), (32_768, 1024), (65_535, 1024), (65_536, 2048),
    (131_071, 2048), (131_072, 4096), (10_000_000, 4096),
])  # fmt: skip
def test_the_size_at_its_borders(members, size):
    assert block_size(members) == size


@pytest.mark.parametrize("members", [1, 255, 256, 257, 512, 1003, 16_384, 16_385])
def test_each_member_is_in_one_block(members):
    found = blocks(members)
    assert [i for block in found for i in range(block.first, block.stop)] == list(range(members))
    assert {block.count for block in found[:-1]} <= {block_size(members)}
    assert 0 < found[-1].count <= block_size(members)
    assert found[0] == Block(0, min(members, block_size(members)))


@pytest.mark.parametrize(
    ("members", "steps", "threads"), [(1, 1, 1), (1_999, 500, 1), (1_999, 501, 8), (2_000, 1, 8), (1_000, 100_000, 8)]
)
def test_few_members_of_a_short_run_take_one_thread(members, steps, threads):
    """Several cost more than they save there; a long run of few members is worth them."""
    assert default_threads(members, steps, 8) == threads


@pytest.mark.parametrize(
    ("members", "steps", "threads"), [(400_000, 240, 2), (20_000, 100, 2), (5_000, 10_000, 4), (70_001, 9, 1)]
)
def test_blocks_whose_statistics_are_gathered_run_several_as_one(members, steps, threads):
    """Whole ones, as many as a run without statistics takes: a block costs a millisecond beside its kernel."""
    own, found = block_size(members), parts(members, steps, threads, apart=False, gathered=True)
    assert [block.first for block in found[1:]] == [block.stop for block in found[:-1]]
    assert (found[0].first, found[-1].stop) == (0, members)
    assert all(block.first % own == 0 for block in found)
    most = parts(members, steps, threads, apart=False)[0].count
    assert most - own < found[0].count <= max(own, most)
