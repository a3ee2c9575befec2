# SPDX-License-Identifier: Apache-2.0
"""Keepers: objects that store the outcomes, samples or statistics of each block of a run."""
