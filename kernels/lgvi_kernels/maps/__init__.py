# SPDX-License-Identifier: Apache-2.0
"""The maps that methods are made of, each advancing a packet, and the solvers of their equations."""
