# SPDX-License-Identifier: BSD-3-Clause
"""Instants of the output time, with what they belong to."""
from numbers import Integral

from . import _library as library
from .errors import OtherEpoch


class Time:
    """An instant: `ns`, and the `epoch` and `life` of the service that it belongs to. Epoch None:
    it belongs to none, as that of a status document.

    Times of one epoch compare; one less another is nanoseconds; and nanoseconds can be added and
    subtracted. Times of two epochs do not compare, as a clock was set in between, or the service
    restarted: that raises OtherEpoch. They are not equal."""

    __slots__ = ("life", "epoch", "ns")

    def __init__(self, life, epoch, ns):
        self.life, self.epoch, self.ns = life, epoch, int(ns)

    @classmethod
    def of(cls, time):
        """Of one of the library."""
        return cls(time.life, None if time.epoch == library.NO_EPOCH else time.epoch, time.ns)

    def library(self):
        """As the library wants it."""
        return library.Time(self.life, self.ns,
                            library.NO_EPOCH if self.epoch is None else self.epoch, 0)

    def compares_with(self, other):
        """True: both are of one epoch of one life."""
        return (self.epoch is not None and self.epoch == other.epoch and self.life == other.life)

    def __sub__(self, other):
        if isinstance(other, Integral):
            return Time(self.life, self.epoch, self.ns - other)
        if not isinstance(other, Time):
            return NotImplemented
        return self.ns - self._checked(other).ns

    def __add__(self, ns):
        if not isinstance(ns, Integral):
            return NotImplemented
        return Time(self.life, self.epoch, self.ns + ns)

    def __lt__(self, other):
        return self.ns < self._checked(other).ns if isinstance(other, Time) else NotImplemented

    def __le__(self, other):
        return self.ns <= self._checked(other).ns if isinstance(other, Time) else NotImplemented

    def __gt__(self, other):
        return self.ns > self._checked(other).ns if isinstance(other, Time) else NotImplemented

    def __ge__(self, other):
        return self.ns >= self._checked(other).ns if isinstance(other, Time) else NotImplemented

    def __eq__(self, other):
        if not isinstance(other, Time):
            return NotImplemented
        return self.compares_with(other) and self.ns == other.ns

    def __hash__(self):
        return hash((self.life, self.epoch, self.ns))

    def __str__(self):
        return f"{self.ns} ns"

    def __repr__(self):
        return f"<versavis.Time {self.ns} ns, epoch {self.epoch}>"

    def _checked(self, other):
        if not self.compares_with(other):
            raise OtherEpoch(f"a time of epoch {self.epoch} and one of epoch {other.epoch} do not "
                             "compare" if self.life == other.life else
                             "times before and after a restart of the service do not compare")
        return other
