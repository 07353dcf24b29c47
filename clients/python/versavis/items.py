# SPDX-License-Identifier: BSD-3-Clause
"""Items of streams: their metadata by name, and their payload in place or copied."""
import ctypes
import enum
import gc
import json
import math
import weakref

import numpy as np

from . import _library as library
from .errors import Overtaken, Released, ViewEscaped, error_of
from .times import Time

STAMP_KIND = 0x403  # these bits of the flags
STAMP_KINDS = {0: "measured", 1: "predicted", 2: "trigger", 3: "arrival", 0x403: "ptp"}


class Flags(enum.IntFlag):
    """Bits of `flags`. Bits 0, 1 and 10 are the kind of stamp."""

    SUSPECT = 1 << 2
    HOLDOVER = 1 << 3
    CLAMPED = 1 << 4
    SENSOR_ERROR = 1 << 5
    REPEATED = 1 << 6
    ACCEL_AGE = 1 << 7
    CAMERA_LENGTH = 1 << 8
    SECOND_DOUBTED = 1 << 9


class Held:
    """An item of the library, made before it is filled, so that no interrupt loses it. Its memory
    stays mapped until the last reference to this is gone: that of an Item,
    and those of arrays that refer to its payload."""

    def __init__(self, item):
        self.item = item  # where it is: the library does not want it moved
        self._release = library.functions.release

    def __del__(self):
        self._release(self.item)


class Item:
    """What all items have. Metadata can be read even after close(); the payload cannot."""

    def __init__(self, held):
        self._item = held.item
        self._held = held

    number = property(lambda self: self._item.number, doc="Since the stream was made, from 0.")
    time = property(lambda self: Time.of(self._item.time), doc="Output time, see Time.")
    words = property(lambda self: tuple(self._item.data.words), doc="The raw metadata.")

    @property
    def stale(self):
        """True: its writer was dead, or had closed the stream, when it was read."""
        return bool(self._item.stale)

    @property
    def valid(self):
        """True while the writer has not touched the payload. False once closed."""
        held = self._held
        return held is not None and library.functions.valid(held.item) == 1

    def close(self):
        """Gives the memory back. Happens by itself when nothing refers to the item any more."""
        self._held = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def __repr__(self):
        return f"<versavis.{type(self).__name__} {self.number}, {self.time}>"

    def _holding(self):
        held = self._held
        if held is None:
            raise Released("this item was closed: use its payload before, or keep a copy()")
        return held

    def _copied(self):
        """The payload, checked, as an array of bytes."""
        held = self._holding()
        copied = np.empty(held.item.payload_size, np.uint8)
        result = library.functions.copy(held.item, copied.ctypes.data, copied.size)
        if result == library.OVERTAKEN:
            raise overtaken(self)
        if result != library.OK:
            raise error_of(result, library.result_text(result))
        return copied


def overtaken(item):
    return Overtaken(f"item {item.number}: {library.result_text(library.OVERTAKEN)}")


def number(part, name, doc):
    """A property that gives a number of the metadata."""
    return property(lambda self: getattr(getattr(self._item.data, part), name), doc=doc)


def unless_zero(part, name, doc):
    """The same; None where 0 says that it is not known."""
    return property(lambda self: getattr(getattr(self._item.data, part), name) or None, doc=doc)


def unless_nan(part, name, doc):
    def known(self):
        value = getattr(getattr(self._item.data, part), name)
        return None if math.isnan(value) else value

    return property(known, doc=doc)


def flags_of(part):
    return property(lambda self: Flags(getattr(self._item.data, part).flags), doc="See Flags.")


def sigma_of(part):
    def sigma(self):
        value = getattr(self._item.data, part).sigma
        return None if value == library.SIGMA_UNKNOWN else value

    return property(sigma, doc="Of the output time, in ns; None: unknown.")


