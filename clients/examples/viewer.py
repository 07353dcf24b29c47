#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""viewer.py [STREAM] [--save FILE.pgm]: the mean brightness of the newest frame, again and again.
With --save, writes one frame of 8 bits as an image, and ends."""
import argparse

import numpy as np
import versavis

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("stream", nargs="?", default="cam0")
parser.add_argument("--save", metavar="FILE.pgm")
arguments = parser.parse_args()
with versavis.open(arguments.stream) as stream:
    while True:
        try:
            frame = stream.latest(timeout=1.0)
            if arguments.save:
                pixels = np.ascontiguousarray(frame.copy())
                with open(arguments.save, "wb") as file:
                    file.write(f"P5 {frame.width} {frame.height} 255\n".encode())
                    file.write(pixels.tobytes())
                break
            print(f"{frame.time} ns +- {frame.sigma} ns: {frame.read(np.mean):.1f}")
        except (versavis.Pause, versavis.Overtaken) as pause:
            print(pause)
