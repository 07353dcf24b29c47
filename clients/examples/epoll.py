#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""epoll.py [STREAM...]: items of several streams in one loop, beside other descriptors that a
program may have."""
import os
import selectors
import sys

import versavis


def print_all(stream):
    try:
        while True:  # until nothing is left: then the descriptor waits for more
            print(stream.name, stream.next(timeout=0))
    except (versavis.Nothing, versavis.Gone):
        pass
    except versavis.Pause as pause:
        print(pause)  # there is more: the descriptor stays readable


def watch(names):
    with selectors.DefaultSelector() as selector:
        for name in names:
            selector.register(versavis.open(name), selectors.EVENT_READ)
        while True:
            for key, _ in selector.select():
                print_all(key.fileobj)


def main():
    try:
        watch(sys.argv[1:] or ["cam0", "imu0", "events"])
    except versavis.Error as error:
        sys.exit(str(error))
    except KeyboardInterrupt:
        pass
    except BrokenPipeError:  # nobody reads on: what is left goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    main()
