# SPDX-License-Identifier: Apache-2.0
"""Estimate one statistic to a requested error at the lowest cost."""
