#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""epoll.py [STREAM...]: items of several streams in one loop, beside other descriptors that a
program may have."""
import selectors
import sys

import versavis

with selectors.DefaultSelector() as selector:
    for name in sys.argv[1:] or ["cam0", "imu0", "events"]:
        selector.register(versavis.open(name), selectors.EVENT_READ)
    while True:
        for key, _ in selector.select():
            stream = key.fileobj
            try:
                while True:  # until nothing is left: then the descriptor waits for more
                    print(stream.name, stream.next(timeout=0))
            except (versavis.Nothing, versavis.Gone):
                pass
            except versavis.Pause as pause:
                print(pause)  # there is more: the descriptor stays readable
