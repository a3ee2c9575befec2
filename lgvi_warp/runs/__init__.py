# SPDX-License-Identifier: Apache-2.0
"""Runs of an ensemble: solving in memory or into a store, and the results they leave."""
