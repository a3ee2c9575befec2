# SPDX-License-Identifier: Apache-2.0
"""Twenty loops that settle for no member: wrong signs, gains too high, delays, small limits, integrals."""

from __future__ import annotations

from typing import Any

import lgvi_warp as lw

FINS = lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]])
# Step of their runs [s].
STEP = 0.02


def remus() -> lw.Scene:
    """REMUS 100 that turns by 0.3 rad and dives by a metre."""
    laws = [lw.control.HeadingPID(kp=1.0, kd=2.0, ki=0.02),
            lw.control.DepthPID(kp=0.1, ki=0.001, kp_pitch=5.0, ki_pitch=0.3, kd_pitch=2.0, pitch_limit=0.5)]  # fmt: skip
    controller = lw.Controller(
        period=0.1, delay=0.1, guidance=[lw.control.SetPoint(heading=0.3, depth=6.0)], laws=laws, allocation=[FINS]
    )
    start = lw.Start(position=(0.0, 0.0, 5.0), velocity=(1.54, 0.0, 0.0))
    return lw.Scene.named("remus_100", vehicle={"buoyancy": 299.0}, start=start, controller=controller)


def rov() -> lw.Scene:
    """BlueROV2 Heavy that keeps its place."""
    law = lw.control.PosePID(kp=[40.0] * 3, ki=[1.0] * 3, kd=[60.0] * 3, kr=[4.0] * 3, kw=[1.5] * 3)
    controller = lw.Controller(
        period=0.1, delay=0.1, guidance=[lw.control.SetPoint(position=(0.0, 0.0, 5.0), heading=0.3)], laws=[law]
    )
    return lw.Scene.named("bluerov2_heavy", start=lw.Start(position=(0.2, 0.0, 5.0)), controller=controller)


def _all(*sizes: float) -> Any:
    """Numbers alike on all axes, between two sizes."""
    low, high = sizes
    return lw.distributions.Uniform(low=[low] * 3, high=[high] * 3)


# Name, vehicle, and what differs from its loop, which settles.
LOOPS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("rudder of the wrong sign", "remus", {"heading_pid.kp": lw.distributions.Uniform(-1.5, -0.5)}),
    ("rudder a little wrong", "remus",
     {"heading_pid.kp": lw.distributions.Uniform(-0.3, -0.1),
      "heading_pid.ki": lw.distributions.Uniform(-0.02, -0.01)}),
    ("yaw rate of the wrong sign", "remus", {"heading_pid.kd": lw.distributions.Uniform(-8.0, -5.0)}),
    ("stiff and late", "remus",
     {"heading_pid.kp": lw.distributions.Uniform(1.9, 2.1), "heading_pid.kd": lw.distributions.Uniform(2.9, 3.1),
                                 "controller.delay": lw.distributions.Choice([0.6, 0.8])}),
    ("late", "remus", {"controller.delay": lw.distributions.Choice([1.2, 1.6])}),
    ("yaw damping too high", "remus", {"heading_pid.kd": lw.distributions.Uniform(40.0, 60.0)}),
    ("heading integral too high", "remus", {"heading_pid.ki": lw.distributions.Uniform(3.0, 5.0)}),
    ("stiff, late, small fins", "remus",
     {"heading_pid.kp": lw.distributions.Uniform(3.9, 4.1), "heading_pid.kd": lw.distributions.Uniform(6.0, 8.0),
                                          "control_fins.limit": lw.distributions.Uniform(low=[0.05] * 2, high=[0.1] * 2),
                                          "controller.delay": lw.distributions.Choice([0.6, 0.8])}),
    ("stern planes of the wrong sign", "remus", {"depth_pid.kp_pitch": lw.distributions.Uniform(-6.0, -3.0)}),
    ("pitch damping too high", "remus", {"depth_pid.kd_pitch": lw.distributions.Uniform(60.0, 80.0)}),
    ("pitch integral too high", "remus", {"depth_pid.ki_pitch": lw.distributions.Uniform(20.0, 30.0)}),
    ("depth of the wrong sign", "remus", {"depth_pid.kp": lw.distributions.Uniform(-0.2, -0.1)}),
    ("depth gain too high", "remus", {"depth_pid.kp": lw.distributions.Uniform(2.0, 3.0)}),
    ("place of the wrong sign", "rov", {"pose_pid.kp": _all(-50.0, -30.0)}),
    ("speed of the wrong sign", "rov", {"pose_pid.kd": _all(-90.0, -60.0)}),
    ("attitude of the wrong sign", "rov", {"pose_pid.kr": _all(-50.0, -40.0)}),
    ("late thrusters", "rov", {"controller.delay": lw.distributions.Choice([1.6, 2.0])}),
    ("damping too high", "rov", {"pose_pid.kd": _all(600.0, 900.0)}),
    ("turning rate too high", "rov", {"pose_pid.kw": _all(60.0, 90.0)}),
    ("place integral too high", "rov", {"pose_pid.ki": _all(400.0, 600.0)}),
)  # fmt: skip
SCENES = {"remus": remus, "rov": rov}


def fleet_of(vehicle: str, vary: dict[str, Any], members: int) -> lw.Ensemble:
    """Members that begin with different rates."""
    spin = {"start.angular_velocity": lw.distributions.Normal(mean=[0.0] * 3, std=[0.05] * 3)}
    return lw.Ensemble(SCENES[vehicle](), members, 3, spin | vary)
