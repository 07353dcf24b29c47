# SPDX-License-Identifier: BSD-3-Clause
"""What the evaluation found, as docs/evaluation.md, as pictures and in a few lines."""
import math
import statistics
import textwrap

# Taps of the ADIS16448's filter double with each strength; it samples so often.
PART_HZ = 819.2
# Mean age of what is read without data-ready: half a period of the part.
AGE_MS = 500 / PART_HZ
# Published offsets between camera and IMU, ms; they hold what the sensor element adds.
PUBLISHED_MS = {0: 1.55, 2: 5.26, 4: 19.95}
# What makes a run good: half a step of the LEDs, as published; and the goals for sub-step offsets
# and for camera and IMU.
LED_LIMIT_US, IMU_LIMIT_MS = 5, 0.06
LINE_DELAY_US = (36, 18)
MODES = {"off": "nothing corrected", "on": "corrected, read on the board's grid",
         "paced": "corrected, paced by data-ready"}


def theory_ms(strength):
    return (2 ** strength - 1) / PART_HZ * 1e3


def expected_ms(mode, strength):
    return theory_ms(strength) + AGE_MS if mode == "off" else 0


def exposure_name(key):
    exposure = key.split("/")[1]
    return "automatic" if exposure == "0" else f"{exposure} ms"


def offsets_ms(runs):
    return [run["timeshift_cam_imu_s"] * 1e3 for run in runs]


def sigma_ms(runs):
    return math.sqrt(statistics.mean((run["timeshift_cam_imu_sigma_s"] * 1e3) ** 2
                                     for run in runs))


def errors_ms(found, mode):
    """Of all recordings, in the order of filters and exposures."""
    return [offset - expected_ms(mode, int(key.split("/")[0]))
            for key, runs in found["imu"][mode].items() for offset in offsets_ms(runs)]


def rms(values):
    return math.sqrt(statistics.mean(value * value for value in values))


def passed(found):
    good = True
    for name, leds in found.get("leds", {}).items():
        pair = leds["pairs"][0]
        good &= pair["mismatches"] == 0
        if name in ("fine", "late line, configured"):
            good &= abs(pair["offset_us"]) <= LED_LIMIT_US
    for mode in found.get("imu", {}):
        good &= rms(errors_ms(found, mode)) <= IMU_LIMIT_MS
    return good


def summary(found):
    lines = []
    for name, leds in found.get("leds", {}).items():
        pair = leds["pairs"][0]
        lines.append(f"LED board, {name}: {pair['pairs']} pairs, {pair['mismatches']} mismatches, "
                     f"offset {microseconds(pair)}")
    for mode in found.get("imu", {}):
        errors = errors_ms(found, mode)
        lines.append(f"camera and IMU, {MODES[mode]}: {len(errors)} offsets, "
                     f"rms error {rms(errors) * 1e3:.0f} us")
    if "clock" in found:
        lines.append(f"clock: rms error {us(found['clock']['pps_published']['rms_ns'])} us")
    lines.append("ok" if passed(found) else "NOT as it should be")
    return "\n".join(lines)


def microseconds(pair):
    if pair["offset_us"] is None:
        return "not seen"
    return f"{pair['offset_us']:+.1f} ± {pair['interval_us']:.1f} us"


def us(ns):
    return f"{ns * 1e-3:.3g}"


def row(*cells):
    return "| " + " | ".join(map(str, cells)) + " |"


def led_rows(found):
    what = {"published": "as published: 1000 Hz, 1 ms", "fine": "970 Hz, 1.1 ms",
            "late line": "the same, second camera's line late",
            "late line, configured": "the same, delays configured"}
    rows = [row("published system: 1000 Hz, 1 ms", 400, 0, "below 500 us", "")]
    for name, leds in found["leds"].items():
        pair = leds["pairs"][0]
        wrong = sum(camera["wrong_increments"] for camera in leds["cameras"])
        rows.append(row(what[name], pair["pairs"], pair["mismatches"], microseconds(pair), wrong))
    return "\n".join(rows)


def imu_rows(found, mode):
    rows = []
    for strength in PUBLISHED_MS:
        cells = [f"{strength}", f"{expected_ms(mode, strength):.3f}"]
        for key, runs in found["imu"][mode].items():
            if int(key.split("/")[0]) == strength:
                offsets = offsets_ms(runs)
                spread = f" ± {statistics.stdev(offsets):.3f}" if len(offsets) > 1 else ""
                cells.append(f"{statistics.mean(offsets):+.3f}{spread}")
        if mode == "off":
            cells.append(f"{PUBLISHED_MS[strength]:.2f}")
        rows.append(row(*cells))
    return "\n".join(rows)


def clock_rows(found):
    names = {"innovation": "innovation", "residual": "residual of an exchange",
             "live_against_smoothed": "live against smoothed",
             "pps_published": "true error of published stamps",
             "pps_by_all_messages": "true error, smoothed afterwards"}
    published = {"innovation": "±200", "residual": "±5000"}
    return "\n".join(row(meaning, us(found["clock"][key]["rms_ns"]), us(found["clock"][key]["p99_ns"]),
                         published.get(key, ""))
                     for key, meaning in names.items() if found["clock"][key]["count"])


