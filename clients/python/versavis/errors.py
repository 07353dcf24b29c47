# SPDX-License-Identifier: BSD-3-Clause
"""What can go wrong, and the pauses that are part of a stream's life."""


class Error(Exception):
    """Something is wrong; the text says what, and what to do."""


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
