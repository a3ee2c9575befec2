# SPDX-License-Identifier: Apache-2.0
# The public names of this door, one a line.

from lgvi_warp.accuracy.stability.grid import Axis as Axis
from lgvi_warp.accuracy.stability.grid import Line as Line
from lgvi_warp.accuracy.stability.map import Cell as Cell
from lgvi_warp.accuracy.stability.map import StabilityMap as StabilityMap
from lgvi_warp.accuracy.suggest import Suggestion as Suggestion
from lgvi_warp.accuracy.tradeoff import Measurement as Measurement
from lgvi_warp.accuracy.tradeoff import Tradeoff as Tradeoff
from lgvi_warp.calls.predict import Prediction as Prediction
from lgvi_warp.criteria.files import Saved as Saved
from lgvi_warp.extensions.others.assimilation.answer import Assimilated as Assimilated
from lgvi_warp.extensions.others.assimilation.innovations import InnovationTest as InnovationTest
from lgvi_warp.extensions.others.assimilation.series import Series as Series
from lgvi_warp.measuring.comparison import Candidate as Candidate
from lgvi_warp.measuring.reference import Growth as Growth
from lgvi_warp.robustness.search.tune import Tuned as Tuned
from lgvi_warp.robustness.search.worst_case import WorstCase as WorstCase
from lgvi_warp.robustness.sweeps.cases import Case as Case
from lgvi_warp.sampling.final import Final as Final
from lgvi_warp.uncertainty.derivatives.answer import Derivatives as Derivatives
from lgvi_warp.uncertainty.estimating.answer import Estimated as Estimated
from lgvi_warp.uncertainty.footprint.answer import Footprint as Footprint
from lgvi_warp.uncertainty.footprint.answer import Region as Region
from lgvi_warp.uncertainty.footprint.footprint import footprint as footprint
from lgvi_warp.uncertainty.rare.answer import RareEvent as RareEvent
