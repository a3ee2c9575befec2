# SPDX-License-Identifier: Apache-2.0
"""Which of the varied parameters make a quantity of interest vary: Sobol indices, Morris' screening, and adaptors."""
