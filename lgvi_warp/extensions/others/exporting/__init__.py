# SPDX-License-Identifier: Apache-2.0
"""Exports of tracks to maps (GeoJSON, KML) and to ROS (MCAP)."""
