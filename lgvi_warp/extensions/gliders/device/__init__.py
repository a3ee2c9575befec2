# SPDX-License-Identifier: Apache-2.0
"""Device code of the terms of gliders, one file each, as in lgvi_kernels.laws."""
