# SPDX-License-Identifier: Apache-2.0
"""Footprint: the smallest regions that contain given shares of the members' positions."""
