# SPDX-License-Identifier: BSD-3-Clause
"""IMU samples as arrays, and those between two instants."""
import ctypes

import numpy as np

from . import _library as library
from .streams import (SLICE, Handle, Source, deadline_after, encoded, nanoseconds, opened,
                      remaining, stream_options)

# As versavis_imu_sample lies in memory.
imu_dtype = np.dtype([
    ("life", "<u8"), ("time", "<i8"), ("time_epoch", "<u4"), ("time_reserved", "<u4"),
    ("board_time", "<i8"), ("host_time", "<i8"), ("number", "<u8"),
    ("gyro", "<f4", 3), ("accel", "<f4", 3), ("magnetic", "<f4", 3), ("temperature", "<f4"),
    ("pressure", "<f4"), ("sigma", "<u4"), ("epoch", "<u4"), ("flags", "<u4"),
    ("filter_delay", "<i8"), ("accel_age", "<i4"), ("reserved", "<u4"),
])
assert imu_dtype.itemsize == ctypes.sizeof(library.ImuSample)


def samples_at(address, count):
    """An array of one's own, of imu_dtype."""
    samples = np.empty(count, imu_dtype)
    if count > 0:
        ctypes.memmove(samples.ctypes.data, address, samples.nbytes)
    return samples


# Why samples do not reach from one instant to another, by the library's number.
GAPS = (None, "begin", "end", "epoch", "numbers")


class ImuSpan:
    """samples: array, see imu_dtype; lost: how many are missing within them; beyond: the first
    sample after the second instant (None: not there yet), to interpolate.

    gap: why they do not reach from the first instant to the second; None: they do. "begin": no
    sample at or before the first is known; "end": none of the second or later has come yet;
    "epoch": it began or ended between them, and times beyond do not compare; "numbers": those of
    the samples stand still or go back, so nobody knows how many are missing."""

    def __init__(self, span):
        self.samples = samples_at(span.samples, span.count)
        self.lost, self.gap = span.lost, GAPS[span.gap]
        self.beyond = samples_at(span.beyond, 1)[0] if span.beyond else None

    @property
    def covered(self):
        return self.gap is None

    @property
    def complete(self):
        return self.covered and self.lost == 0


class ImuWindow(Source):
    """Samples between any two instants, as far as the ring holds them."""

    def between(self, after, upto, patience=None):
        """An ImuSpan of the samples with after < time <= upto, two Times, as of frames. Waits for a
        sample of upto or later, or of a later epoch, for patience seconds (None: without end).

        Raises Restarted, once: times before and after do not compare. Raises OtherEpoch: after and
        upto do not."""
        if upto < after:
            raise ValueError("between() needs the earlier instant first")
        span = library.ImuSpan()
        deadline = deadline_after(patience)
        while True:
            left = remaining(deadline)
            with self._opened() as pointer:
                result = library.functions.imu_window_span(pointer, after.library(), upto.library(),
                                                           nanoseconds(left), span)
                made = ImuSpan(span) if result == library.OK else None
            if made is None:
                raise self._pause(result)
            ended = made.gap == "epoch" or made.beyond is not None
            if made.covered or ended or left < SLICE:
                return made


    def fileno(self):
        """For select, selectors and asyncio: readable when samples may have come, until between()
        has looked. It belongs to the window."""
        return self._descriptor(library.functions.imu_window_fd)


def imu_window(name, instance=None, owner=None, sealed_only=False, wait=0):
    """Opens the samples of an IMU, those that the ring still holds included.

    The arguments are as for open(). Raises Error with what to do."""
    options = stream_options("oldest", None, owner, sealed_only)
    pointer = opened(lambda pointer, error: library.functions.imu_window_open(
        encoded(instance), encoded(name), options, pointer, error), wait)
    return ImuWindow(Handle(pointer, library.functions.imu_window_close), name)
