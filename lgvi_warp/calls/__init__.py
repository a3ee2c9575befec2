# SPDX-License-Identifier: Apache-2.0
"""Calls that run an ensemble: solve, prepare, predict, resume, merge and warm."""
