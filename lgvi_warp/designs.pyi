# SPDX-License-Identifier: Apache-2.0
# The public names of this door, one a line.

from lgvi_warp.sampling.designs.designs import Morris as Morris
from lgvi_warp.sampling.designs.designs import Saltelli as Saltelli
from lgvi_warp.sampling.designs.grid import Grid as Grid
from lgvi_warp.sampling.designs.hypercube import LatinHypercube as LatinHypercube
from lgvi_warp.sampling.designs.levels import UnitCubePoints as UnitCubePoints
from lgvi_warp.sampling.designs.random import Random as Random
from lgvi_warp.sampling.designs.sequences import Halton as Halton
from lgvi_warp.sampling.designs.sequences import Sobol as Sobol
from lgvi_warp.sampling.designs.table import Table as Table
