# SPDX-License-Identifier: Apache-2.0
"""Steady motions, linear models of one period, and stability margins of loops."""
