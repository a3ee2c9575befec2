# SPDX-License-Identifier: Apache-2.0
"""Steady motions, linear models of a period, and how far a loop is from the edge."""
