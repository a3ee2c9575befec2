# SPDX-License-Identifier: Apache-2.0
"""Pages about runs and studies: the report, and how to run them again."""
