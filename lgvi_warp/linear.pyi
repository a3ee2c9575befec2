# SPDX-License-Identifier: Apache-2.0
# The public names of this door, one a line.

from lgvi_warp.studies.linear.linearize import LinearModel as LinearModel
from lgvi_warp.studies.linear.linearize import linearize as linearize
from lgvi_warp.studies.linear.lqr import Regulator as Regulator
from lgvi_warp.studies.linear.lqr import lqr as lqr
from lgvi_warp.studies.linear.margins import Margins as Margins
from lgvi_warp.studies.linear.margins import margins as margins
from lgvi_warp.studies.linear.mpc import mpc as mpc
from lgvi_warp.studies.linear.trim import Trim as Trim
from lgvi_warp.studies.linear.trim import trim as trim
