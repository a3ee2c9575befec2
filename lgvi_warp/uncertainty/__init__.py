# SPDX-License-Identifier: Apache-2.0
"""Uncertainty of ensembles (how sure): estimates, rare events, sensitivities, derivatives."""
