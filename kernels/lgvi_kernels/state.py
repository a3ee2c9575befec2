"""What a packet carries through the steps: the state, the vehicle's constants, and what a law may look at."""

import functools

import warp as wp

from lgvi_kernels.lanes import lane, lane3, symmetric3


@functools.cache
def alarm_struct(width, real):
    """Per lane: the first failure seen (0: none) and the square of the value that crossed its limit."""
    Lane = lane(width, real)

    @wp.struct
    class Alarm:
        code: Lane
        size: Lane

    return Alarm


@functools.cache
def state_struct(width, real):
    """b [m, inertial], the rows of R (body to inertial), p = M nu [N s] and pi = J Om / max J [1/s] in principal axes."""
    Lane3, Alarm = lane3(width, real), alarm_struct(width, real)

    @wp.struct
    class State:
        b: Lane3
        R0: Lane3
        R1: Lane3
        R2: Lane3
        p: Lane3
        pi: Lane3
        alarm: Alarm

    return State


@functools.cache
def wrench_struct(width, real):
    """Force [N] and torque [N m] in principal axes."""
    Lane3 = lane3(width, real)

    @wp.struct
    class Wrench:
        force: Lane3
        torque: Lane3

    return Wrench


@functools.cache
def view_struct(width, real):
    """What a law may look at: z = R^T e3 (downwards, in body axes) and the position b [m]."""
    Lane3 = lane3(width, real)

    @wp.struct
    class View:
        z: Lane3
        b: Lane3

    return View


@functools.cache
def inertia_struct(width, real, mass):
    """J / max J in principal axes, 1 / max J [1/(kg m2)], and M^-1 [1/kg] = mean I + anisotropy.

    The anisotropy, a diagonal or a symmetric matrix, is absent for M = m I. Apart from the mean it keeps its own
    precision: the Munk moment p x M^-1 p sees the anisotropy alone, which may be a small part of M^-1.
    """
    Lane, Lane3 = lane(width, real), lane3(width, real)
    if mass == "isotropic":

        @wp.struct
        class Inertia:
            J: Lane3
            inverse_scale: Lane
            mean: Lane

        return Inertia

    Matrix = {"diagonal": Lane3, "full": symmetric3(width, real)}[mass]

    @wp.struct
    class AnisotropicInertia:
        J: Lane3
        inverse_scale: Lane
        mean: Lane
        anisotropy: Matrix

    return AnisotropicInertia
