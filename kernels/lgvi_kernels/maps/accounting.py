# SPDX-License-Identifier: Apache-2.0
"""The energy that a vehicle uses: the power of all laws, integrated beside the state with the method's order.

The sum is a row of the memory, and the digits that it cannot hold are the row behind it (see sums.py): a run of many steps
loses none. Rows of the memory are put back wherever a step is made again, so no step counts twice.
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, element, mul, ones, set_element, sub  # noqa: F401
from lgvi_kernels.lanes.sums import carried
from lgvi_kernels.maps.compose import superpose
from lgvi_kernels.maps.submaps import look


def keeps_account(law):
    """Whether the memory of a law is the account of energy."""
    return getattr(law, "ACCOUNT", False)


@wp.func
def account_of(c: Any, half: int):
    """The energy used [J], and its low part. half: row at which the half of the memory begins that is read."""
    row = half + c.account
    return element(c.memory, c.packet, row, 0), element(c.memory, c.packet, row + 1, 0)


@wp.func
def put_account(c: Any, half: int, used: Any, low: Any):
    """Write the energy used, and its low part."""
    row = half + c.account
    set_element(c.memory, c.packet, row, 0, used)
    set_element(c.memory, c.packet, row + 1, 0, low)


@wp.func
def spend(c: Any, energy: Any):
    """Add energy [J] to the account."""
    used, low = account_of(c, 0)
    used, low = carried(used, low, energy)
    put_account(c, 0, used, low)


def make_power_at(View, laws):
    """(x, c, h, nu, Om) -> the power [W] that all laws take at a state and its velocities at the origin of the forces."""
    power = superpose(laws, "power")

    @wp.func
    def power_at(x: Any, c: Any, h: Any, nu: Any, Om: Any):
        view = look(View(), x, c, h)
        view.nu = nu
        view.Om = Om
        return power(ones(view.b.x) - ones(view.b.x), view, c.params)

    return power_at


def make_kick_account(laws, velocities):
    """(x, c, h, view, p, pi): account a kick of h from the momenta p, pi to those of x, with the power at their mean.

    The view is that of the middle, where what laws remember is known: so the sum is symmetric, and has the kick's order.
    """
    power = superpose(laws, "power")

    @wp.func
    def account(x: Any, c: Any, h: Any, view: Any, p: Any, pi: Any):
        half = h.dtype(0.5)
        nu, Om = velocities(c.inertia, half * (p + x.p), half * (pi + x.pi))
        view.nu = nu
        view.Om = Om
        spend(c, h * power(ones(view.b.x) - ones(view.b.x), view, c.params))

    return account


def make_map_account(View, laws, velocities):
    """(x, c, h): account a map of h with the power at the state x."""
    power_at = make_power_at(View, laws)

    @wp.func
    def account(x: Any, c: Any, h: Any):
        nu, Om = velocities(c.inertia, x.p, x.pi)
        spend(c, h * power_at(x, c, h, nu, Om))

    return account


@wp.func
def with_power(energy: Any, k: Any, h: Any):
    """Energy plus that of a time h at the power of a stage: a move of make_moves."""
    return energy + h * k.power
