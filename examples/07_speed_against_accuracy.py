# SPDX-License-Identifier: Apache-2.0
"""Speed against accuracy: cost and error of many settings, for one scene on one machine.

`lw.tradeoff` runs members with many methods, steps and precisions. Two independent runs confirm the reference.
The front has the cheapest setting for each error. `lw.suggest` chooses one setting by such measurements.
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
