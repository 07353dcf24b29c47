# SPDX-License-Identifier: BSD-3-Clause
"""What the evaluation found, as docs/results.md, as pictures and in a few lines."""
import math
import statistics
import textwrap

# Taps of the ADIS16448's filter double with each strength; it samples so often.
PART_HZ = 819.2
# Mean age of what is read without data-ready: half a period of the part.
AGE_MS = 500 / PART_HZ
# Delay of its sensor element, with poles at 404 and 757 Hz.
ELEMENT_MS = 1e3 / (2 * math.pi) * (1 / 404 + 1 / 757)
# Published offsets between camera and IMU, ms.
PUBLISHED_MS = {0: 1.55, 2: 5.26, 4: 19.95}
# Strengths of the IMU's filter, and exposure times in ms, of the publication; 0 is automatic.
FILTERS = tuple(PUBLISHED_MS)
EXPOSURES_MS = (1, 3, 5, 0)
# Delays of an exposure line's edges, as of an opto-isolated output. Stamps are late by their mean.
LINE_DELAY_US = (36, 18)
LATE_US = sum(LINE_DELAY_US) / 2
# Recordings of the LED board, and the offset that each must show; none: it need not show one.
LED_CASES = {"published": None, "fine": 0, "late line": -LATE_US, "late line, configured": 0}
MODES = {"off": "nothing corrected", "on": "corrected, read on the board's grid",
         "paced": "corrected, paced by data-ready"}
PARTS = ("leds", "imu", "clock")
# What makes a run good. As many pairs as were published must match. Half: less is shown than was
# published. Twice: the recording must be so much longer.
LED_PAIRS = 400
# Pictures of an instant at which all LEDs change cannot be read for certain. Half: four in 400.
# Twice: a board that is hard to read passes.
LED_AMBIGUOUS = 0.02
# Goals for sub-step offsets, and for camera and IMU. Half: noise looks like an error. Twice: errors
# pass that the tools could show.
LED_LIMIT_US, IMU_LIMIT_MS = 5, 0.06
# Errors against the sigma that was reported. Half: of all runs some fail by chance. Twice: a sigma
# passes that promises more than is true.
HONEST = 1.5
# True error of stamps, rms. Half: less than the link of a busy host allows. Twice: as large as what
# the delays of camera lines are.
CLOCK_LIMIT_US = 20


def theory_ms(strength):
    return (2 ** strength - 1) / PART_HZ * 1e3 + ELEMENT_MS


def expected_ms(mode, strength):
    return theory_ms(strength) + AGE_MS if mode == "off" else 0


def imu_keys():
    """Names of the measurements in a mode: strength of the filter, exposure time."""
    return [f"{strength}/{exposure}" for strength in FILTERS for exposure in EXPOSURES_MS]


def exposure_name(exposure_ms):
    return f"{exposure_ms} ms" if exposure_ms else "automatic"


def known(value):
    return value is not None and math.isfinite(value)


def answers(found, mode, key):
    """Of one measurement, those that were not refused."""
    runs = found.get("imu", {}).get(mode, {}).get(key, [])
    return [run for run in runs if known(run.get("timeshift_cam_imu_s"))
            and known(run.get("timeshift_cam_imu_sigma_s"))]


def offsets_ms(found, mode, key):
    return [run["timeshift_cam_imu_s"] * 1e3 for run in answers(found, mode, key)]


def sigmas_ms(found, mode):
    return [run["timeshift_cam_imu_sigma_s"] * 1e3
            for key in imu_keys() for run in answers(found, mode, key)]


def errors_ms(found, mode):
    """Of all recordings, in the order of filters and exposures."""
    return [offset - expected_ms(mode, int(key.split("/")[0]))
            for key in imu_keys() for offset in offsets_ms(found, mode, key)]


def rms(values):
    """Of no value: none."""
    return math.sqrt(statistics.mean(value * value for value in values)) if values else None


