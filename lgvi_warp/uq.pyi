# SPDX-License-Identifier: Apache-2.0
# The public names of this door, one a line.

from lgvi_warp.calls.noise import draws_of as draws_of
from lgvi_warp.physics.given_draws import NoiseDraws as NoiseDraws
from lgvi_warp.uncertainty.sensitivity.adaptor import ScalarModel as ScalarModel
from lgvi_warp.uncertainty.sensitivity.adaptor import model as model
from lgvi_warp.uncertainty.sensitivity.analyses import morris as morris
from lgvi_warp.uncertainty.sensitivity.analyses import morris_of as morris_of
from lgvi_warp.uncertainty.sensitivity.analyses import sobol as sobol
from lgvi_warp.uncertainty.sensitivity.analyses import sobol_of as sobol_of
from lgvi_warp.uncertainty.sensitivity.given_data import GivenDataIndices as GivenDataIndices
from lgvi_warp.uncertainty.sensitivity.given_data import given_data as given_data
from lgvi_warp.uncertainty.sensitivity.indices import Indices as Indices
from lgvi_warp.uncertainty.sensitivity.indices import MorrisEffects as MorrisEffects
from lgvi_warp.uncertainty.sensitivity.indices import SobolIndices as SobolIndices
from lgvi_warp.uncertainty.sensitivity.outputs import FailedMembers as FailedMembers
from lgvi_warp.uncertainty.sensitivity.outputs import Outputs as Outputs
from lgvi_warp.uncertainty.sensitivity.outputs import evaluate as evaluate
