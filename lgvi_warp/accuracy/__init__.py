# SPDX-License-Identifier: Apache-2.0
"""Accuracy of methods (how accurate): trade-off, suggested settings, stability maps."""
