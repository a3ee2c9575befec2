# SPDX-License-Identifier: Apache-2.0
"""The events that a scene may name, one file each: `distance(view, p)`, positive until the event; p: the declared numbers."""
