# SPDX-License-Identifier: Apache-2.0
"""Extensions that come with the package beside its core, one folder each.

The core finds them by lgvi_warp.common.extensions.
"""
