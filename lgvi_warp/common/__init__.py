# SPDX-License-Identifier: Apache-2.0
"""Modules that do not depend on vehicles: faults, statuses, durable and untrusted files, random numbers, the machine."""
