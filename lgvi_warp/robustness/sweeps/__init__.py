# SPDX-License-Identifier: Apache-2.0
"""Sweeps: cases of a closed loop on the same members, what of them holds, and which case is better."""
