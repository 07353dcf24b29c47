# SPDX-License-Identifier: BSD-3-Clause
"""The C interface as it is: the structures and functions of versavis.h."""
import ctypes
import os
from ctypes import POINTER, c_char_p, c_float, c_int, c_int32, c_int64, c_size_t, c_uint32, c_uint64
from ctypes import c_void_p
from pathlib import Path

NAME = "libversavis.so.1"

OK, NOTHING, LOST, RESTARTED, GONE, OVERTAKEN = range(6)
INVALID, NO_MEMORY, ABSENT, FORBIDDEN, NOT_TRUSTED, WRONG_KIND = range(-2, -8, -1)
UNSUPPORTED, DAMAGED, EXHAUSTED, OTHER_EPOCH = range(-8, -12, -1)
FRAMES, IMU, EVENTS, STATUS, EVIDENCE, CLOCK, NMEA = range(1, 8)
POSITIONS = {None: 0, "next": 1, "latest": 2, "middle": 3, "oldest": 4}
SIGMA_UNKNOWN = NO_EPOCH = 0xFFFFFFFF
ANY_OWNER = -1
MOST_CAMERAS = 16


class ErrorText(ctypes.Structure):
    _fields_ = [("message", ctypes.c_char * 512)]

    def text(self):
        return self.message.decode("utf-8", "replace")


class Sized(ctypes.Structure):
    """What may grow begins with its size."""

    def __init__(self, *values, **named):
        super().__init__(ctypes.sizeof(self), *values, **named)


class Time(ctypes.Structure):
    _fields_ = [("life", c_uint64), ("ns", c_int64), ("epoch", c_uint32), ("reserved", c_uint32)]


class Options(Sized):
    _fields_ = [("size", c_uint32), ("start", c_uint32), ("after_loss", c_uint32),
                ("sealed_only", c_uint32), ("owner", c_int64), ("wait", c_int64)]


class FrameData(ctypes.Structure):
    _fields_ = [
        ("trigger", c_uint64), ("block_id", c_uint64), ("board_time", c_int64),
        ("host_time", c_int64), ("arrival", c_int64), ("exposure", c_int64),
        ("camera_time", c_int64), ("sigma", c_uint32), ("width", c_uint32), ("height", c_uint32),
        ("stride", c_uint32), ("pixel_format", c_uint32), ("epoch", c_uint32),
        ("flags", c_uint32), ("tick_low", c_uint32), ("delay", c_int32), ("tick_high", c_uint32),
    ]


class ImuData(ctypes.Structure):
    _fields_ = [
        ("board_time", c_int64), ("host_time", c_int64), ("number", c_uint64),
        ("gyro", c_float * 3), ("accel", c_float * 3), ("magnetic", c_float * 3),
        ("temperature", c_float), ("pressure", c_float), ("sigma", c_uint32),
        ("epoch", c_uint32), ("flags", c_uint32), ("filter_delay", c_int64),
        ("accel_age", c_int32), ("reserved", c_uint32),
    ]


class EventData(ctypes.Structure):
    _fields_ = [
        ("kind", c_uint32), ("source", c_uint32), ("reason", c_uint32), ("flags", c_uint32),
        ("value", c_int64), ("board_time", c_int64), ("host_time", c_int64), ("sigma", c_uint32),
        ("epoch", c_uint32), ("source_name", ctypes.c_char * 32), ("expected", c_int64),
        ("count", c_uint32), ("reserved", c_uint32),
    ]


class NmeaData(ctypes.Structure):
    _fields_ = [
        ("board_time", c_int64), ("host_time", c_int64), ("number", c_uint64), ("sigma", c_uint32),
        ("epoch", c_uint32), ("flags", c_uint32), ("reserved", c_uint32 * 15),
    ]


class ItemData(ctypes.Union):
    _fields_ = [("frame", FrameData), ("imu", ImuData), ("event", EventData),
                ("nmea", NmeaData), ("words", c_uint64 * 12)]


class Item(Sized):
    _fields_ = [
        ("size", c_uint32), ("kind", c_uint32), ("number", c_uint64), ("lost", c_uint64),
        ("time", Time), ("stale", c_uint32), ("reserved", c_uint32), ("data", ItemData),
        ("payload", c_void_p), ("payload_size", c_size_t), ("held", c_uint64 * 6),
    ]


class Image(Sized):
    _fields_ = [
        ("size", c_uint32), ("width", c_uint32), ("height", c_uint32), ("stride", c_uint32),
        ("pixel_format", c_uint32), ("channels", c_uint32), ("bytes_per_channel", c_uint32),
        ("reserved", c_uint32), ("data", c_void_p),
    ]


class SensorState(Sized):
    _fields_ = [("size", c_uint32), ("gain", c_float), ("temperature", c_float)]


class StreamInfo(ctypes.Structure):
    _fields_ = [
        ("size", c_uint32), ("kind", c_uint32), ("name", c_char_p), ("published", c_uint64),
        ("retained", c_uint64), ("alive", c_int32), ("error", c_int32), ("why", c_char_p),
    ]


Visit = ctypes.CFUNCTYPE(c_int, POINTER(StreamInfo), c_void_p)


