# SPDX-License-Identifier: Apache-2.0
"""Accuracy of the integration methods: trade-off, suggested settings, stability maps."""
