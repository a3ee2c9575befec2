# SPDX-License-Identifier: Apache-2.0
"""Searches in which a generation is an ensemble: the worst case within bounds, and the best gains for a risk."""
