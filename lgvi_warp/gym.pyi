# SPDX-License-Identifier: Apache-2.0
# The public names of this door, one a line.

from lgvi_warp.calls.gym import VectorEnv as VectorEnv
