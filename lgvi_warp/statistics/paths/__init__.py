# SPDX-License-Identifier: Apache-2.0
"""Statistics of one number of each member's path, and the number itself."""
