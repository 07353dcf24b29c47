#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""viewer.py [STREAM] [--save FILE.pgm]: the mean brightness of the newest frame, again and again.
With --save, writes one frame of 8 bits as an image, and ends."""
import argparse
import os
import sys

import numpy as np
import versavis


def save(frame, path):
    pixels = np.ascontiguousarray(frame.copy())
    with open(path, "wb") as file:
        file.write(f"P5 {frame.width} {frame.height} 255\n".encode())
        file.write(pixels.tobytes())


def view(name, path):
    with versavis.open(name) as stream:
        while True:
            try:
                frame = stream.latest(timeout=1.0)
                if frame.suspect:
                    continue  # its time is a guess
                if path:
                    save(frame, path)
                    return
                sigma = "unknown" if frame.sigma is None else f"{frame.sigma} ns"
                print(f"{frame.time} +- {sigma}: {frame.read(np.mean):.1f}")
            except (versavis.Pause, versavis.Overtaken) as pause:
                print(pause)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("stream", nargs="?", default="cam0")
    parser.add_argument("--save", metavar="FILE.pgm")
    arguments = parser.parse_args()
    try:
        view(arguments.stream, arguments.save)
    except BrokenPipeError:  # nobody reads on: what is left goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (versavis.Error, OSError) as error:
        sys.exit(str(error))
    except KeyboardInterrupt:
        pass


if __name__ == "__main__":
    main()