class Frame(Item):
    """A frame of a camera."""

    trigger = unless_zero("frame", "trigger", "Number of its pulse; None: not triggered.")
    block_id = number("frame", "block_id", "The camera's own frame number.")
    board_time = unless_zero("frame", "board_time",
                             "Middle of the exposure, board's clock, ns; None: unknown.")
    host_time = number("frame", "host_time", "Middle of the exposure, CLOCK_MONOTONIC_RAW, ns.")
    arrival = number("frame", "arrival", "Host time when the frame was complete, ns.")
    exposure = unless_zero("frame", "exposure",
                           "Measured, in ns, or see Flags.CAMERA_LENGTH; None: unknown.")
    camera_time = unless_zero("frame", "camera_time", "As the camera stamped it, ns; None: none.")
    sigma = sigma_of("frame")
    width = number("frame", "width", "Pixels of a row.")
    height = number("frame", "height", "Rows.")
    stride = number("frame", "stride", "Bytes from a row to the next.")
    pixel_format = number("frame", "pixel_format", "PFNC code; `format` is its name.")
    flags = flags_of("frame")
    delay = number("frame", "delay", "Of the lines, in ns, already taken off.")

    @property
    def tick(self):
        """The grid point, equal for cameras that exposed together; None: not triggered."""
        data = self._item.data.frame
        return data.tick_high << 32 | data.tick_low if data.trigger else None

    @property
    def format(self):
        """Name of the pixel format, as "Mono8"; "unknown" for others."""
        return library.functions.pixel_format_name(self.pixel_format).decode()

    @property
    def suspect(self):
        """True: the pairing is not proved; trigger and times are a guess."""
        return bool(self.flags & Flags.SUSPECT)

    @property
    def stamp(self):
        """What the time is: "measured", "predicted", "trigger", "arrival" or "ptp"."""
        return STAMP_KINDS.get(self._item.data.frame.flags & STAMP_KIND, "unknown")

    gain = property(lambda self: self._sensor("gain"),
                    doc="Of the sensor, by the camera: dB, or its own unit; None: not known.")
    temperature = property(lambda self: self._sensor("temperature"),
                           doc="Of the camera, by its own account, in degree Celsius; None: not "
                               "known.")

    def copy(self):
        """The pixels as an array of one's own. Raises Overtaken if the writer needed the memory.

        Its shape is (height, width), or (height, width, channels), of uint8 or uint16, with the
        frame's stride; of packed formats (height, stride), of uint8."""
        image = self._image(self._holding())
        return shaped(self._copied(), image)

    def read(self, function):
        """Calls function(view) with the pixels in place, read-only and shaped as by copy(), and
        returns its result. Raises Overtaken if the writer needed the memory meanwhile: whatever
        the function did with the pixels is then void. No array may outlive the call that refers to
        the view, as slices of it do: that raises ViewEscaped."""
        held = self._holding()
        window, view = self._view(held)
        result = function(view)
        del view
        if escaped(window):
            raise ViewEscaped("an array still refers to the frame's memory, which the writer will "
                              "overwrite: return a copy of it, or use copy() instead of read()")
        if library.functions.valid(held.item) != 1:
            raise overtaken(self)
        return result

    def _sensor(self, name):
        held = self._holding()
        state = library.SensorState()
        result = library.functions.sensor(held.item, state)
        if result == library.OVERTAKEN:
            raise overtaken(self)
        value = getattr(state, name)
        return None if math.isnan(value) else value

    def _image(self, held):
        image = library.Image()
        if library.functions.view(held.item, image) != library.OK:
            raise Error(f"item {self.number} has fewer bytes than its width, height and stride say")
        return image

    def _view(self, held):
        """The pixels in place, and a weak reference that dies with whatever refers to them."""
        image = self._image(held)
        memory = (ctypes.c_uint8 * held.item.payload_size).from_address(image.data)
        memory.held = held  # an array that escapes is wrong, but must not crash the program
        flat = np.frombuffer(memoryview(memory).toreadonly(), np.uint8)
        return weakref.ref(memory), shaped(flat, image)


