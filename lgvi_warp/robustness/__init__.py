# SPDX-License-Identifier: Apache-2.0
"""Robustness of controllers (how robust): sweeps, searches, linear models and their margins."""
