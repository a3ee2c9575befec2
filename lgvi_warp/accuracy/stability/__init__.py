# SPDX-License-Identifier: Apache-2.0
"""Maps of where each method is accurate, bounded or unstable, over two parameters."""
