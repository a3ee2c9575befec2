# SPDX-License-Identifier: Apache-2.0
"""Model predictive control by a linear model."""
