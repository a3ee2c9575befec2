"""The laws a scene may name, one file each: `params(width, real)`, the struct it reads, and one or more functions.

law(w, view, p): a force and torque from position, attitude and time, POTENTIAL if they follow from a potential,
SEPARABLE if that is a sum of one of position, at most quadratic, and one of attitude;
energy(u, view, p): u and that potential [J], by which energy is watched, with one of: supply(s, view, p), s and what it can
give from here [J], where it has a least value; push(s, view, p), s and the size of a steady force [N];
damping(D, view, p): a matrix D, from velocities as well, of the force and torque -D (nu; Om);
steady_force(w, view, p): where the force of `law` never changes in inertial axes, what it is there;
flow(f, view, p): how the water moves; evolve(view, view, p): what the law remembers, advanced by half a kick.
"""

from lgvi_kernels.laws import (
    control_fins,
    cross_flow,
    current,
    current_harmonics,
    current_profile,
    drag,
    drag_directions,
    drag_matrix,
    drag_matrix_turned,
    fins,
    gauss_markov_current,
    lift,
    restoring,
    stratification,
    tether,
    thrusters,
    thrusters_polynomial,
    waves,
    weight,
    wrench,
    wrench_noise,
    wrench_schedule,
)

LAWS = {
    "weight": weight,
    "restoring": restoring,
    "drag": drag,
    "drag_directions": drag_directions,
    "drag_matrix": drag_matrix,
    "drag_matrix_turned": drag_matrix_turned,
    "fins": fins,
    "control_fins": control_fins,
    "cross_flow": cross_flow,
    "lift": lift,
    "current": current,
    "current_profile": current_profile,
    "tether": tether,
    "thrusters": thrusters,
    "thrusters_polynomial": thrusters_polynomial,
    "wrench": wrench,
    "wrench_schedule": wrench_schedule,
    "current_harmonics": current_harmonics,
    "waves": waves,
    "gauss_markov_current": gauss_markov_current,
    "wrench_noise": wrench_noise,
    "stratification": stratification,
}
