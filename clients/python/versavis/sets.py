# SPDX-License-Identifier: BSD-3-Clause
"""Sets: what all cameras saw at one tick, with the IMU samples since the set before."""
import ctypes

from . import _library as library
from .items import Frame, Held
from .streams import Handle, Source, encoded, nanoseconds, opened, stream_options
from .times import Time
from .window import GAPS, samples_at


class FrameSet:
    """Frames of one tick.

    tick: equal for all frames.
    time: of the first camera that is there, a Time; spread: latest less earliest stamp, ns.
    frames: in the order in which the cameras were named; None where one is missing.
    imu: array of the samples since the set before, up to this one's latest stamp, see imu_dtype;
    imu_lost: samples missing within them; imu_gap: why they do not reach from the set before to
    this one, as ImuSpan.gap; imu_covered: they do. The first set has none ("begin"); the first of
    an epoch has those of the epoch ("epoch").
    """

    def __init__(self, made, count):
        self.tick, self.time, self.spread = made.tick, Time.of(made.time), made.spread
        self.frames = [frame_of(made, camera) for camera in range(count)]
        self.imu = samples_at(made.imu, made.imu_count)
        self.imu_lost, self.imu_gap = made.imu_lost, GAPS[made.imu_gap]

    @property
    def imu_covered(self):
        return self.imu_gap is None

    @property
    def complete(self):
        """True if each camera's frame is there."""
        return None not in self.frames

    @property
    def valid(self):
        """True while the writer has touched none of the payloads."""
        return all(frame is None or frame.valid for frame in self.frames)

    def close(self):
        """Gives the memory of all frames back."""
        for frame in self.frames:
            if frame is not None:
                frame.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def __repr__(self):
        return f"<versavis.FrameSet tick {self.tick}, {self.time}>"


def frame_of(made, camera):
    """None where it is missing."""
    held = Held(library.Item())
    result = library.functions.set_frame(made, camera, held.item)
    return Frame(held) if result == library.OK else None


class Sets(Source):
    """Sets of frames, one after the other. Frames that were lost only count: see report()."""

    def __init__(self, handle, cameras):
        super().__init__(handle, "sets of " + ", ".join(cameras))
        self._count = len(cameras)

    def report(self):
        """So far: sets delivered; incomplete ones, delivered or not; frames left_out, as they have
        no tick, are suspect, of another life of the service, or late; frames lost, as they were
        overwritten before they were read; sets skipped by latest()."""
        known = library.SetReport()
        with self._opened() as pointer:
            library.functions.sets_report(pointer, known)
        self.lost = known.lost
        return {name: getattr(known, name) for name, _ in known._fields_[2:]}

    def next(self, timeout=None):
        """The next set, waiting up to timeout seconds (None: without end; 0: not at all).

        Raises Nothing, Restarted or Gone: call again, and it goes on."""
        return self._set(library.functions.sets_next, timeout)

    def latest(self, timeout=None):
        """The newest set, passing over older ones; if there is none, the next. Its IMU samples are
        those since the set that came before."""
        return self._set(library.functions.sets_latest, timeout)

    def _set(self, function, timeout):
        made = library.Set()
        try:
            result = self._wait(lambda pointer, ns: function(pointer, made, ns), timeout)
            if result != library.OK:
                raise self._pause(result)
            return FrameSet(made, self._count)
        finally:
            library.functions.set_release(made)

    def fileno(self):
        """For select, selectors and asyncio: readable when next(0) may find something, until it
        raises Nothing or Gone. It belongs to the sets."""
        return self._descriptor(library.functions.sets_fd)


def sets(cameras, imu=None, patience=0.2, partial=False, suspect=False, instance=None,
         start="next", after_loss=None, owner=None, sealed_only=False, wait=0):
    """Opens sets of frames of the cameras, which the board must trigger; those of another instance
    as "rear/cam0".

    imu: name of its stream; None: none.
    patience: seconds from a set's first frame until it is given up.
    partial: sets that lack a frame are delivered, too: at once, where a camera has ended. A camera
    that is not there yet is taken in when it appears.
    suspect: frames whose pairing is not proved count, too.
    The rest as for open(). Raises Error with what to do."""
    if isinstance(cameras, str):
        raise TypeError("sets() needs a list of the cameras' names")
    cameras = list(cameras)
    streams = stream_options(start, after_loss, owner, sealed_only)
    options = library.SetsOptions(partial, suspect, 0, encoded(imu),
                                  max(1, nanoseconds(patience)), ctypes.pointer(streams))
    names = (ctypes.c_char_p * len(cameras))(*map(encoded, cameras))
    pointer = opened(lambda pointer, error: library.functions.sets_open(
        encoded(instance), names, len(cameras), options, pointer, error), wait)
    return Sets(Handle(pointer, library.functions.sets_close), cameras)
