# SPDX-License-Identifier: Apache-2.0
"""What knows no vehicle: faults, statuses, durable files, files of unknown origin, random numbers and the machine."""
