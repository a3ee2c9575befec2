# SPDX-License-Identifier: Apache-2.0
"""Footprint: the smallest regions that hold given shares of the members' places."""
