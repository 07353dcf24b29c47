# SPDX-License-Identifier: BSD-3-Clause
"""Streams: waiting for items, going on after pauses, and waiting for several."""
import contextlib
import ctypes
import os
import pwd
import threading
import time

from . import _library as library
from .errors import Error, Gone, Lost, Nothing, Overtaken, Released, Restarted, error_of
from .items import Held, typed

# Of one sleep in the library, in seconds: Python handles signals, such as Ctrl-C, in between.
SLICE = 0.1

# Between two looks for a stream that is not there yet, in seconds.
OPEN_PERIOD = 0.02


class Handle:
    """What the library opened. It is closed when the last reference is gone, so never while a call
    with it is under way; and only by the process that opened it: closing waits for a thread of the
    library, which a forked child does not have."""

    def __init__(self, pointer, close):
        self.pointer = pointer
        self._close = close
        self._process = os.getpid()

    def forked(self):
        return self._process != os.getpid()

    def __del__(self):
        if not self.forked():
            self._close(self.pointer)


class Source:
    """What gives one thing after the other: a stream, or sets of frames."""

    def __init__(self, handle, name):
        self.name = name
        self.lost = 0  # items, so far
        self.restarts = 0  # of the service, so far
        self._handle = handle
        self._lock = threading.RLock()  # the library takes one thread at a time
        self._gone = False  # and it was reported
        self._callback = None

    def close(self):
        """Ends it. Items that were read stay good."""
        self._handle = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def __iter__(self):
        return self

    def __next__(self):
        """Waits for the next one, over all pauses."""
        while True:
            try:
                return self.next()
            except (Lost, Restarted, Gone) as pause:
                if self._callback is not None:
                    # Whoever keeps it keeps no frames by way of its traceback.
                    self._callback(pause.with_traceback(None))

    def next(self, timeout=None):
        """The next one. Raises Nothing, Lost, Restarted or Gone."""
        raise NotImplementedError

    def on_pause(self, callback):
        """Iteration then calls callback(pause) with each Lost, Restarted and Gone."""
        self._callback = callback

    @contextlib.contextmanager
    def _opened(self):
        """The library's pointer, for this thread alone."""
        handle = self._handle
        if handle is not None and handle.forked():
            raise Error(f"{self.name} was opened before this process was forked: open it again")
        with self._lock:
            handle = self._handle
            if handle is None:
                raise Released(f"{self.name} is closed: open it again")
            yield handle.pointer

    def _wait(self, call, timeout):
        """Calls call(pointer, ns) in slices until it gives something, or time is over. Returns
        what it said last."""
        deadline = deadline_after(timeout)
        while True:
            left = remaining(deadline)
            with self._opened() as pointer:
                result = call(pointer, nanoseconds(left))
            reported = self._gone
            if result != library.NOTHING:
                self._gone = result == library.GONE
            waiting = result == library.NOTHING or (result == library.GONE and reported)
            if not waiting or left < SLICE:
                return result

    def _pause(self, result):
        """What to raise instead of giving something."""
        if result == library.RESTARTED:
            self.restarts += 1
        kinds = {library.NOTHING: Nothing, library.RESTARTED: Restarted, library.GONE: Gone}
        text = f"{self.name}: {library.result_text(result)}"
        return kinds[result](text) if result in kinds else error_of(result, text)

    def _descriptor(self, function):
        error = library.ErrorText()
        with self._opened() as pointer:
            descriptor = function(pointer, error)
        if descriptor < 0:
            raise error_of(descriptor, error.text())
        return descriptor


def deadline_after(timeout):
    return None if timeout is None else time.monotonic() + timeout


def remaining(deadline):
    """Seconds to sleep at once."""
    return SLICE if deadline is None else min(SLICE, max(0.0, deadline - time.monotonic()))


def nanoseconds(seconds):
    return int(seconds * 1e9)


