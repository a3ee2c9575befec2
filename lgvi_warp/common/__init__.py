# SPDX-License-Identifier: Apache-2.0
"""Parts that know no vehicle: faults, statuses, durable files, files of unknown origin, random numbers and the machine."""
