# SPDX-License-Identifier: Apache-2.0
"""Searches whose generations are ensembles: the worst case within bounds, and the gains with the lowest risk."""