def escaped(window):
    """True if something still refers to the memory. numpy makes memoryviews of its own of what it
    is given, so that releasing ours shows nothing; but all of them keep the memory's object."""
    if window() is None:
        return False
    gc.collect()  # what refers to it may be garbage, in a cycle
    return window() is not None


def shaped(flat, image):
    """The bytes as an image."""
    if image.channels == 0:
        return np.ndarray((image.height, image.stride), np.uint8, flat)
    size = image.bytes_per_channel
    shape, strides = (image.height, image.width), (image.stride, image.channels * size)
    if image.channels > 1:
        shape, strides = (*shape, image.channels), (*strides, size)
    return np.ndarray(shape, np.dtype("<u2" if size == 2 else np.uint8), flat, 0, strides)


class ImuSample(Item):
    """A sample of an IMU."""

    board_time = number("imu", "board_time", "Of the sample, board's clock, ns.")
    host_time = number("imu", "host_time", "Of the motion, CLOCK_MONOTONIC_RAW, ns.")
    sample = number("imu", "number", "Samples since the board's boot.")
    temperature = unless_nan("imu", "temperature", "Degree Celsius; None: unknown.")
    pressure = unless_nan("imu", "pressure", "Pa; None: the part has none.")
    sigma = sigma_of("imu")
    flags = flags_of("imu")
    filter_delay = number("imu", "filter_delay", "Of the part's filter, ns, already taken off.")

    gyro = property(lambda self: tuple(self._item.data.imu.gyro), doc="Angular rate, rad/s.")
    accel = property(lambda self: tuple(self._item.data.imu.accel), doc="Acceleration, m/s^2.")

    @property
    def magnetic(self):
        """In T; None: the part has none."""
        field = tuple(self._item.data.imu.magnetic)
        return None if math.isnan(field[0]) else field

    @property
    def accel_age(self):
        """By how much the acceleration is older than the angular rate, ns; None: unknown."""
        return self._item.data.imu.accel_age if self.flags & Flags.ACCEL_AGE else None


class Event(Item):
    """An event."""

    kind = number("event", "kind", "Its number; `name` is its name.")
    source = number("event", "source", "Number of the camera, the IMU port or the input.")
    flags = flags_of("event")
    value = number("event", "value", "What it means depends on the kind.")
    board_time = unless_zero("event", "board_time", "In ns; None: not an event of the board.")
    host_time = number("event", "host_time", "CLOCK_MONOTONIC_RAW, ns.")
    sigma = sigma_of("event")
    expected = number("event", "expected", "Of what was doubted, what its witnesses say.")
    count = number("event", "count", "How many grid points; else 0.")

    @property
    def name(self):
        """As "pairing_locked"."""
        return library.functions.event_name(self.kind).decode()

    @property
    def reason(self):
        """As "frame_missing"; "none" without."""
        return library.functions.reason_name(self._item.data.event.reason).decode()

    @property
    def source_name(self):
        """As "cam0"."""
        return self._item.data.event.source_name.decode("utf-8", "replace")


class NmeaSentence(Item):
    """A line of a GNSS receiver at the board."""

    board_time = number("nmea", "board_time", "Its first bit arrived at the board; ns.")
    host_time = number("nmea", "host_time", "CLOCK_MONOTONIC_RAW, ns.")
    sentence = number("nmea", "number", "Lines since the board's boot.")
    sigma = sigma_of("nmea")
    flags = flags_of("nmea")

    @property
    def text(self):
        """As "$GPRMC,...*6A". Raises Overtaken if the writer needed the memory."""
        return self._copied().tobytes().decode("ascii", "replace")


class Status(Item):
    """A status document."""

    def json(self):
        """The document as a dictionary. Raises Overtaken if the writer needed the memory."""
        return json.loads(self._copied().tobytes())


KINDS = {library.FRAMES: Frame, library.IMU: ImuSample, library.EVENTS: Event,
         library.STATUS: Status, library.NMEA: NmeaSentence}


def typed(held):
    """The library's item as one of Python."""
    return KINDS.get(held.item.kind, Item)(held)
