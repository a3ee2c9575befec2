# SPDX-License-Identifier: Apache-2.0
"""Terms of the sea, one file each."""
