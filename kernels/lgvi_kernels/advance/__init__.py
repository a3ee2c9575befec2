# SPDX-License-Identifier: Apache-2.0
"""The one fused kernel: it takes a packet of vehicles through all steps, and has only the code that the scene needs."""
