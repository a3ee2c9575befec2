# SPDX-License-Identifier: Apache-2.0
# The public names of this door, one a line.

from lgvi_warp.sampling.distributions.basic import Choice as Choice
from lgvi_warp.sampling.distributions.basic import LogNormal as LogNormal
from lgvi_warp.sampling.distributions.basic import Normal as Normal
from lgvi_warp.sampling.distributions.basic import TruncatedNormal as TruncatedNormal
from lgvi_warp.sampling.distributions.basic import Uniform as Uniform
from lgvi_warp.sampling.distributions.copula import Copula as Copula
from lgvi_warp.sampling.distributions.density import KernelDensity as KernelDensity
from lgvi_warp.sampling.distributions.derived import Derived as Derived
from lgvi_warp.sampling.distributions.factor import Factor as Factor
from lgvi_warp.sampling.distributions.joint import CorrelatedNormal as CorrelatedNormal
from lgvi_warp.sampling.distributions.joint import PhysicalInertia as PhysicalInertia
from lgvi_warp.sampling.distributions.joint import PositiveDefinite as PositiveDefinite
from lgvi_warp.sampling.distributions.joint import RotationNormal as RotationNormal
from lgvi_warp.sampling.distributions.joint import UniformRotation as UniformRotation
from lgvi_warp.sampling.distributions.named import ScipyDistribution as ScipyDistribution