class Stream(Source):
    """A stream of items. One thread waits at a time; others that call then wait for it."""

    def __init__(self, handle, name):
        super().__init__(handle, name)
        self.kind = library.functions.stream_kind(handle.pointer)
        self.overtaken = 0  # frames that read_each() passed over, so far

    def next(self, timeout=None):
        """The next item, waiting up to timeout seconds (None: without end; 0: not at all).

        Raises Nothing, Lost, Restarted or Gone: call again, and the stream goes on."""
        return self._item(library.functions.next, timeout)

    def latest(self, timeout=None):
        """The newest item, passing over older ones; if it has been read, the next."""
        return self._item(library.functions.latest, timeout)

    def seek(self, position):
        """To "next", "latest", "middle" or "oldest"."""
        place = position_number(position)
        with self._opened() as pointer:
            library.functions.seek(pointer, place)

    def seek_time(self, time):
        """To the oldest item from which on none is before that Time.

        Raises OtherEpoch, and stays where it is, if it is of another life of the service, or of no
        epoch, as the items of a status stream are."""
        with self._opened() as pointer:
            result = library.functions.seek_time(pointer, time.library())
        if result != library.OK:
            raise error_of(result, f"{self.name}: {time!r} does not compare with its items")

    def read_each(self, function):
        """Iterates over (frame, function(pixels)), as Frame.read() gives it, for each frame that
        could be read in time. Others are counted in `overtaken`: this program was too slow."""
        for frame in self:
            try:
                result = frame.read(function)
            except Overtaken:
                self.overtaken += 1
                continue
            yield frame, result

    def fileno(self):
        """For select, selectors and asyncio: readable when next(0) may find something, until it
        raises Nothing or Gone. It belongs to the stream."""
        return self._descriptor(library.functions.fd)

    def _item(self, function, timeout):
        held = Held(library.Item())
        item = held.item
        result = self._wait(lambda pointer, ns: function(pointer, item, ns), timeout)
        if result == library.OK:
            return typed(held)
        if result == library.LOST:
            self.lost += item.lost
            text = f"{self.name}: {item.lost} items were overwritten before they were read"
            raise Lost(text, item.lost)
        raise self._pause(result)


def position_number(position):
    if position not in library.POSITIONS:
        raise ValueError(f"'{position}' is no position: use next, latest, middle or oldest")
    return library.POSITIONS[position]


LAST_USER = 2**32 - 1


def owner_number(owner):
    if owner is None:
        return library.ANY_OWNER
    if isinstance(owner, str) and not (owner.isascii() and owner.isdigit()):
        try:
            return pwd.getpwnam(owner).pw_uid
        except KeyError:
            raise Error(f"there is no user '{owner}' who could own the streams") from None
    number = int(owner)
    if not 0 <= number <= LAST_USER:
        raise Error(f"there is no user {number} who could own the streams: numbers of users go "
                    f"from 0 to {LAST_USER}")
    return number


def encoded(text):
    return None if text is None else os.fsencode(text)


def stream_options(start, after_loss, owner, sealed_only):
    return library.Options(position_number(start), position_number(after_loss), sealed_only,
                           owner_number(owner), 0)


def opened(call, wait):
    """Calls call(pointer, error) until it opens something, there is another error than that nothing
    is there, or wait seconds are over (None: never). Returns the library's pointer."""
    deadline = deadline_after(wait)
    while True:
        pointer, error = ctypes.c_void_p(), library.ErrorText()
        result = call(pointer, error)
        if result == library.OK:
            return pointer
        left = remaining(deadline)
        if result != library.ABSENT or left <= 0:
            raise error_of(result, error.text())
        time.sleep(min(left, OPEN_PERIOD))


