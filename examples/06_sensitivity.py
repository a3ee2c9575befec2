# SPDX-License-Identifier: Apache-2.0
"""Sensitivity: the uncertain inputs that matter for the final position and speed of a vehicle.

Sobol indices give the share of the variance that each input causes alone (S1) and with all its interactions (ST).
Buoyancy determines the depth, and the current determines the distance east. The north current dominates the speed.
"""

import lgvi_warp as lw

scene = lw.Scene.named(
    "remus_100",
    vehicle={"buoyancy": 299.0},  # N: as heavy as the vehicle
    terms=[lw.terms.Current(velocity=[0.0, 0.2, 0.0])],  # m/s
    start={"position": [0.0, 0.0, 30.0], "velocity": [1.5, 0.0, 0.0]},
)
vary = {
    "vehicle.buoyancy": lw.distributions.Normal(std=0.5),  # N
    "wrench.force[0]": lw.distributions.Normal(std=0.1),  # N: thrust
    "current.velocity[0]": lw.distributions.Normal(std=0.05),  # m/s: to the north
    "current.velocity[1]": lw.distributions.Normal(std=0.05),  # m/s: to the east
    "start.velocity[0]": lw.distributions.Normal(std=0.1),  # m/s: ahead
}

if __name__ == "__main__":
    found = lw.uq.sobol(
        scene, ["depth", "position[1]", "speed"], vary=vary, samples=256, second_order=False, h=0.02, t1=30.0
    )
    print(f"{found.members:,} members, {found.failed} failed")
    for quantity, total in zip(found.quantities, found.total, strict=True):
        shares = [f"{factor} {share:.2f}" for factor, share in zip(found.factors, total, strict=True) if share > 0.02]
        print(f"{quantity}: {', '.join(shares)}")
    lw.plots.sensitivity(found, path="06_sensitivity.png")
    print("06_sensitivity.png")
