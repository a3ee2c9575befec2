# SPDX-License-Identifier: Apache-2.0
"""What a packet carries through the steps: the state, the vehicle's constants, and the View that laws see.

Momenta and inertia are kept divided by max J (`scale`): so the quartic of equation (24) stays within float32, and only
forces, which are not scaled, are multiplied by 1 / max J.
"""

import functools

import warp as wp

from lgvi_kernels.lanes.arithmetic import lane, lane3, own_rows, struct, symmetric3


@functools.cache
def alarm_struct(width, real):
    """Per lane: the status of the first failure (0: none) and the square of the value that crossed its limit.

    Squares, here and wherever a value is compared with a limit: a sum of squares needs no root, and the host takes the root
    of the few that it reports.
    """
    Lane = lane(width, real)
    return struct("Alarm", code=Lane, size=Lane)


@functools.cache
def pace_struct(real):
    """stride: the next step [s]; before: the last accepted step's error over the tolerance (both are 0 at the start).

    made, tried: how many steps were accepted and attempted; reals, since they are stored in lanes beside the state.
    """
    return struct("Pace", stride=real, before=real, made=real, tried=real)


@functools.cache
def state_struct(width, real, compensated=False):
    """b [m, inertial], the rows of R (body to inertial), p and pi (momenta / max J) in the kernel's body axes.

    time [s] and step are those of the sub-map in turn; they are kept only where a law looks at them.
    pace: of a packet that chooses its steps (see pace_struct).
    prepared: 1 where laws have kept what they need at this time (see maps/explicit.py).
    compensated: each vector has a low part, for the digits that it cannot hold (see sums).
    """
    Lane3, Alarm = lane3(width, real), alarm_struct(width, real)
    rows = {"R0": Lane3, "R1": Lane3, "R2": Lane3}
    fields = {"b": Lane3, **rows, "p": Lane3, "pi": Lane3, "alarm": Alarm, "time": wp.float64, "step": wp.int32}
    fields["prepared"] = wp.int32
    if compensated:
        return struct("CompensatedState", **fields, **{f"{name}_low": Lane3 for name in ("b", *rows, "p", "pi")})
    return struct("State", **fields, pace=pace_struct(real))


@functools.cache
def wrench_struct(width, real):
    """Force [N] and torque [N m] in body axes."""
    Lane3 = lane3(width, real)
    return struct("Wrench", force=Lane3, torque=Lane3)


@functools.cache
def matrix3_struct(width, real):
    """A 3x3 matrix of each vehicle."""
    Lane3 = lane3(width, real)
    return struct("Matrix3", row0=Lane3, row1=Lane3, row2=Lane3)


@functools.cache
def damping_struct(width, real):
    """D with (force; torque) = -D (nu; Om), as four 3x3 blocks: force by velocity, force by rate, torque by both."""
    Matrix3 = matrix3_struct(width, real)
    return struct("Damping", force_velocity=Matrix3, force_rate=Matrix3, torque_velocity=Matrix3, torque_rate=Matrix3)


@functools.cache
def series_struct(width, real):
    """c1 to c9, the coefficients of N, H; N^2, N H, H^2; N^3, N^2 H, N H^2, H^3 (see maps/two_part.py)."""
    return struct("Series", **{f"c{i}": lane(width, real) for i in range(1, 10)})


@functools.cache
def flow_struct(width, real):
    """The water's velocity u [m/s], du/dt [m/s2] and du/db [1/s] by north, east and depth, all in inertial axes."""
    Lane3 = lane3(width, real)
    return struct("Flow", velocity=Lane3, rate=Lane3, by_north=Lane3, by_east=Lane3, by_depth=Lane3)


@functools.cache
def table_number(width, real, shared):
    """What the laws' table holds: lanes, or, where all members share its rows, one number for them all."""
    return real if shared else lane(width, real)


