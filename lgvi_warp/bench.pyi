# SPDX-License-Identifier: Apache-2.0
# The public names of this door, one a line.

from lgvi_warp.measuring.term_cost import term_cost as term_cost