def led_pair(found, name):
    """What the two cameras showed; none: it was not measured, or one of them did not see it."""
    pairs = found.get("leds", {}).get(name, {}).get("pairs", [])
    return pairs[0] if pairs else None


def led_faults(found):
    for name, expected in LED_CASES.items():
        what, pair = f"LED board, {name}", led_pair(found, name)
        if pair is None:
            yield f"{what}: no pairs"
            continue
        if pair["matches"] < LED_PAIRS:
            yield f"{what}: {pair['matches']} pairs match, less than {LED_PAIRS}"
        if pair["mismatches"] > 0:
            yield f"{what}: {pair['mismatches']} pairs do not match"
        if pair["ambiguous"] > LED_AMBIGUOUS * pair["pairs"]:
            yield f"{what}: {pair['ambiguous']} pairs are ambiguous"
        if wrong_increments(found, name) > 0:
            yield f"{what}: {wrong_increments(found, name)} increments contradict the stamps"
        if expected is None:
            continue
        if microseconds(pair) == "not seen" or pair["interval_us"] > LED_LIMIT_US:
            yield f"{what}: the offset is not seen to {LED_LIMIT_US} us"
        elif abs(pair["offset_us"] - expected) > LED_LIMIT_US + pair["interval_us"]:
            yield f"{what}: the offset is {microseconds(pair)}, not {expected:g} us"


def imu_faults(found):
    for mode, meaning in MODES.items():
        what = f"camera and IMU, {meaning}"
        errors, sigma = rms(errors_ms(found, mode)), rms(sigmas_ms(found, mode))
        wanted = len(imu_keys()) * found["runs"]
        if len(errors_ms(found, mode)) < wanted:
            yield f"{what}: {len(errors_ms(found, mode))} offsets, not {wanted}"
        if errors is None:
            continue
        if errors > IMU_LIMIT_MS:
            yield f"{what}: rms error {errors * 1e3:.0f} us, above {IMU_LIMIT_MS * 1e3:.0f} us"
        if errors > HONEST * sigma:
            yield f"{what}: rms error {errors * 1e3:.0f} us, but sigma says {sigma * 1e3:.0f} us"


def clock_error_us(found):
    """Rms of the true error of published stamps; none: it was not seen."""
    spread = found.get("clock", {}).get("pps_published", {})
    seen = spread.get("count") and known(spread.get("rms_ns"))
    return spread["rms_ns"] * 1e-3 if seen else None


def clock_faults(found):
    error = clock_error_us(found)
    if error is None:
        yield "clock: the true error is not seen"
    elif error > CLOCK_LIMIT_US:
        yield f"clock: true error {error:.3g} us rms, above {CLOCK_LIMIT_US} us"


def parts_of(found):
    """Those that were to be measured."""
    return found.get("parts", PARTS)


def faults(found):
    """What is not as it should be, a line each."""
    judges = {"leds": led_faults, "imu": imu_faults, "clock": clock_faults}
    return [f"not measured: {why}" for why in found.get("failed", [])] + [
        fault for part in parts_of(found) for fault in judges[part](found)]


def passed(found):
    return not faults(found)


def summary(found):
    lines = []
    for name in LED_CASES if "leds" in parts_of(found) else ():
        pair = led_pair(found, name)
        if pair:
            lines.append(f"LED board, {name}: {pair['pairs']} pairs, {pair['mismatches']} "
                         f"mismatches, {pair['ambiguous']} ambiguous, offset {microseconds(pair)}")
    for mode in MODES if "imu" in parts_of(found) else ():
        errors = errors_ms(found, mode)
        lines.append(f"camera and IMU, {MODES[mode]}: {len(errors)} offsets, "
                     f"rms error {rounded_us(rms(errors))} us, sigma "
                     f"{rounded_us(rms(sigmas_ms(found, mode)))} us")
    if "clock" in parts_of(found) and clock_error_us(found) is not None:
        lines.append(f"clock: rms error {clock_error_us(found):.3g} us")
    lines += [f"NOT as it should be: {fault}" for fault in faults(found)] or ["ok"]
    return "\n".join(lines)


