# SPDX-License-Identifier: Apache-2.0
"""Recordings: drawing data of a run in the rerun viewer as a world, graphs and texts, with their layout."""
