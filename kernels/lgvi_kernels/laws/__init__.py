"""The laws a scene may name, one file each: the struct that it reads, `params(width, real)`, and one or more functions.

law(w, view, p): a force and torque from position, attitude and time, POTENTIAL if they follow from a potential,
SEPARABLE if that is a sum of one of position, at most quadratic, and one of attitude;
energy(u, view, p): u and that potential [J], by which energy is watched, with one of: supply(s, view, p), s and what it can
give from here [J], where it has a least value; push(s, view, p), s and the size of a steady force [N];
damping(D, view, p): a matrix D, from velocities as well, of the force and torque -D (nu; Om);
steady_force(w, view, p): where the force of `law` never changes in inertial axes, what it is there;
flow(f, view, p): how the water moves; evolve(view, view, p): what the law remembers, advanced by half a kick.

Without `params` the struct is that of the numbers that the host's Term declares: lanes and 3-vectors of lanes.
"""
