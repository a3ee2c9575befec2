# SPDX-License-Identifier: Apache-2.0
"""Capabilities beside the core, one folder each; nothing of the core or its uses imports them."""
