#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""numpy_consumer.py [STREAM]: the change from frame to frame. Each frame is copied, and what is not
used at once stays good."""
import os
import sys

import numpy as np
import versavis


def print_changes(name):
    with versavis.open(name) as stream:
        stream.on_pause(print)
        before = None
        for frame in stream:
            try:
                image = frame.copy().astype(np.int32)
            except versavis.Overtaken:
                continue  # this program was too slow for this frame
            if before is not None and before.shape == image.shape:
                change = np.abs(image - before).mean()
                print(f"frame {frame.number}, {image.shape}, {frame.format}: changed by "
                      f"{change:.2f}")
            before = image


def main():
    try:
        print_changes(sys.argv[1] if len(sys.argv) > 1 else "cam0")
    except versavis.Error as error:
        sys.exit(str(error))
    except KeyboardInterrupt:
        pass
    except BrokenPipeError:  # nobody reads on: what is left goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    main()
