# SPDX-License-Identifier: Apache-2.0
# The public names of this door, one a line.

from lgvi_warp.checks.check import check_law as check_law
from lgvi_warp.checks.check_controller import check_controller as check_controller
from lgvi_warp.control.base import Allocation as Allocation
from lgvi_warp.control.base import ControlLaw as ControlLaw
from lgvi_warp.control.base import Guidance as Guidance
from lgvi_warp.control.base import MeasuringPart as MeasuringPart
from lgvi_warp.physics.terms import register as register
from lgvi_warp.physics.terms.base import Packed as Packed
from lgvi_warp.physics.terms.base import PackingContext as PackingContext
from lgvi_warp.physics.terms.base import Term as Term
from lgvi_warp.physics.terms.base import knots as knots
from lgvi_warp.physics.terms.base import number as number
from lgvi_warp.physics.terms.events import Event as Event
from lgvi_warp.physics.terms.noisy import NoisyTerm as NoisyTerm
