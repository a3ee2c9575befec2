# SPDX-License-Identifier: Apache-2.0
"""Pictures of runs and studies, drawn with Matplotlib: each is a function that returns its axes."""
