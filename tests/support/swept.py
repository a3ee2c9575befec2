# SPDX-License-Identifier: Apache-2.0
"""Sweeps whose numbers are given by hand, without a run: for pictures of them."""

import itertools
from types import SimpleNamespace

import numpy as np

import lgvi_warp as lw
from lgvi_warp.common.status import Status
from lgvi_warp.robustness.sweeps.output import Sweep
from lgvi_warp.robustness.sweeps.record import Record
from lgvi_warp.robustness.sweeps.setup import END, SweepCell
from tests.support.made import made

N = 40


class ByHand(Sweep):
    """A sweep whose members vary in two inputs, and whose runs again are those of `path`."""

    explained = ("mass", "delay")

    def inputs(self, cell, first=0, stop=None):
        return {"mass": np.arange(N) * 1.0, "delay": np.arange(N) ** 2.0}

    def causes(self, case, at=None, of="success"):
        return [{"input": name, "share": share} for name, share in zip(self.explained, (0.754321, 0.25), strict=False)]

    def again(self, case, members, at=None, save=None):
        self.__dict__.setdefault("asked", []).append((case, members, at, save))
        z = np.arange(5.0)[:, None] + np.arange(len(members))
        result = made(np.stack([z, 0.0 * z, 10.0 + z], axis=-1))
        wanted = {"reference_depth": z + 12.0, "reference_position": result.position + np.array([3.0, 4.0, 0.0]),
                  "reference_heading": 0.0 * z}  # fmt: skip
        result.samples.update(wanted)
        return result


def swept(share, axes=None, cases="ab", refused=(), metrics=("m",), failed=0):
    """A sweep; share: function of the index of a cell, the share of members that pass."""
    axes, cases = axes or {}, [SimpleNamespace(name=name) for name in cases]
    points = [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]
    controller = SimpleNamespace(controller=SimpleNamespace(period=0.5), run=SimpleNamespace(duration=100.0))
    cells, records = [], {}
    for i, (case, point) in enumerate(itertools.product(cases, points)):
        cells.append(SweepCell(i, case, point, str(i), SimpleNamespace(scene=controller), ()))
        status = np.where(np.arange(N) < failed, Status.NON_FINITE, Status.OK)
        numbers = {"m": np.arange(N) * (1.0 + i), "n": np.full(N, np.nan), END: np.ones(N)}
        numbers["passes"] = np.arange(N) < round(N * share(i))
        records[str(i)] = Record.of_refusal("odd") if i in refused else Record(status, numbers)
    unit = {"m": "m/s", "n": "1", END: "s"}
    statistics = {name: SimpleNamespace(unit=unit[name], quantity=SimpleNamespace(unit=""), of="depth")
                  for name in (*metrics, END)}  # fmt: skip
    members = SimpleNamespace(members=N, seed=1)
    scene = lw.Scene.named("sphere")
    setup = SimpleNamespace(scene=scene, cases=cases, axes=axes, metrics=statistics, members=members, settings={})
    conditions = SimpleNamespace(passed=lambda status, numbers: numbers["passes"], limits={})
    return ByHand(setup, cells, records, conditions, "a", 0.9, "wilson")
