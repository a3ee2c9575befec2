# SPDX-License-Identifier: Apache-2.0
"""Sensitivity of a quantity of interest to the varied parameters: Sobol indices, Morris screening, and adaptors."""
