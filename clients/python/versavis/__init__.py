# SPDX-License-Identifier: BSD-3-Clause
"""Reads the streams of VersaVIS: frames, IMU samples, events and the status document.

    import versavis
    with versavis.open("cam0") as stream:
        for frame in stream:
            print(frame.time, frame.read(numpy.mean))

Times of items are a Time, with nanoseconds in `ns`. Time-outs are seconds; None waits without end.
Needs the library libversavis.so.1; VERSAVIS_LIBRARY may name its path.
"""
from ._library import library_version
from .errors import (Absent, Damaged, Error, Exhausted, Forbidden, Gone, Lost, NotTrusted, Nothing,
                     OtherEpoch, Overtaken, Pause, Released, Restarted, Unsupported, ViewEscaped,
                     WrongKind)
from .items import Event, Flags, Frame, ImuSample, Item, NmeaSentence, Status
from .sets import FrameSet, Sets, sets
from .streams import (Stream, StreamInfo, list_streams, open,  # pylint: disable=redefined-builtin
                      wait)
from .times import Time
from .window import ImuSpan, ImuWindow, imu_dtype, imu_window

__version__ = "0.2.0"
__all__ = [
    "Absent", "Damaged", "Error", "Event", "Exhausted", "Flags", "Forbidden", "Frame",
    "FrameSet", "Gone", "ImuSample", "ImuSpan", "ImuWindow", "Item", "Lost", "NotTrusted",
    "Nothing", "OtherEpoch", "Overtaken", "Pause", "Released", "Restarted", "Sets", "Status",
    "Stream", "StreamInfo", "Time", "Unsupported", "ViewEscaped", "WrongKind", "imu_dtype",
    "imu_window", "library_version", "list_streams", "open", "sets", "wait",
]