def rounded_us(value_ms):
    return "-" if value_ms is None else f"{value_ms * 1e3:.0f}"


def wrong_increments(found, name):
    return sum(camera["wrong_increments"] for camera in found["leds"][name]["cameras"])


def microseconds(pair):
    if not known(pair["offset_us"]) or not known(pair["interval_us"]):
        return "not seen"
    return f"{pair['offset_us']:+.1f} ± {pair['interval_us']:.1f} us"


def us(ns):
    return f"{ns * 1e-3:.3g}" if known(ns) else "not seen"


def row(*cells):
    return "| " + " | ".join(map(str, cells)) + " |"


def led_rows(found):
    what = {"published": "as published: 1000 Hz, 1 ms", "fine": "970 Hz, 1.1 ms",
            "late line": "the same, second camera's line late",
            "late line, configured": "the same, delays configured"}
    rows = [row("published system: 1000 Hz, 1 ms", LED_PAIRS, 0, "", "below 500 us", "")]
    for name in LED_CASES:
        pair = led_pair(found, name)
        rows.append(row(what[name], pair["pairs"], pair["mismatches"], pair["ambiguous"],
                        microseconds(pair), wrong_increments(found, name))
                    if pair else row(what[name], 0, "", "", "not measured", ""))
    return "\n".join(rows)


def imu_rows(found, mode):
    rows = []
    for strength in FILTERS:
        every = [offsets_ms(found, mode, f"{strength}/{exposure}") for exposure in EXPOSURES_MS]
        cells = [strength, f"{expected_ms(mode, strength):.3f}", sum(map(len, every))]
        cells += map(mean_ms, every)
        if mode == "off":
            cells.append(f"{PUBLISHED_MS[strength]:.2f}")
        rows.append(row(*cells))
    return "\n".join(rows)


def mean_ms(offsets):
    if not offsets:
        return "not seen"
    spread = f" ± {statistics.stdev(offsets):.3f}" if len(offsets) > 1 else ""
    return f"{statistics.mean(offsets):+.3f}{spread}"


def clock_rows(found):
    names = {"innovation": "innovation", "residual": "residual of an exchange",
             "live_against_smoothed": "live against smoothed",
             "pps_published": "true error of published stamps",
             "pps_by_all_messages": "true error, smoothed afterwards"}
    published = {"innovation": "±200", "residual": "±5000"}
    seen = {key: spread for key, spread in found.get("clock", {}).items() if key in names}
    return "\n".join(row(meaning, us(seen[key]["rms_ns"]), us(seen[key]["p99_ns"]),
                         published.get(key, ""))
                     if seen.get(key, {}).get("count") else
                     row(meaning, "not seen", "", published.get(key, ""))
                     for key, meaning in names.items())