class SetsOptions(Sized):
    _fields_ = [("size", c_uint32), ("partial", c_uint32), ("suspect", c_uint32),
                ("reserved", c_uint32), ("imu", c_char_p), ("patience", c_int64),
                ("streams", POINTER(Options))]


class ImuSample(ctypes.Structure):
    _fields_ = [("time", Time), ("data", ImuData)]


class ImuSpan(Sized):
    _fields_ = [
        ("size", c_uint32), ("gap", c_uint32), ("samples", c_void_p), ("count", c_size_t),
        ("lost", c_uint64), ("beyond", c_void_p),
    ]


class SetReport(Sized):
    _fields_ = [
        ("size", c_uint32), ("reserved", c_uint32), ("sets", c_uint64), ("incomplete", c_uint64),
        ("left_out", c_uint64), ("lost", c_uint64), ("skipped", c_uint64),
    ]


class Set(Sized):
    _fields_ = [
        ("size", c_uint32), ("present", c_uint32), ("tick", c_uint64), ("time", Time),
        ("spread", c_int64), ("imu", c_void_p), ("imu_count", c_size_t), ("imu_lost", c_uint64),
        ("imu_gap", c_uint32), ("reserved", c_uint32), ("held", c_void_p),
    ]


SIGNATURES = {
    "version": (c_char_p, []),
    "result_text": (c_char_p, [c_int]),
    "list": (c_int, [c_char_p, POINTER(Options), Visit, c_void_p, POINTER(ErrorText)]),
    "open": (c_int, [c_char_p, c_char_p, POINTER(Options), POINTER(c_void_p),
                     POINTER(ErrorText)]),
    "close": (None, [c_void_p]),
    "stream_kind": (c_int, [c_void_p]),
    "next": (c_int, [c_void_p, POINTER(Item), c_int64]),
    "latest": (c_int, [c_void_p, POINTER(Item), c_int64]),
    "seek": (c_int, [c_void_p, c_uint32]),
    "seek_time": (c_int, [c_void_p, POINTER(Time)]),
    "fd": (c_int, [c_void_p, POINTER(ErrorText)]),
    "valid": (c_int, [POINTER(Item)]),
    "copy": (c_int, [POINTER(Item), c_void_p, c_size_t]),
    "release": (None, [POINTER(Item)]),
    "view": (c_int, [POINTER(Item), POINTER(Image)]),
    "sensor": (c_int, [POINTER(Item), POINTER(SensorState)]),
    "pixel_format_name": (c_char_p, [c_uint32]),
    "event_name": (c_char_p, [c_uint32]),
    "reason_name": (c_char_p, [c_uint32]),
    "wait_set_new": (c_void_p, []),
    "wait_set_free": (None, [c_void_p]),
    "wait_set_add": (c_int, [c_void_p, c_void_p, POINTER(ErrorText)]),
    "wait_set_wait": (c_int, [c_void_p, c_int64, POINTER(c_uint32)]),
    "imu_window_open": (c_int, [c_char_p, c_char_p, POINTER(Options), POINTER(c_void_p),
                                POINTER(ErrorText)]),
    "imu_window_close": (None, [c_void_p]),
    "imu_window_span": (c_int, [c_void_p, POINTER(Time), POINTER(Time), c_int64,
                                POINTER(ImuSpan)]),
    "imu_window_fd": (c_int, [c_void_p, POINTER(ErrorText)]),
    "sets_open": (c_int, [c_char_p, POINTER(c_char_p), c_size_t, POINTER(SetsOptions),
                          POINTER(c_void_p), POINTER(ErrorText)]),
    "sets_close": (None, [c_void_p]),
    "sets_next": (c_int, [c_void_p, POINTER(Set), c_int64]),
    "sets_latest": (c_int, [c_void_p, POINTER(Set), c_int64]),
    "sets_report": (c_int, [c_void_p, POINTER(SetReport)]),
    "sets_fd": (c_int, [c_void_p, POINTER(ErrorText)]),
    "set_frame": (c_int, [POINTER(Set), c_uint32, POINTER(Item)]),
    "set_release": (None, [POINTER(Set)]),
}


class Functions:
    """The functions of the library, by their names without the prefix versavis_."""

    def __init__(self, library):
        for name, (result, arguments) in SIGNATURES.items():
            function = getattr(library, "versavis_" + name)
            function.restype, function.argtypes = result, arguments
            setattr(self, name, function)


def candidates():
    """Where the library may be: as named, or installed beside this package, or in the system."""
    named = os.environ.get("VERSAVIS_LIBRARY")
    if named:
        return [named]
    folders = Path(__file__).resolve().parents
    near = []
    if len(folders) > 3 and folders[2].name.startswith("python3"):
        near = [*folders[3].glob(NAME), *folders[3].glob("*/" + NAME)]
    return [*map(str, near), NAME]


def load():
    problem = None
    for path in candidates():
        try:
            return Functions(ctypes.CDLL(path))
        except (OSError, AttributeError) as error:
            problem = error
    raise ImportError(
        f"{NAME} cannot be used ({problem}): install VersaVIS on this machine, its version as new "
        "as this package's, or name the library's path in VERSAVIS_LIBRARY")


functions = load()


def library_version():
    """The version of the library, as text."""
    return functions.version().decode()


def result_text(result):
    """One sentence about a result."""
    return functions.result_text(result).decode()
