# SPDX-License-Identifier: Apache-2.0
# The public names of this door, one a line.

from lgvi_warp.extensions.learning.gym import VectorEnv as VectorEnv
from lgvi_warp.extensions.learning.sb3 import sb3 as sb3
