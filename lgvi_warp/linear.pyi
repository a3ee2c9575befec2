# SPDX-License-Identifier: Apache-2.0
# The public names of this door, one a line.

from lgvi_warp.extensions.others.control.mpc import mpc as mpc
from lgvi_warp.robustness.linear.linearize import LinearModel as LinearModel
from lgvi_warp.robustness.linear.linearize import linearize as linearize
from lgvi_warp.robustness.linear.lqr import Regulator as Regulator
from lgvi_warp.robustness.linear.lqr import lqr as lqr
from lgvi_warp.robustness.linear.margins import Margins as Margins
from lgvi_warp.robustness.linear.margins import margins as margins
from lgvi_warp.robustness.linear.open_loop import OpenLoops as OpenLoops
from lgvi_warp.robustness.linear.open_loop import loop as loop
from lgvi_warp.robustness.linear.trim import Trim as Trim
from lgvi_warp.robustness.linear.trim import trim as trim