def open(name, instance=None, start="next", after_loss=None, owner=None, sealed_only=False,
         wait=0):
    """Opens a stream, as "cam0", "imu0", "events", "nmea0" or "status".

    instance: of the service; None: that of $VERSAVIS_INSTANCE, or "default".
    start, after_loss: "next", "latest", "middle" or "oldest": where to begin, and where to go on
    when items were lost (None: "middle").
    owner: user, by name or number, to whom the streams must belong; None: whom $VERSAVIS_OWNER
    names, by name or number; without it root, oneself, or "versavis".
    sealed_only: only of a service that seals its streams: nobody can cut them short.
    wait: seconds to wait for a stream that is not there yet; None: without end.

    Raises Absent, Forbidden, NotTrusted or another Error, with what to do."""
    options = stream_options(start, after_loss, owner, sealed_only)
    pointer = opened(lambda pointer, error: library.functions.open(
        encoded(instance), encoded(name), options, pointer, error), wait)
    return Stream(Handle(pointer, library.functions.close), name)


class StreamInfo:
    """One stream of an instance: its name; kind, as "frames"; how many items it has published; how
    many are retained at most; whether its writer is alive. error: why it cannot be opened; then
    only its name is known."""

    def __init__(self, info):
        self.name = os.fsdecode(info.name)
        self.kind = KIND_NAMES.get(info.kind)
        self.published, self.retained = info.published, info.retained
        self.alive = bool(info.alive)
        why = info.why.decode("utf-8", "replace")
        self.error = error_of(info.error, why) if info.error else None

    def __repr__(self):
        return f"<versavis.StreamInfo {self.name}, {self.error or self.kind}>"


KIND_NAMES = {library.FRAMES: "frames", library.IMU: "imu", library.EVENTS: "events",
              library.STATUS: "status", library.EVIDENCE: "evidence", library.CLOCK: "clock",
              library.NMEA: "nmea"}


def list_streams(instance=None, owner=None):
    """A StreamInfo of each stream of an instance, by name. Raises Absent: there is none."""
    found = []

    def visit(info, _):
        found.append(StreamInfo(info.contents))
        return 0

    error = library.ErrorText()
    options = stream_options("next", None, owner, False)
    result = library.functions.list(encoded(instance), options, library.Visit(visit), None, error)
    if result != library.OK:
        raise error_of(result, error.text())
    return found


def wait(streams, timeout=None):
    """Sleeps until next() of one of the streams has something to return, up to timeout seconds.

    Returns the list of those that have; empty: nothing in time."""
    streams = list(streams)
    if not streams:
        raise ValueError("wait() needs streams to wait for")
    for stream in streams:
        if not isinstance(stream, Stream):
            raise TypeError(f"wait() waits for streams; for {stream!r} use select and fileno()")
    deadline = deadline_after(timeout)
    while True:
        left = remaining(deadline)
        found = wait_once(streams, left)
        if found or left < SLICE:
            return [stream for i, stream in enumerate(streams) if i in found]


def wait_once(streams, seconds):
    """The numbers of those that have something; one sleep."""
    with contextlib.ExitStack() as stack:
        pointers = {}
        for i, stream in sorted(enumerate(streams), key=lambda pair: id(pair[1])):
            pointers[i] = stack.enter_context(stream._opened())
        waiting = library.functions.wait_set_new()
        if not waiting:
            raise MemoryError("no memory to wait for several streams")
        stack.callback(library.functions.wait_set_free, waiting)
        for i in range(len(streams)):
            error = library.ErrorText()
            result = library.functions.wait_set_add(waiting, pointers[i], error)
            if result != library.OK:
                raise error_of(result, error.text())
        return all_ready(waiting, nanoseconds(seconds))


def all_ready(waiting, nanoseconds_left):
    """Streams take turns: when one comes again, all that have something were named."""
    found = set()
    which = ctypes.c_uint32()
    result = library.functions.wait_set_wait(waiting, nanoseconds_left, which)
    while result == library.OK and which.value not in found:
        found.add(which.value)
        result = library.functions.wait_set_wait(waiting, 0, which)
    if result < 0:
        raise error_of(result, library.result_text(result))
    return found
