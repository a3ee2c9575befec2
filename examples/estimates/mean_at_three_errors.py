# SPDX-License-Identifier: Apache-2.0
"""One mean at three errors: what each takes, and what plain Monte Carlo would.

How far north the vehicle of the paper is after 20 s, where its turn at the start and its mass are uncertain. A tenth of the
error takes plain Monte Carlo a hundred times as long; Sobol points, at the step whose bias is small enough, take a few times.
"""

import lgvi_warp as lw

scene = lw.Scene.load("examples/paper.toml")
fleet = lw.Ensemble.from_scene(scene)

if __name__ == "__main__":
    for error in (1e-4, 1e-5, 1e-6):
        found = lw.estimate(fleet, "mean position[0]", error, t1=20.0, threads=1)
        members = sum(found.members.values())
        print(f"to {error:g} m: {found.value:.7f} m by {found.estimator}, {found.setting}, {members:,} members")
        print(f"  {found.seconds:.2g} s, plain Monte Carlo {found.plain_seconds:.2g} s")
    print(found)
