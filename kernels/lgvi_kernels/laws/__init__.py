"""The laws that a scene may name, one file each: `params(width, real)`, the struct of its numbers, and some functions.

law(w, view, p): force [N] and torque [N m] that depend on position, attitude and time;
damping(D, view, p): the matrix D of a force and torque -D (nu; Om); D may depend on velocities as well;
steady_force(w, view, p): the force of `law` in inertial axes, if it never changes there;
energy(u, view, p): the potential [J] of `law`, for the check of energy, with one of two bounds of what it can give:
    supply(s, view, p): the potential less its least value [J]; push(s, view, p): the size of a steady force [N];
flow(f, view, p): velocity and slopes of the water;
evolve(state, view, p): advances what the law remembers by half a kick, and returns its first argument.

Each of them but the last takes the sum over other laws and returns it with its own part added: in this way laws fold into one
function (see maps/compose.py). Constants of a file: POTENTIAL, `law` follows from a potential; SEPARABLE, that potential is a
sum of one of position, at most quadratic, and one of attitude; FLOW, "steady", "uniform" or "varying" water (see Spec.flow);
NOISE, the law draws random numbers.
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
