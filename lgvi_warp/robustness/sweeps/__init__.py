# SPDX-License-Identifier: Apache-2.0
"""Sweeps: run cases of a closed loop on the same members, and compare their success."""
