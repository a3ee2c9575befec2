# SPDX-License-Identifier: Apache-2.0
"""Device code of the parts, one file each, as in lgvi_kernels.laws.control."""
