# SPDX-License-Identifier: Apache-2.0
"""Results made of given paths, without a run: for tests of what is drawn."""

import numpy as np

import lgvi_warp as lw
from lgvi_warp.common import machine
from lgvi_warp.common.status import Status, StatusArray, WarningArray


def made(position, time=None, *, status=None, end=None, attitude=None, scene=None, seed=1, dtype=np.float64):
    """A result of these positions (k, n, 3).

    status (n,) and end (n,) [s], NaN for members that ran to the end; attitude (k, n, 3, 3), level by default.
    """
    k, n = position.shape[:2]
    time = np.arange(float(k)) if time is None else np.asarray(time, dtype=float)
    scene = scene or lw.Scene.named("sphere")
    status = np.full(n, Status.OK) if status is None else np.asarray(status)
    end = np.full(n, np.nan) if end is None else np.asarray(end, dtype=float)
    level = np.broadcast_to(np.eye(3), (k, n, 3, 3)) if attitude is None else attitude
    velocity = np.gradient(position, time, axis=0) if k > 1 else np.zeros_like(position)
    samples = {
        "position": position, "attitude": level, "velocity": np.einsum("knji,knj->kni", level, velocity),
        "angular_velocity": np.zeros_like(position),
    }  # fmt: skip
    provenance = {
        "scene": scene.to_dict(),
        "ensemble": {"members": n, "seed": seed},
        "method": {"name": "psi_s", "solver": "quartic", "iterations": 0, "tolerance": 1e-12},
        "step": 0.01, "steps": 100, "dtype": "float64", "width": 8, "versions": machine.versions(),
    }  # fmt: skip
    return lw.Result(
        time=time,
        samples={name: np.asarray(values, dtype=dtype) for name, values in samples.items()},
        status=status.astype(np.uint8).view(StatusArray),
        failure_time=end,
        failure_value=np.where(np.isnan(end), np.nan, 1.5),
        warnings=np.zeros(n, np.uint16).view(WarningArray),
        warning_time=np.full(n, np.nan),
        warning_value=np.full(n, np.nan),
        substeps=np.zeros(n, np.int64),
        parameters={name: np.asarray(value, dtype=float)[None] for name, value in scene.parameters().items()},
        messages=(),
        provenance=provenance,
        terms=scene.terms,
    )


def turned(heading):
    """Attitudes (..., 3, 3) of vehicles that are level, by their headings (...) [rad]."""
    c, s, zero = np.cos(heading), np.sin(heading), np.zeros_like(heading)
    return np.stack([c, -s, zero, s, c, zero, zero, zero, zero + 1.0], axis=-1).reshape(*heading.shape, 3, 3)


def straight(points, k=3):
    """Members that go straight from points (n, 3) [m], the faster the deeper, at k times."""
    points = np.asarray(points, dtype=float)
    return made(points + 0.1 * np.arange(k)[:, None, None] * points[:, 2:] * np.array([1.0, 0.5, 0.1]))