TEXT = """\
# Evaluation on the virtual rig

`./dev evaluate` wrote this file and its pictures, from recordings of the [virtual rig](user/rig.md)
that `versavis evaluate` processed like recordings of real cameras ([how to](user/evaluate.md), [how
it works](design/evaluation.md)). Figures of the published system, where there are any, are beside
them (F. Tschopp et al., VersaVIS, Sensors 20(5), 2020).

## Camera to camera
Two cameras at 10 Hz look at the published LED board, one of them upside down.

![What the two cameras see of the board](images/leds.png)

| set-up | pairs | mismatches | ambiguous | offset of the second, 95 % | wrong increments |
|---|---|---|---|---|---|
{led_rows}

In the third line the exposure line of the second camera is {line[0]} us late to rise and {line[1]}
us late to fall, like an opto-isolated output, and the service does not know it. Its stamps are late
by {middle:g} us: it exposes that much earlier than they say, and the pictures must
show this. The last line is the same with `strobe_rising_us` and `strobe_falling_us` set, as a
preset does for cameras that it knows.

## Camera to IMU
Offset between camera and IMU, from {seconds:g} s of hand-like motion (0.6 rad/s rms about each
axis, up to 2 Hz) without a target: mean of {runs} recordings, and the standard deviation of one, in
ms. N is the number of offsets of a line.
The IMU is an ADIS16448 at 200 Hz, with 2^B taps in both stages of its filter. These delay by
(2^B - 1) / 819.2 s, and its sensor element, with poles at 404 and 757 Hz, by 0.604 ms.

![Offsets against exposure time](images/camera-imu.svg)

### Nothing corrected
As published: `filter_delay_us = 0`. Expected are the delays of element and filter and the mean age
of what is read without data-ready, 0.610 ms.

| B | expected | N | 1 ms | 3 ms | 5 ms | automatic | published |
|---|---|---|---|---|---|---|---|
{off_rows}

The published offsets are 0.3 to 0.4 ms larger in all lines; no data sheet explains that rest.
Exposure time has no influence, there as here.

### Corrected
The service's default: expected is 0.

| B | expected | N | 1 ms | 3 ms | 5 ms | automatic |
|---|---|---|---|---|---|---|
{on_rows}

With the data-ready line wired (`data_ready = true`), where no sample is older than its stamp:

| B | expected | N | 1 ms | 3 ms | 5 ms | automatic |
|---|---|---|---|---|---|---|
{paced_rows}

| | N | rms error, us | rms of the stated sigma, us |
|---|---|---|---|
{error_rows}

## Clock
Board time to host time, over the rig's link ({clock_span}), in us; the second pulses of a GNSS
receiver, which the estimate does not use here, show the true error.

| | rms | p99 | published |
|---|---|---|---|
{clock_rows}

## What a simulation cannot show
- Delays of real shutters, LEDs, drivers and cables. The rig has only those in its scenario, so
  others are not found here.
- Vibration, saturation, an IMU's true noise, and the spread of its element's bandwidth.
- Lenses, rolling shutters, blur by defocus, and near scenes.
- USB: the rig's link is a socket. Asymmetric delays of a host controller shift all stamps alike,
  cameras and IMU by the same amount.
"""


def error_rows(found):
    rows = []
    for mode, meaning in MODES.items():
        errors = errors_ms(found, mode)
        rows.append(row(meaning, len(errors), rounded_us(rms(errors)),
                        rounded_us(rms(sigmas_ms(found, mode)))))
    return "\n".join(rows)


def text(found):
    duration = found.get("clock", {}).get("duration_s")
    return TEXT.format(
        led_rows=led_rows(found), line=LINE_DELAY_US, middle=LATE_US,
        seconds=found["seconds"], runs=found["runs"], off_rows=imu_rows(found, "off"),
        on_rows=imu_rows(found, "on"), paced_rows=imu_rows(found, "paced"),
        error_rows=error_rows(found), clock_rows=clock_rows(found),
        clock_span=f"{duration:.0f} s" if known(duration) else "not measured")


def write(found, docs):
    (docs / "results.md").write_text(text(found))
    draw_imu(found, docs / "images" / "camera-imu.svg")


def draw_imu(found, path):
    import matplotlib
    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "versavis", "font.size": 9})
    from matplotlib import pyplot

    figure, (left, right) = pyplot.subplots(1, 2, figsize=(8, 3.2))
    colours = dict(zip(PUBLISHED_MS, ("tab:blue", "tab:orange", "tab:green")))
    for panel, mode in ((left, "off"), (right, "paced")):
        scale = 1 if mode == "off" else 1e3
        for strength in FILTERS:
            for at, exposure in enumerate(EXPOSURES_MS):
                offsets = offsets_ms(found, mode, f"{strength}/{exposure}")
                panel.plot([at] * len(offsets), [scale * offset for offset in offsets], "o",
                           markersize=4, color=colours[strength],
                           label=f"B = {strength}" if at == 0 else None)
        panel.set_xticks(range(len(EXPOSURES_MS)), map(exposure_name, EXPOSURES_MS))
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
