# SPDX-License-Identifier: Apache-2.0
"""Runs in zarr stores on disk: written block by block, resumed, merged, opened and exported."""
