# SPDX-License-Identifier: Apache-2.0
"""Pages about runs and studies: the report, and instructions to repeat a run."""
