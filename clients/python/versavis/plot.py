# SPDX-License-Identifier: BSD-3-Clause
"""Draws the file that 'versavis clock history' writes: offset, skew, residual and innovation of the
board's clock, on the left at the start, on the right after it.

    python3 -m versavis.plot history.csv -o plot.svg
"""
import argparse
import sys
from pathlib import Path

import numpy as np

START_S = 10
START_POINTS = 30  # where exchanges are rare
OUTLIERS_PERCENT = 1  # on either side, do not scale the axes
COLUMNS = {"time_s", "offset_ns", "sigma_ns", "skew_ppm", "skew_sigma_ppm", "residual_ns",
           "innovation_ns"}


def read(path):
    """The rows of the file, by the names of its columns."""
    try:
        with open(path, encoding="utf-8") as file:
            rows = np.atleast_1d(np.genfromtxt(file, delimiter=",", names=True))
    except (OSError, ValueError) as error:
        sys.exit(f"{path}: cannot be read: {error}")
    if not rows.size or not COLUMNS <= set(rows.dtype.names or ()):
        sys.exit(f"{path}: is no history of a clock; 'versavis clock history' writes one")
    return rows


def end_of_start(time_s):
    """How many rows are drawn as the start."""
    rare = time_s[min(START_POINTS, len(time_s) - 1)]
    until = min(max(time_s[0] + START_S, rare), (time_s[0] + time_s[-1]) / 2)
    return max(int(np.searchsorted(time_s, until, side="right")), 1)


def straight_line(rows):
    """Slope and offset of the second half: an estimator may take long to converge."""
    rest = rows[len(rows) // 2:]
    if len(rest) < 2 or rest["time_s"][0] == rest["time_s"][-1]:
        return np.array([0, rest["offset_ns"][0]])
    return np.polyfit(rest["time_s"], rest["offset_ns"], 1)


def draw_curve(axes, time_s, values, sigma):
    axes.fill_between(time_s, values - sigma, values + sigma, color="#c9dcf2", linewidth=0)
    axes.plot(time_s, values, color="#1f5fa8", linewidth=1,
              marker="." if len(values) < 2 else None)
    height = np.ptp(values) or sigma[-1] or 1
    room = min(sigma[-1], height) + 0.05 * height  # a much higher band would hide the curve
    axes.set_ylim(values.min() - room, values.max() + room)


def draw_dots(axes, time_s, values):
    axes.plot(time_s, values, ".", color="#333", markersize=2, rasterized=len(values) > 2000)
    if len(values) > 1:
        low, high = np.percentile(values, [OUTLIERS_PERCENT, 100 - OUTLIERS_PERCENT])
        room = 0.05 * (high - low) or 1
        axes.set_ylim(low - room, high + room)


def draw_column(panels, rows, line):
    time_s = rows["time_s"]
    offset, skew, residual, innovation = panels
    draw_curve(offset, time_s, (rows["offset_ns"] - np.polyval(line, time_s)) / 1e3,
               rows["sigma_ns"] / 1e3)
    draw_curve(skew, time_s, rows["skew_ppm"], rows["skew_sigma_ppm"])
    draw_dots(residual, time_s, rows["residual_ns"] / 1e3)
    moved = rows["innovation_ns"] != 0
    draw_dots(innovation, time_s[moved], rows["innovation_ns"][moved] / 1e3)
    innovation.set_xlabel("time since the first exchange [s]")


def draw(pyplot, rows, title):
    split = end_of_start(rows["time_s"])
    rest = rows[split:] if split < len(rows) else rows
    line = straight_line(rest)
    figure, panels = pyplot.subplots(4, 2, sharex="col", figsize=(12, 9), layout="constrained")
    draw_column(panels[:, 0], rows[:split], line)
    draw_column(panels[:, 1], rest, line)
    for axes, label in zip(panels[:, 0], ("offset less a line [us]", "skew [ppm]",
                                          "residual [us]", "innovation [us]")):
        axes.set_ylabel(label)
    panels[0, 0].set_title("start")
    panels[0, 1].set_title("after convergence")
    figure.suptitle(f"{title}: {len(rows)} exchanges; the straight line: {line[0] / 1e3:+.4f} ppm")
    return figure


def main():
    parser = argparse.ArgumentParser(prog="python3 -m versavis.plot", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("history", help="CSV file of 'versavis clock history'")
    parser.add_argument("-o", "--output", required=True, help="file to write: .svg, .png or .pdf")
    parser.add_argument("--title", help="default: the name of the file")
    options = parser.parse_args()
    try:
        import matplotlib  # pylint: disable=import-outside-toplevel
        matplotlib.use("agg")
        from matplotlib import pyplot  # pylint: disable=import-outside-toplevel
    except ImportError:
        sys.exit("versavis.plot needs matplotlib: apt install python3-matplotlib")
    rows = read(options.history)
    figure = draw(pyplot, rows, options.title or Path(options.history).name)
    try:
        figure.savefig(options.output)
    except (OSError, ValueError) as error:
        sys.exit(f"{options.output}: cannot be written: {error}")


if __name__ == "__main__":
    main()
