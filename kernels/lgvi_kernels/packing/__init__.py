# SPDX-License-Identifier: Apache-2.0
"""Kernels that put the numbers of members, which lie side by side in memory, into lanes."""
