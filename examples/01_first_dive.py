# SPDX-License-Identifier: Apache-2.0
"""A first dive: 1,000 vehicles that differ a little, 60 seconds, a picture and a recording.

Mass and first turn differ from vehicle to vehicle. The summary shows paths, depth, attitude and energy;
`rerun 01_first_dive.rrd` plays the recording.
"""

import lgvi_warp as lw

vehicle = lw.Vehicle(
    mass=123.8,  # kg
    added_mass=[65.0, 70.0, 75.0],  # kg
    inertia=[5.46, 5.29, 5.72],  # kg m2
    buoyancy=1215.8,  # N
    center_of_buoyancy=[0.0, 0.0, -0.007],  # m
)
start = lw.Start(
    position=[0.0, 0.0, 100.0],  # m: north, east, down
    euler_deg=[0.0, 10.0, 0.0],  # roll, pitch, yaw
    velocity=[1.0, 0.0, 0.0],  # m/s: ahead
    angular_velocity=[0.0, 0.0, 0.1],  # rad/s
)
scene = lw.Scene(vehicle=vehicle, environment=lw.Environment(gravity=9.8), start=start)
fleet = lw.Ensemble(
    scene,
    members=1000,
    seed=1,
    vary={
        "vehicle.mass": lw.distributions.TruncatedNormal(relative=0.001),
        "start.angular_velocity": lw.distributions.Normal(std=[0.01, 0.01, 0.02]),
    },
)

if __name__ == "__main__":
    result = lw.solve(fleet, h=0.02, t1=60.0, save=lw.SaveAt(every=0.5))
    depth = result.position[-1, :, 2]
    print(result.status.counts())
    print(f"depth after 60 s: {depth.mean():.2f} m on average, from {depth.min():.2f} to {depth.max():.2f} m")
    lw.plots.summary(result, path="01_first_dive.png")
    print("01_first_dive.png", lw.record(result, "01_first_dive.rrd"))
