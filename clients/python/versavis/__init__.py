# SPDX-License-Identifier: BSD-3-Clause
"""Reads the streams of VersaVIS: frames, IMU samples, events and the status document.

    import versavis
    with versavis.open("cam0") as stream:
        for frame in stream:
            print(frame.time, frame.read(numpy.mean))

Times of items are integers of nanoseconds. Time-outs are seconds; None waits without end. Needs
the library libversavis.so.0; VERSAVIS_LIBRARY may name its path.
"""
from ._library import library_version
from .errors import (Error, Gone, Lost, Nothing, Overtaken, Pause, Released, Restarted,
                     ViewEscaped)
from .items import Event, Flags, Frame, ImuSample, Item, Status
from .sets import FrameSet, Sets, sets
from .streams import Stream, open, wait  # pylint: disable=redefined-builtin
from .window import ImuSpan, ImuWindow, imu_dtype, imu_window

__version__ = "0.2.0"
__all__ = [
    "Error", "Event", "Flags", "Frame", "FrameSet", "Gone", "ImuSample", "ImuSpan",
    "ImuWindow", "Item", "Lost", "Nothing", "Overtaken", "Pause", "Released", "Restarted", "Sets",
    "Status", "Stream", "ViewEscaped", "imu_dtype", "imu_window", "library_version", "open", "sets",
    "wait",
]
