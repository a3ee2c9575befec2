# SPDX-License-Identifier: Apache-2.0
"""Device code of the predictive law, as in lgvi_kernels.laws.control."""
