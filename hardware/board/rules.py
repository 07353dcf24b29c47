# SPDX-License-Identifier: BSD-3-Clause
"""Measures, mm, that router, files and checks share; those of an ordinary pool, with some room."""

CLEARANCE = 0.16
EDGE = 0.35  # copper from the edge
VIA, DRILL = 0.6, 0.3
WIDTHS = (0.2, 0.3, 0.6)
ISOLATION = 2.0
FACE = ("F.Cu", "B.Cu")
