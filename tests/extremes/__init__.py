# SPDX-License-Identifier: Apache-2.0
"""Where numbers and files are as bad as they can be: accurate to a stated bound, flagged, or refused; never silently wrong."""
