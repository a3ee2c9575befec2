# SPDX-License-Identifier: Apache-2.0
"""Parts of a controller, one file each."""
