# SPDX-License-Identifier: Apache-2.0
"""What comes with the package beside its core, one folder each; the core finds them by lgvi_warp.common.extensions."""
