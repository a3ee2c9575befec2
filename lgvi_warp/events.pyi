# SPDX-License-Identifier: Apache-2.0
# The public names of this door, one a line.

from lgvi_warp.extensions.navigation.events import PositionUncertain as PositionUncertain
from lgvi_warp.physics.terms.events import Battery as Battery
from lgvi_warp.physics.terms.events import Box as Box
from lgvi_warp.physics.terms.events import MissionDone as MissionDone
from lgvi_warp.physics.terms.events import Outside as Outside
from lgvi_warp.physics.terms.events import StopTime as StopTime
from lgvi_warp.physics.terms.events import Surface as Surface
from lgvi_warp.physics.terms.floor import Floor as Floor
