# SPDX-License-Identifier: Apache-2.0
"""Extensions that come with the package in addition to its core, one folder each.

The core finds them through lgvi_warp.common.extensions.
"""
