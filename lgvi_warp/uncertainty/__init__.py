# SPDX-License-Identifier: Apache-2.0
"""Uncertainty quantification of ensembles: estimates, rare events, sensitivities, derivatives."""
