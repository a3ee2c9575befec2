# SPDX-License-Identifier: Apache-2.0
"""Pictures of runs and studies, drawn with Matplotlib. Each function draws one picture and returns its axes."""
