# SPDX-License-Identifier: Apache-2.0
# The public names of this door, one a line.

from lgvi_warp.calls.predict import Prediction as Prediction
from lgvi_warp.studies.search.tune import Tuned as Tuned
from lgvi_warp.studies.search.worst_case import WorstCase as WorstCase
from lgvi_warp.studies.stability.map import StabilityMap as StabilityMap
from lgvi_warp.studies.sweeps.cases import Case as Case
