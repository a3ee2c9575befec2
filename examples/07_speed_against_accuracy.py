# SPDX-License-Identifier: Apache-2.0
"""Speed against accuracy: what each method costs for each error, for this scene on this machine.

`lw.tradeoff` runs a sample of the fleet by many methods, steps and precisions against a reference that two runs agree on.
The front names what is cheapest; `lw.suggest` takes one setting from such measurements.
"""

import lgvi_warp as lw

scene = lw.Scene.named("torpedo", start={"position": [0.0, 0.0, 50.0], "velocity": [1.5, 0.0, 0.0]})
fleet = lw.Ensemble(scene, members=64, seed=1, vary={"start.angular_velocity": lw.distributions.Normal(std=0.1)})

if __name__ == "__main__":
    found = lw.tradeoff(
        fleet, t1=20.0, methods=["psi_s", "psi_x", "rk4", "rk5", "rk8", "rkw3"], members=64, seconds=40.0
    )
    print(f"{len(found.measurements)} settings; reference {found.reference}")
    for least in (1.0, 1e-2, 1e-4, 1e-6):
        cheapest = next(point for point in found.front() if point.error("position") <= least)
        setting, price = cheapest.setting, cheapest.us_per_vehicle_second
        print(
            f"to {least:g} m: {setting.name} in {setting.dtype} at {setting.h:.3g} s, {price:.2f} us a vehicle and second"
        )
    lw.plots.tradeoff(found, path="07_speed_against_accuracy.png")
    print("07_speed_against_accuracy.png")
