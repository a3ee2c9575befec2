# SPDX-License-Identifier: Apache-2.0
"""Conversions between the user's notation (Fossen's) and the paper's: momenta, principal axes, attitudes.

velocity = nu, angular_velocity = Om, position = b, attitude = R (body to inertial); p = M nu, pi = J Om.
Every function accepts any leading dimensions; a leading dimension of 1 is broadcast.
"""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
