# SPDX-License-Identifier: Apache-2.0
# The public names of this door, one a line.

from lgvi_warp.calls.predict import Prediction as Prediction
from lgvi_warp.sampling.final import Final as Final
from lgvi_warp.studies.assimilation.answer import Assimilated as Assimilated
from lgvi_warp.studies.assimilation.innovations import InnovationTest as InnovationTest
from lgvi_warp.studies.assimilation.series import Series as Series
from lgvi_warp.studies.comparison import Candidate as Candidate
from lgvi_warp.studies.derivatives.answer import Derivatives as Derivatives
from lgvi_warp.studies.estimating.answer import Estimated as Estimated
from lgvi_warp.studies.files import Saved as Saved
from lgvi_warp.studies.rare.answer import RareEvent as RareEvent
from lgvi_warp.studies.reference import Growth as Growth
from lgvi_warp.studies.search.tune import Tuned as Tuned
from lgvi_warp.studies.search.worst_case import WorstCase as WorstCase
from lgvi_warp.studies.stability.grid import Axis as Axis
from lgvi_warp.studies.stability.grid import Line as Line
from lgvi_warp.studies.stability.map import Cell as Cell
from lgvi_warp.studies.stability.map import StabilityMap as StabilityMap
from lgvi_warp.studies.suggest import Suggestion as Suggestion
from lgvi_warp.studies.sweeps.cases import Case as Case
from lgvi_warp.studies.tradeoff import Measurement as Measurement
from lgvi_warp.studies.tradeoff import Tradeoff as Tradeoff
