# SPDX-License-Identifier: Apache-2.0
"""Extreme numbers and files: accurate to a stated bound, flagged, or refused; never silently wrong."""
