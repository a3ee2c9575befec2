# SPDX-License-Identifier: Apache-2.0
"""Assimilation, exports to maps and ROS, and the predictive control law."""
