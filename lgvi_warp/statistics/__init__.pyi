# SPDX-License-Identifier: Apache-2.0
# The public names of this door, one a line.

from lgvi_warp.statistics.angles import CircularMean as CircularMean
from lgvi_warp.statistics.angles import MeanAttitude as MeanAttitude
from lgvi_warp.statistics.counts import Exceedance as Exceedance
from lgvi_warp.statistics.counts import Histogram as Histogram
from lgvi_warp.statistics.moments import Covariance as Covariance
from lgvi_warp.statistics.moments import Mean as Mean
from lgvi_warp.statistics.order import Extremes as Extremes
from lgvi_warp.statistics.order import Quantiles as Quantiles
from lgvi_warp.statistics.outcomes import EndTime as EndTime
from lgvi_warp.statistics.outcomes import Outcome as Outcome
from lgvi_warp.statistics.passages import FirstPassage as FirstPassage
from lgvi_warp.statistics.paths.member_values import MemberValues as MemberValues
from lgvi_warp.statistics.paths.path import PathMaximum as PathMaximum
from lgvi_warp.statistics.paths.path import PathMean as PathMean
from lgvi_warp.statistics.paths.path import PathMinimum as PathMinimum
from lgvi_warp.statistics.paths.path import PathRange as PathRange
from lgvi_warp.statistics.paths.path import PathRms as PathRms
from lgvi_warp.statistics.paths.path import PathTime as PathTime
from lgvi_warp.statistics.values.quantity import Quantity as Quantity
