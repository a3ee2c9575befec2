# SPDX-License-Identifier: Apache-2.0
"""The laws that a scene may name, one file each: the struct `params(width, real)`, and some functions.

law(w, view, p): force [N] and torque [N m] that depend on position, attitude and time;
damping(D, view, p): the matrix D of a force and torque -D (nu; Om); D may depend on velocities as well;
push(w, view, p): that force and torque themselves, for methods that need no matrix (without it, they multiply D);
steady_force(w, view, p): the force of `law` in inertial axes, if it never changes there;
energy(u, view, p): the potential [J] of `law`, for the check of energy, with one of two bounds of what it can give:
    supply(s, view, p): the potential less its least value [J]; steady_size(s, view, p): the size of a steady force [N];
flow(f, view, p): velocity and slopes of the water;
evolve(state, view, p): advances what the law remembers by half a kick, and returns its first argument;
follow(state, view, p): advances what the law remembers to view.t from view.h before, exactly, if that depends on the time and
    itself alone: for explicit methods, before a stage;
power(watts, view, p): the power that it takes [W], with velocities too; called where a law keeps the account of energy alone.

Each of them but evolve and follow takes the sum over other laws and returns it with its own part added: so laws fold into one
function (see maps/compose.py). Constants of a file: POTENTIAL, `law` follows from a potential; SEPARABLE, that potential is a
sum of one of position, at most quadratic, and one of attitude; FLOW, "steady", "uniform" or "varying" water (see Spec.flow);
NOISE, the law draws random numbers; ACCOUNT, its memory is the account of the energy used (see maps/accounting.py).

Without `params` the struct holds the numbers that the host's Term declares, as lanes and 3-vectors of lanes, and of a
NoisyTerm the `key` of its random numbers (see lanes/noise.py), whose type `params` of such a law takes as a third argument.
"""
