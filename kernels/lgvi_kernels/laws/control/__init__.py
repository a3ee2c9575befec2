# SPDX-License-Identifier: Apache-2.0
"""The parts of a controller, one file each: the struct `params(width, real)`, and one function or more.

A controller acts at control ticks, once a period, between two steps. Its parts then act in this order, those of one role in
the scene's order:

measure(y, p): the Measurement, the truth at first, as a sensor or an estimator changes it;
guide(r, y, p): the Reference, that is the wanted motion, as a guidance changes it;
foresee(s, r, y, p): keeps what it needs of the Reference s that is wanted y.start ticks later, and returns it; for the next
    AHEAD ticks of a module that has this, where guidance follows from the time alone;
control(w, r, y, p): the demand, a Wrench about the user's origin in the user's body axes, plus that of a law;
allocate(w, y, p): writes the commands of actuators into the memory, and returns the demand that they cannot deliver;
send(y, p): changes commands on their way to the actuators (a delay, a fault), and returns its first argument.

`y` has the memory and the table of a View, so that `remembered`, `remember`, `row1`, `row3`, `table1` of lgvi_kernels.law work
on it. Without `params` the struct holds the numbers that the host's part declares, as lanes and 3-vectors of lanes.
"""
