# SPDX-License-Identifier: Apache-2.0
"""Device code of the terms of the sea, one file each, as in lgvi_kernels.laws."""
