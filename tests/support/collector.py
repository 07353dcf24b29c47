# SPDX-License-Identifier: BSD-3-Clause
"""A reader of a stream beside a test in Python. The test sets VERSAVIS_LIBRARY before the import.
"""
import threading

import versavis
from live import until


class Collector:
    """Reads a stream on a thread of its own and keeps (time in ns, note(item)) of each item in
    `noted`. On a busy machine a test reads late as any program: what it did not read in time is
    counted in `lost`. An error ends the thread, and stop() raises it: a test whose reader died
    must not pass."""

    def __init__(self, name, instance, note, **options):
        self.noted = []
        self.lost = 0
        self._note = note
        self._error = None
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(name, instance, options),
                                        daemon=True)
        self._thread.start()

    def by_time(self):
        return dict(self.noted)

    def check_received(self, test, stamps):
        """Whether `stamps`, in ns, are all that was published, as far as both have read."""
        first, last = max(stamps[0], self.noted[0][0]), min(stamps[-1], self.noted[-1][0])
        received = [ns for ns in stamps if first <= ns <= last]
        test.assertGreater(len(received), len(stamps) // 2)
        test.assertEqual(received, sorted(set(received)))
        published = {ns for ns, _ in self.noted if first <= ns <= last}
        test.assertLessEqual(published, set(received))
        test.assertLessEqual(len(received) - len(published), self.check_lost(test))

    def check_lost(self, test):
        """How many it lost; more than a tenth is no busy machine, but a fault."""
        test.assertLess(self.lost, 10 + len(self.noted) // 10)
        return self.lost

    def stop(self):
        self._done.set()
        self._thread.join()
        if self._error is not None:
            raise self._error

    def _run(self, name, instance, options):
        try:
            with versavis.open(name, instance=instance, **{"wait": 30, **options}) as stream:
                while not self._done.is_set():
                    self._read(stream)
        except Exception as error:  # pylint: disable=broad-exception-caught
            self._error = error

    def _read(self, stream):
        try:
            with stream.next(0.5) as item:
                self.noted.append((item.time.ns, self._note(item)))
        except versavis.Lost as error:
            self.lost += error.lost
        except versavis.Overtaken:
            self.lost += 1
        except versavis.Gone:
            self._done.wait(0.05)  # a new service may come
        except versavis.Pause:
            pass


def collect(test, name, instance, note, **options):
    """A Collector until the test ends, which fails with it."""
    collector = Collector(name, instance, note, **options)
    test.addCleanup(collector.stop)
    return collector


def wait_for_stamp(collector, ns):
    """What it noted by time, once it has read as far as that."""
    until(lambda: collector.noted and collector.noted[-1][0] >= ns, 20, "the reader has read it")
    return collector.by_time()
