# SPDX-License-Identifier: Apache-2.0
"""Runs of an ensemble in memory, and the settings of a run: request, plan, default method, width and step error."""
