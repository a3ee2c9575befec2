# SPDX-License-Identifier: Apache-2.0
"""Keepers: what a run retains of each block, namely outcomes, samples and statistics."""
