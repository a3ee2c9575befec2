# SPDX-License-Identifier: Apache-2.0
"""Control fins that a controller drives."""

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms.control_fins import ControlFins


class DrivenFins(ControlFins):
    """Attributes as in the twin's `ControlFins`."""

    driven = True

    def effort(self, command: Array) -> Array:
        """The angles of commands [rad]."""
        return command

    def command_for(self, effort: Array) -> Array:
        """The commands of angles [rad]."""
        return effort
