# SPDX-License-Identifier: Apache-2.0
"""Robustness of controllers: sweeps, searches, linear models and their margins."""
