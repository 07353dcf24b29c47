# SPDX-License-Identifier: BSD-3-Clause
"""Sets: what all cameras saw at one tick, with the IMU samples since the set before."""
import ctypes

from . import _library as library
from .errors import Error
from .items import Frame, Held
from .streams import Handle, Source, encoded, nanoseconds, stream_options
from .window import GAPS, samples_at


class FrameSet:
    """Frames of one tick.

    life, epoch, tick: equal for all frames.
    time: output time of the first camera that is there, ns; spread: latest less earliest, ns.
    frames: in the order in which the cameras were named; None where one is missing.
    imu: array of the samples since the set before, up to this one's latest stamp, see imu_dtype;
    imu_lost: samples missing within them; imu_gap: why they do not reach from the set before to
    this one, as ImuSpan.gap; imu_covered: they do. The first set has none ("begin"); the first of
    an epoch has those of the epoch ("epoch").
    """

    def __init__(self, made, held):
        self.life, self.epoch, self.tick = made.life, made.epoch, made.tick
        self.time, self.spread = made.time, made.spread
        self.frames = [Frame(frame) if made.present >> i & 1 else None
                       for i, frame in enumerate(held)]
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
        return f"<versavis.FrameSet tick {self.tick}, {self.time} ns>"


class Sets(Source):
    """Sets of frames, one after the other. Frames that were lost only count: see report()."""

    def __init__(self, handle, cameras):
        super().__init__(handle, "sets of " + ", ".join(cameras))
        self._count = len(cameras)

    def report(self):
        """So far: sets delivered; incomplete ones, delivered or not; frames left_out, as they have
        no tick, are suspect, of another life of the service, or late; frames lost, as they were
        overwritten before they were read."""
        known = library.SetReport()
        with self._opened() as pointer:
            library.functions.sets_report(pointer, known)
        self.lost = known.lost
        return {name: getattr(known, name) for name, _ in known._fields_}

    def next(self, timeout=None):
        """The next set, waiting up to timeout seconds (None: without end; 0: not at all).

        Raises Nothing, Restarted or Gone: call again, and it goes on."""
        made = library.Set()
        held = [Held(made.frames[i]) for i in range(self._count)]
        result = self._wait(lambda pointer, ns: library.functions.sets_next(pointer, made, ns),
                            timeout)
        if result != library.OK:
            raise self._pause(result)
        return FrameSet(made, held)

    def fileno(self):
        """For select, selectors and asyncio: readable when next(0) may find something, until it
        raises Nothing or Gone. It belongs to the sets."""
        return self._descriptor(library.functions.sets_fd)


def sets(cameras, imu=None, patience=0.2, partial=False, suspect=False, instance=None,
         start="next", after_loss=None, owner=None, sealed_only=False):
    """Opens sets of frames of the cameras, which the board must trigger.

    imu: name of its stream; None: none.
    patience: seconds from a set's first frame until it is given up.
    partial: sets that lack a frame are delivered, too.
    suspect: frames whose pairing is not proved count, too.
    The rest as for open(). Raises Error with what to do."""
    if isinstance(cameras, str):
        raise TypeError("sets() needs a list of the cameras' names")
    cameras = list(cameras)
    options = library.SetsOptions(encoded(imu), max(1, nanoseconds(patience)), partial, suspect,
                                  stream_options(start, after_loss, owner, sealed_only))
    names = (ctypes.c_char_p * len(cameras))(*map(encoded, cameras))
    pointer, error = ctypes.c_void_p(), library.ErrorText()
    result = library.functions.sets_open(encoded(instance), names, len(cameras), options, pointer,
                                         error)
    if result != library.OK:
        raise Error(error.text())
    return Sets(Handle(pointer, library.functions.sets_close), cameras)
