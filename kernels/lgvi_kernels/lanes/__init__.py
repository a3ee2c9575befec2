# SPDX-License-Identifier: Apache-2.0
"""Numbers, vectors, matrices and states of a packet of vehicles, side by side in SIMD lanes."""
