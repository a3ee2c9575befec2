# SPDX-License-Identifier: Apache-2.0
"""Metrics of a control loop: one number of each member."""