@functools.cache
def view_struct(width, real, shared=False, bounded=False):
    """What a law may read: the only argument that grows when laws need more, so their signatures stay.

    north, east, down: R^T e1, R^T e2, R^T e3, the inertial axes in body axes; b [m], inertial.
    nu [m/s], Om [rad/s]: velocities relative to the water, body axes; only damping laws see them.
    t [s], h [s]: time and length of this kick; step: its number; second: 0 in the first half of a kick, 1 in the second.
    table, memory: rows at [packet, row], for laws with arrays of numbers and for laws that remember; shared: see table_number.
    bounded: of them, those alone that one law may see (see own_rows).
    """
    Lane, Lane3 = lane(width, real), lane3(width, real)
    directions = {"north": Lane3, "east": Lane3, "down": Lane3, "b": Lane3, "nu": Lane3, "Om": Lane3}
    times = {"t": real, "h": real, "step": wp.int32, "second": wp.int32}
    kinds = {"table": table_number(width, real, shared), "memory": Lane}
    rows = {name: own_rows(kind) if bounded else wp.array2d(dtype=kind) for name, kind in kinds.items()}
    return struct("BoundedView" if bounded else "View", **directions, **times, **rows, packet=wp.int32, entry=wp.int32)


@functools.cache
def inertia_struct(width, real, mass, parts=()):
    """J / max J in principal axes, 1 / max J [1/(kg m2)], and max J M^-1 = mean I + anisotropy.

    The anisotropy, a diagonal or a symmetric matrix, is absent for M = m I. Apart from the mean it keeps its own
    precision: the Munk moment p x M^-1 p sees the anisotropy alone, which may be a small part of M^-1.

    parts, each present only where a scene or a method needs it:
    "turns": 1 / (2 J), for the turns about the axes;
    "rates": 1 / J, for methods that ask for rates many times a step;
    "x": coupling of the turns, the pitches k and the hops U12, U13, U23 (coupled_inertia);
    "w": S, the symmetric coupling of the coupled Moser-Veselov step;
    "inverse": blocks of the inverse of the 6x6 inertia in the user's axes: upper left, upper right, lower right, 3x3;
    "coupled": E = M^-1 C at the origin of the state and at that of the forces, 3x3;
    "dense": the inertia at the origin of the forces as M and J (and C where coupled), for velocity-dependent laws;
    "origin": the user's origin from that of the state, and from that of the forces, where events and water are taken;
    "modified": 1 / J, and the coefficients of the series s (shrink) and d (shift) of the modified inertia;
    "water": displaced mass less mass, and displaced mass times its lever less mass times its own;
    "shear": dry mass, and added mass of translation;
    "lever": dry mass times its lever, and added mass A12, about the user's origin;
    "axes": the kernel's body axes in the user's, 3x3.
    """
    Lane, Lane3 = lane(width, real), lane3(width, real)
    Matrix3, Symmetric3 = matrix3_struct(width, real), symmetric3(width, real)
    fields = {"J": Lane3, "inverse_scale": Lane, "mean": Lane}
    if mass != "isotropic":
        fields["anisotropy"] = {"diagonal": Lane3, "full": Symmetric3}[mass]
    if "rates" in parts:
        fields["inverse_J"] = Lane3
    if "inverse" in parts:
        fields |= dict.fromkeys(("inverse_mass", "inverse_coupling", "inverse_inertia"), Matrix3)
    if "turns" in parts:
        fields["half_over_J"] = Lane3
    if "x" in parts:
        fields |= {"pitch": Lane3, "U12": Lane, "U13": Lane, "U23": Lane}
    if "w" in parts:
        fields |= {"S": Symmetric3}
    if "coupled" in parts:
        fields |= {"E": Matrix3, "E_forces": Matrix3}
    if "dense" in parts:
        fields |= {"M": Symmetric3, "C": Matrix3, "J_forces": Symmetric3}
    if "modified" in parts:
        Series = series_struct(width, real)
        fields |= {"inverse_J": Lane3, "shrink": Series, "shift": Series}
    if "water" in parts:
        fields |= {"excess": Lane, "excess_lever": Lane3}
    if "shear" in parts:
        fields |= {"dry": Lane, "added": Symmetric3 if mass == "full" else Lane3}
    if "lever" in parts:
        fields |= {"dry_lever": Lane3, "added_coupling": Matrix3}
    if "origin" in parts:
        fields |= {"user_origin": Lane3, "user_origin_forces": Lane3}
    if "axes" in parts:
        fields["axes"] = Matrix3
    return struct("Inertia", **fields)
