"""A keeper of the simplest kind: the sum of the depths of each sample time; its parts go into a store and come back."""

import numpy as np


class DepthSum:
    """sums: (k,) [m] over all members. merged: the first members of the blocks, as they came."""

    name = "depth sum"

    def __init__(self, plan):
        self.sums, self.merged = np.zeros(len(plan.grid.times)), []

    def open(self, plan, block, members):
        return BlockSum(len(plan.grid.times))

    def merge(self, block, part):
        self.sums += part
        self.merged.append(block.first)

    def to_arrays(self, part):
        return {"sums": part}, {"times": len(part)}

    def from_arrays(self, arrays, content):
        assert len(arrays["sums"]) == content["times"]
        return arrays["sums"]


class BlockSum:
    def __init__(self, times):
        self.sums = np.zeros(times)

    def take(self, when, samples):
        self.sums[when] = samples["position"][..., 2].sum(axis=1)

    def close(self, outcome):
        return self.sums
