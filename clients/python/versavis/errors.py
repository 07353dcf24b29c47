# SPDX-License-Identifier: BSD-3-Clause
"""What can go wrong, and the pauses that are part of a stream's life."""
from . import _library as library


class Error(Exception):
    """Something is wrong; the text says what, and what to do."""


class Absent(Error):
    """There is no such stream: not yet, or not any more."""


class Forbidden(Error):
    """No permission."""


class NotTrusted(Error):
    """The stream belongs to, or can be changed by, somebody else."""


class WrongKind(Error):
    """A stream of another kind."""


class Unsupported(Error):
    """A ring of a layout that the library does not know."""


class Damaged(Error):
    """No ring, or a damaged one."""


class Exhausted(Error):
    """No memory, descriptor or thread available."""


class OtherEpoch(Error):
    """Times of two epochs, or of none, do not compare."""


class Released(Error):
    """A stream, set or item was used after it had been closed."""


class Overtaken(Error):
    """The writer needed the memory: what was read or copied is void."""


class ViewEscaped(Error):
    """An array that refers to the service's memory outlived its check."""


class Pause(Exception):
    """There is no item now. This is no error: call again, and the stream goes on."""


class Nothing(Pause):
    """Nothing new in the time given."""


class Lost(Pause):
    """Items were overwritten before they were read; `lost` says how many."""

    def __init__(self, text, lost):
        super().__init__(text)
        self.lost = lost


class Restarted(Pause):
    """The service was restarted; its first item comes next."""


class Gone(Pause):
    """The service has stopped or died, and there is no new one yet."""


KINDS = {
    library.NO_MEMORY: Exhausted, library.ABSENT: Absent, library.FORBIDDEN: Forbidden,
    library.NOT_TRUSTED: NotTrusted, library.WRONG_KIND: WrongKind,
    library.UNSUPPORTED: Unsupported, library.DAMAGED: Damaged, library.EXHAUSTED: Exhausted,
    library.OTHER_EPOCH: OtherEpoch,
}


def error_of(result, text):
    """The error to raise for a result of the library."""
    return KINDS.get(result, Error)(text)
