#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""stereo.py [CAMERA CAMERA...]: frames that were exposed together, and the angular rate since the
frames before."""
import os
import sys

import numpy as np
import versavis


def print_sets(cameras):
    with versavis.sets(cameras, imu="imu0") as together:
        together.on_pause(print)
        for made in together:
            try:
                means = [frame.read(np.mean) for frame in made.frames]
            except versavis.Overtaken:
                continue  # this program was too slow for this set
            rate = made.imu["gyro"].mean(axis=0) if len(made.imu) else None
            print(f"tick {made.tick}, within {made.spread} ns: brightness {np.round(means, 1)}, "
                  f"{len(made.imu)} IMU samples, rad/s {rate}")


def main():
    try:
        print_sets(sys.argv[1:] or ["cam0", "cam1"])
    except versavis.Error as error:
        sys.exit(str(error))
    except KeyboardInterrupt:
        pass
    except BrokenPipeError:  # nobody reads on: what is left goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    main()