TEXT = """\
# Evaluation on the virtual rig

`./dev evaluate` wrote this file and its pictures, from recordings of the [virtual rig](user/rig.md)
that `versavis evaluate` looked at as it looks at recordings of real cameras
([how to](user/evaluate.md), [how it works](design/evaluation.md)). Beside each figure stands that
of the published system where there is one (F. Tschopp et al., VersaVIS, Sensors 20(5), 2020).

## Camera to camera
Two cameras at 10 Hz look at the published LED board, one of them upside down.

![What the two cameras see of the board](images/leds.png)

| set-up | pairs | mismatches | offset of the second camera, 95 % | increments against stamps |
|---|---|---|---|---|
{led_rows}

In the third line the exposure line of the second camera is {line[0]} us late to rise and {line[1]}
us late to fall, as an opto-isolated output is, and the service does not know. Its stamps are late
by {middle:g} us then, and that is what the pictures show. The last line is the same with
`strobe_rising_us` and `strobe_falling_us` set, as a preset does for cameras that it knows.

## Camera to IMU
Offset between camera and IMU, from {seconds:g} s of hand-like motion (0.6 rad/s rms about each axis,
up to 2 Hz) without a target: mean of {runs} recordings, and the standard deviation of one, in ms.
The IMU is an ADIS16448 at 200 Hz, with 2^B taps in both stages of its filter. Its delay is
(2^B - 1) / 819.2 s.

![Offsets against exposure time](images/camera-imu.svg)

### Nothing corrected
As published: `filter_delay_us = 0`. Expected is the filter's delay and the mean age of what is read
without data-ready, 0.610 ms.

| B | expected | 1 ms | 3 ms | 5 ms | automatic | published |
|---|---|---|---|---|---|---|
{off_rows}

The published offsets are 0.9 to 1.2 ms larger in all lines: that is the bandwidth of the sensor
element, which no data sheet tells and the rig does not have. Exposure time has no influence, there
as here.

### Corrected
What the service does unless told otherwise: expected is 0.

| B | expected | 1 ms | 3 ms | 5 ms | automatic |
|---|---|---|---|---|---|
{on_rows}

With the data-ready line wired (`data_ready = true`), where no sample is older than its stamp:

| B | expected | 1 ms | 3 ms | 5 ms | automatic |
|---|---|---|---|---|---|
{paced_rows}

| | offsets | rms error, us | rms of the sigma told, us |
|---|---|---|---|
{error_rows}

## Clock
Board time to host time, {clock_seconds:.0f} s over the rig's link, in us; the second pulses of a GNSS
receiver, which the estimate does not use here, tell the true error.

| | rms | p99 | published |
|---|---|---|---|
{clock_rows}

## What a simulation cannot show
- Delays of real shutters, LEDs, drivers and cables. What the rig has of them is in its scenario;
  what nobody put there is not found here.
- The bandwidth of the sensor element, vibration, saturation, and an IMU's true noise.
- Lenses, rolling shutters, blur by defocus, and worlds that are near.
- USB: the rig's link is a socket. Asymmetric delays of a host controller shift all stamps alike,
  cameras and IMU by the same amount.
"""


def error_rows(found):
    rows = []
    for mode, meaning in MODES.items():
        every = [run for runs in found["imu"][mode].values() for run in runs]
        errors = errors_ms(found, mode)
        rows.append(row(meaning, len(errors), f"{rms(errors) * 1e3:.0f}",
                        f"{sigma_ms(every) * 1e3:.0f}"))
    return "\n".join(rows)


def write(found, docs):
    rising, falling = LINE_DELAY_US
    text = TEXT.format(
        led_rows=led_rows(found), line=LINE_DELAY_US, middle=(rising + falling) / 2,
        seconds=found["seconds"], runs=found["runs"], off_rows=imu_rows(found, "off"),
        on_rows=imu_rows(found, "on"), paced_rows=imu_rows(found, "paced"),
        error_rows=error_rows(found), clock_seconds=found["clock"]["duration_s"],
        clock_rows=clock_rows(found))
    (docs / "evaluation.md").write_text(text)
    draw_imu(found, docs / "images" / "camera-imu.svg")


def draw_imu(found, path):
    import matplotlib
    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "versavis", "font.size": 9})
    from matplotlib import pyplot

    figure, (left, right) = pyplot.subplots(1, 2, figsize=(8, 3.2))
    colours = dict(zip(PUBLISHED_MS, ("tab:blue", "tab:orange", "tab:green")))
    for panel, mode in ((left, "off"), (right, "paced")):
        ticks = []
        for key, runs in found["imu"][mode].items():
            strength = int(key.split("/")[0])
            if exposure_name(key) not in ticks:
                ticks.append(exposure_name(key))
            at = ticks.index(exposure_name(key))
            scale = 1 if mode == "off" else 1e3
            panel.plot([at] * len(runs), [scale * offset for offset in offsets_ms(runs)], "o",
                       markersize=4, color=colours[strength],
                       label=f"B = {strength}" if at == 0 else None)
        panel.set_xticks(range(len(ticks)), ticks)
        panel.set_xlabel("exposure")
    for strength in PUBLISHED_MS:
        left.axhline(expected_ms("off", strength), color=colours[strength], linewidth=0.8)
    left.set_ylabel("offset, ms")
    left.set_title("nothing corrected; lines: expected")
    right.axhline(0, color="black", linewidth=0.8)
    right.set_ylabel("offset, us")
    right.set_title("corrected, with data-ready")
    left.legend()
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, metadata={"Date": None, "Creator": None})


def write_led_picture(pictures, directory):
    """The two pictures of one tick side by side, each cut to the board."""
    if directory is None:
        return
    from PIL import Image
    boxes = ((60, 270, 600, 360), (140, 90, 500, 170))
    parts = [Image.open(path).convert("L").crop(box).resize((540, 120))
             for path, box in zip(pictures, boxes)]
    whole = Image.new("L", (540, 246), 255)
    whole.paste(parts[0], (0, 0))
    whole.paste(parts[1], (0, 126))
    directory.mkdir(parents=True, exist_ok=True)
    # Sixteen grey levels are enough to see, and a fifth of the bytes.
    whole.quantize(16).save(directory / "leds.png", optimize=True)
