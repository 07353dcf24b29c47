// SPDX-License-Identifier: BSD-3-Clause
// Asks for the state twice a second and for each camera's newest picture at most five times, each
// time after the answer before: a slow connection shows fewer of them, not older ones.
"use strict";

const state_period_ms = 500;
const picture_period_ms = 200;
const retry_period_ms = 1000;
const events_shown = 30;
const old_picture_s = 2;
const scales = [0.25, 0.5, 1, 2, 4, 8, 16];

const by_id = (id) => document.getElementById(id);

function element(tag, properties = {}, ...children) {
    const made = Object.assign(document.createElement(tag), properties);
    made.append(...children);
    return made;
}

function set_text(node, text) {
    if (node.textContent !== text) node.textContent = text;
}

function duration(seconds) {
    if (seconds < 0) return "0 s";
    if (seconds < 10) return `${seconds.toFixed(1)} s`;
    if (seconds < 120) return `${Math.round(seconds)} s`;
    if (seconds < 7200) return `${Math.round(seconds / 60)} min`;
    return `${(seconds / 3600).toFixed(1)} h`;
}

function length_of(ns) {
    if (ns === null || ns === undefined) return "unknown";
    const size = Math.abs(ns);
    if (size < 1e3) return `${ns.toFixed(0)} ns`;
    if (size < 1e6) return `${(ns / 1e3).toFixed(1)} µs`;
    if (size < 1e9) return `${(ns / 1e6).toFixed(2)} ms`;
    return `${(ns / 1e9).toFixed(2)} s`;
}

const percent = (part) => `${(100 * part).toFixed(part < 0.1 ? 2 : 1)} %`;
const words = (name) => name.replaceAll("_", " ");

/** Rows of a table, without making those anew that are as they were. A cell is a text, or
 *  properties of its element. */
function fill_rows(body, rows) {
    while (body.rows.length > rows.length) body.deleteRow(-1);
    rows.forEach((row, i) => {
        const shown = body.rows[i] ?? body.insertRow();
        const content = JSON.stringify(row);
        if (shown.dataset.content === content) return;
        shown.dataset.content = content;
        shown.replaceChildren(...row.map((cell) =>
            element("td", typeof cell === "string" ? {textContent: cell} : cell)));
    });
}

// Plots.

function colour(name) {
    return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/** The canvas at the resolution of the screen, empty. */
function begin_drawing(canvas) {
    const scale = window.devicePixelRatio || 1;
    const width = canvas.clientWidth;
    const height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * scale)) canvas.width = Math.round(width * scale);
    if (canvas.height !== Math.round(height * scale)) canvas.height = Math.round(height * scale);
    const pen = canvas.getContext("2d");
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.font = "12px system-ui, sans-serif";
    return {pen, width, height};
}

/** Lines over time. `series`: {name, points: [[seconds, value]]}; time ends now, at 0. `marks`:
 *  instants with words, [[seconds, text]]. */
function draw_lines(canvas, series, seconds, unit, from_zero, marks = []) {
    const {pen, width, height} = begin_drawing(canvas);
    const left = 56, bottom = 18, top = 16;
    const values = series.flatMap((line) => line.points.map((point) => point[1]))
        .filter((value) => value !== null);
    pen.fillStyle = colour("--faint");
    if (values.length === 0) {
        pen.fillText("nothing in this time", left, height / 2);
        return;
    }
    let low = from_zero ? 0 : Math.min(...values);
    let high = Math.max(...values);
    if (high - low < 1e-9) { low -= from_zero ? 0 : 0.5; high += 0.5; }
    const x = (t) => left + (1 + t / seconds) * (width - left - 4);
    const y = (value) => height - bottom - (value - low) / (high - low) * (height - bottom - top);
    const digits = Math.max(0, Math.min(6, 2 - Math.floor(Math.log10(high - low))));
    pen.textAlign = "right";
    pen.fillText(high.toFixed(digits), left - 4, top + 4);
    pen.fillText(low.toFixed(digits), left - 4, height - bottom);
    pen.fillText("now", width - 4, height - 4);
    pen.textAlign = "left";
    pen.fillText(`${duration(seconds)} before`, left, height - 4);
    pen.fillText(unit, 0, (height - bottom) / 2 + 4);
    pen.strokeStyle = colour("--line");
    pen.strokeRect(left, top, width - left - 4, height - bottom - top);
    marks.filter(([t]) => t > -seconds).forEach(([t, text], i) => {
        pen.strokeStyle = colour("--faint");
        pen.setLineDash([1, 3]);
        pen.beginPath();
        pen.moveTo(x(t), top);
        pen.lineTo(x(t), height - bottom);
        pen.stroke();
        const place = Math.min(x(t) + 4, width - 4 - pen.measureText(text).width);
        pen.fillText(text, Math.max(left + 2, place), top + 12 + 12 * (i % 4));
    });
    let at = left + 6;
    series.forEach((line, i) => {
        pen.strokeStyle = pen.fillStyle = colour(`--plot${i % 3}`);
        pen.setLineDash([[], [6, 3], [2, 2]][i % 3]);
        pen.beginPath();
        let down = false;
        for (const [t, value] of line.points) {
            if (value === null || t < -seconds) { down = false; continue; }
            if (down) pen.lineTo(x(t), y(value)); else pen.moveTo(x(t), y(value));
            down = true;
        }
        pen.stroke();
        pen.fillText(line.name, at, 11);
        at += pen.measureText(line.name).width + 16;
    });
    pen.setLineDash([]);
}

function draw_histogram(canvas, histogram) {
    const {pen, width, height} = begin_drawing(canvas);
    const most = Math.max(1, ...histogram);
    const step = width / histogram.length;
    histogram.forEach((count, i) => {
        const bar = height * Math.sqrt(count / most);
        pen.fillStyle = colour(i === histogram.length - 1 ? "--plot1" : "--plot0");
        pen.fillRect(i * step, height - bar, Math.max(1, step - 1), bar);
    });
}

function draw_exposures(cameras) {
    const names = Object.keys(cameras);
    const canvas = by_id("exposures");
    canvas.style.height = `${24 + 26 * Math.max(1, names.length)}px`;
    const {pen, width, height} = begin_drawing(canvas);
    const left = 72, seconds = 1;
    const newest = Math.max(...names.flatMap((name) =>
        cameras[name].exposures.map((exposure) => -exposure.age_s)));
    if (!isFinite(newest)) {
        pen.fillStyle = colour("--faint");
        pen.fillText("no exposure in the last two seconds", left, 20);
        return;
    }
    const x = (t) => left + (1 + (t - newest - 0.02) / seconds) * (width - left - 4);
    names.forEach((name, row) => {
        const top = 6 + 26 * row;
        pen.fillStyle = colour("--faint");
        pen.fillText(name, 0, top + 14, left - 8);
        pen.strokeStyle = colour("--line");
        pen.strokeRect(left, top, width - left - 4, 20);
        for (const exposure of cameras[name].exposures) {
            const from = x(-exposure.age_s - exposure.exposure_s / 2);
            const to = x(-exposure.age_s + exposure.exposure_s / 2);
            if (from < left) continue;
            const proved = exposure.kind === "measured" && !exposure.suspect;
            pen.fillStyle = colour(exposure.suspect ? "--bad" : "--plot0");
            if (proved) pen.fillRect(from, top + 3, Math.max(2, to - from), 14);
            else pen.fillRect(from, top + 8, Math.max(2, to - from), 4);
        }
    });
    pen.fillStyle = colour("--faint");
    pen.fillText("1 s before the newest exposure", left, height - 3);
}

/** Largest distance between the middles of exposures of one grid point; null: there are no two. */
function middle_distance_ns(cameras) {
    const middles = new Map();
    for (const camera of Object.values(cameras))
        for (const exposure of camera.exposures) {
            if (exposure.kind !== "measured") continue;
            const at = middles.get(exposure.tick) ?? [];
            at.push(exposure.age_s);
            middles.set(exposure.tick, at);
        }
    const distances = [...middles.values()].filter((at) => at.length > 1)
        .map((at) => Math.max(...at) - Math.min(...at));
    return distances.length > 0 ? Math.max(...distances) * 1e9 : null;
}

// Sections.

function device_rows(status) {
    const now = status.host_time_ns;
    const rows = [];
    const add = (name, device, figures) => {
        if (!device || device.state === "unused") return;
        const state = device.fault ? `${device.state}: ${words(device.fault)}` : device.state;
        rows.push([name, {textContent: state, className: device.health ?? ""},
            duration((now - device.since_ns) / 1e9), figures]);
        if (device.hint)
            rows.push([{textContent: device.hint, className: `hint ${device.health}`, colSpan: 4}]);
    };
    const rate = (device) =>
        `${(device.delivered_hz ?? 0).toFixed(1)} of ${device.configured_hz} Hz`;
    add("board", status.board, `${status.board?.serial ?? ""} ${status.board?.firmware ?? ""}, ` +
        `${status.board?.lost_packets ?? 0} packets lost`);
    add("clock", status.clock, `sigma ${length_of(status.clock?.sigma_ns)}, ` +
        `bound ${length_of(status.clock?.bound_ns)}`);
    for (const camera of status.cameras ?? [])
        add(camera.name, camera, `${rate(camera)}, pairing ${words(camera.pairing ?? "")}`);
    for (const imu of status.imus ?? []) add(imu.name, imu, rate(imu));
    for (const output of status.time_outputs ?? [])
        add(output.name, output, `${output.pulses} pulses` +
            (output.error_ns === null ? "" : `, ${length_of(output.error_ns)} off`));
    for (const lidar of status.lidars ?? [])
        add(lidar.name, lidar, lidar.behind_ns === null ? lidar.maker
            : `${lidar.maker}, ${length_of(lidar.behind_ns)} behind at most`);
    return rows;
}

function stamp_facts(shown, camera, live) {
    const withheld = Object.entries(live?.withheld ?? {})
        .map(([reason, count]) => `${count} ${words(reason)}`).join(", ");
    const quality = [words(shown.kind), `sigma ${length_of(shown.sigma_ns)}`];
    if (shown.suspect) quality.push("suspect: not proved");
    if (shown.holdover) quality.push("holdover");
    return [
        ["Stamp", `${shown.stamp_ns} ns, epoch ${shown.epoch}`],
        ["Quality", quality.join(", ")],
        ["Exposure", `${length_of(shown.exposure_ns)}, trigger ${shown.trigger}`],
        ["Frames", camera ? `${camera.frames_published} published, ` +
            `${camera.frames_without_trigger} without proof` +
            `${withheld ? ` (lately ${withheld})` : ""}, ${camera.frames_incomplete} incomplete` :
            "unknown"],
        ["Saturated", percent(shown.saturated)],
        ["Picture", `${shown.width} × ${shown.height} ${shown.format}` +
            (shown.gain === null ? "" : `, gain ${shown.gain.toFixed(1)} dB`)],
    ];
}

/** A camera's picture, with what belongs to it. */
class CameraView {
    constructor(name) {
        this.name = name;
        this.version = 0;
        this.first = this.shown = null;
        this.count = 0;
        this.picture = element("img", {alt: `newest picture of ${name}`});
        this.button = element("button", {type: "button", className: "picture",
            onclick: () => zoom.open(this)}, this.picture);
        this.button.setAttribute("aria-label", `Show ${name} pixel by pixel`);
        this.age = element("span", {className: "note"});
        this.problem = element("p", {className: "note degraded", hidden: true});
        this.histogram = element("canvas");
        this.histogram.setAttribute("role", "img");
        this.facts = element("dl");
        this.node = element("article", {className: "camera"},
            element("div", {className: "title"}, element("h3", {textContent: name}), this.age),
            this.button, this.problem, this.histogram, this.facts);
        this.look();
    }

    async look() {
        let pause = picture_period_ms;
        try {
            if (!document.hidden) await this.fetch_newest();
        } catch (error) {
            this.show_problem(error.message);
            pause = retry_period_ms;
        }
        setTimeout(() => this.look(), pause);
    }

    async fetch_newest() {
        const answer = await fetch(`/api/picture/${this.name}?after=${this.version}`);
        if (answer.status === 204) return;
        if (!answer.ok) throw new Error((await answer.json()).error);
        this.shown = JSON.parse(answer.headers.get("X-Versavis-Frame"));
        this.got_ms = performance.now();
        this.first ??= this.shown.number;
        ++this.count;
        this.version = this.shown.version;
        const before = this.picture.src;
        this.picture.src = URL.createObjectURL(await answer.blob());
        if (before) URL.revokeObjectURL(before);
        this.picture.width = this.shown.shown_width;
        this.picture.height = this.shown.shown_height;
        this.show_problem("");
        this.histogram.setAttribute("aria-label", `histogram of ${this.name}, dark to bright; ` +
            `${percent(this.shown.saturated)} saturated`);
    }

    show_problem(text) {
        set_text(this.problem, text);
        this.problem.hidden = text === "";
    }

    update(camera, live) {
        if (this.shown === null) return;
        draw_histogram(this.histogram, this.shown.histogram);
        const age = this.shown.age_s + (performance.now() - this.got_ms) / 1000;
        set_text(this.age, `age ${age.toFixed(2)} s, ${this.count} of ` +
            `${this.shown.number - this.first + 1} frames shown`);
        this.age.classList.toggle("degraded", age > old_picture_s);
        const facts = stamp_facts(this.shown, camera, live);
        if (this.facts.children.length !== 2 * facts.length)
            this.facts.replaceChildren(...facts.flatMap(([name]) =>
                [element("dt", {textContent: name}), element("dd")]));
        facts.forEach(([, value], i) => set_text(this.facts.children[2 * i + 1], value));
    }
}

/** One whole picture, its pixels as large as wanted. */
const zoom = {
    scale: 2,  // of scales
    url: "",

    async open(view) {
        const name = view.name;
        const answer = await fetch(`/api/picture/${name}?whole=1`).catch(() => null);
        if (answer?.status !== 200) {
            view.show_problem("There is no whole picture of it now.");
            return;
        }
        const shown = JSON.parse(answer.headers.get("X-Versavis-Frame"));
        if (this.url) URL.revokeObjectURL(this.url);
        this.url = URL.createObjectURL(await answer.blob());
        by_id("zoom-title").textContent = `${name}, stamp ${shown.stamp_ns} ns`;
        const picture = by_id("zoom-picture");
        picture.alt = `picture of ${name}`;
        picture.src = this.url;
        this.width = shown.width;
        const fits = scales.findLastIndex((scale) => scale * this.width <= window.innerWidth);
        this.set(Math.max(0, fits));
        by_id("zoom").showModal();
        by_id("zoom-view").focus();
    },

    set(scale) {
        const view = by_id("zoom-view");
        const before = scales[this.scale];
        this.scale = Math.max(0, Math.min(scales.length - 1, scale));
        const times = scales[this.scale] / before;
        const x = view.scrollLeft + view.clientWidth / 2;
        const y = view.scrollTop + view.clientHeight / 2;
        by_id("zoom-picture").style.width = `${this.width * scales[this.scale]}px`;
        by_id("zoom-scale").textContent = `${100 * scales[this.scale]} %`;
        view.scrollLeft = x * times - view.clientWidth / 2;
        view.scrollTop = y * times - view.clientHeight / 2;
    },

    start() {
        by_id("zoom-in").onclick = () => this.set(this.scale + 1);
        by_id("zoom-out").onclick = () => this.set(this.scale - 1);
        by_id("zoom-close").onclick = () => by_id("zoom").close();
        by_id("zoom").addEventListener("keydown", (event) => {
            if (event.key === "+") this.set(this.scale + 1);
            if (event.key === "-") this.set(this.scale - 1);
        });
        by_id("zoom-view").addEventListener("wheel", (event) => {
            if (!event.ctrlKey) return;
            event.preventDefault();
            this.set(this.scale + (event.deltaY < 0 ? 1 : -1));
        }, {passive: false});
    },
};

const cameras = new Map();

function update_cameras(state) {
    for (const name of Object.keys(state.cameras)) {
        if (cameras.has(name)) continue;
        cameras.set(name, new CameraView(name));
        by_id("cameras").append(cameras.get(name).node);
    }
    const devices = new Map((state.status?.cameras ?? []).map((camera) => [camera.name, camera]));
    for (const [name, view] of cameras) view.update(devices.get(name), state.cameras[name]);
}

function update_exposures(state) {
    draw_exposures(state.cameras);
    const distance = middle_distance_ns(state.cameras);
    const counts = Object.entries(state.cameras)
        .map(([name, camera]) => `${name}: ${camera.exposures.length} in 2 s`).join(", ");
    set_text(by_id("exposures-text"), distance === null ? counts :
        `${counts}. Middles of one grid point are at most ${length_of(distance)} apart.`);
}

function imu_plots(name) {
    const plots = ["rad/s", "m/s²"].map((unit) => {
        const canvas = element("canvas");
        canvas.setAttribute("role", "img");
        canvas.setAttribute("aria-label", `${name}, ${unit}, the last five seconds`);
        return canvas;
    });
    by_id("imus").append(element("h3", {textContent: name}), ...plots);
    return plots;
}

const imus = new Map();

function update_imus(state) {
    for (const [name, samples] of Object.entries(state.imus)) {
        if (!imus.has(name)) imus.set(name, imu_plots(name));
        const lines = (first) => ["x", "y", "z"].map((axis, i) =>
            ({name: axis, points: samples.map((sample) => [-sample[0], sample[first + i]])}));
        const [rotation, acceleration] = imus.get(name);
        draw_lines(rotation, lines(1), 5, "rad/s", false);
        draw_lines(acceleration, lines(4), 5, "m/s²", false);
    }
}

/** Where epochs begin, and how far the output clock stepped there. */
function epoch_marks(moments) {
    const marks = [];
    for (let i = 1; i < moments.length; ++i) {
        if (moments[i].epoch === moments[i - 1].epoch) continue;
        const by_ns = moments[i].output_ns - moments[i - 1].output_ns;
        const stepped = Math.abs(by_ns) > 1e5;
        const step = stepped ? `: output ${by_ns < 0 ? "−" : "+"}${length_of(Math.abs(by_ns))}` : "";
        marks.push([-moments[i].age_s, `epoch ${moments[i].epoch}${step}`]);
    }
    return marks;
}

/** How the output clock ran against the host's, from the beginning of each epoch on. */
function output_points(moments) {
    let begin = null;
    return moments.map((moment, i) => {
        if (i === 0 || moment.epoch !== moments[i - 1].epoch) begin = moment.output_ns;
        const known = moment.output_ns !== undefined && begin !== undefined;
        return [-moment.age_s, known ? (moment.output_ns - begin) / 1e3 : null];
    });
}

const clock_plots = [
    {name: "sigma and bound", unit: "µs", from_zero: true,
        series: {sigma: ["sigma_ns", 1e-3], bound: ["bound_ns", 1e-3]}},
    {name: "offset: newest exchange minus estimate", unit: "µs",
        series: {offset: ["residual_ns", 1e-3]}},
    {name: "skew: host against board", unit: "ppm", series: {skew: ["skew_ppm", 1]}},
    {name: "output clock minus host clock, in this epoch", unit: "µs", output: true},
];

function clock_canvases() {
    const box = by_id("clock");
    if (box.children.length === 0)
        for (const plot of clock_plots) {
            const canvas = element("canvas");
            canvas.setAttribute("role", "img");
            canvas.setAttribute("aria-label", `Clock, ${plot.name}`);
            box.append(canvas);
        }
    return box.children;
}

function update_clock(state) {
    const points = ([key, factor]) => state.clock.map((moment) =>
        [-moment.age_s, typeof moment[key] === "number" ? moment[key] * factor : null]);
    const seconds = Math.max(10, state.clock.length > 0 ? state.clock[0].age_s : 0);
    const marks = epoch_marks(state.clock);
    const canvases = clock_canvases();
    clock_plots.forEach((plot, i) => {
        const series = plot.output ? [{name: plot.name, points: output_points(state.clock)}] :
            Object.entries(plot.series).map(([name, of]) => ({name, points: points(of)}));
        if (series.length === 1) series[0].name = plot.name;
        draw_lines(canvases[i], series, seconds, plot.unit, plot.from_zero, marks);
    });
    const clock = state.status?.clock;
    set_text(by_id("clock-text"), clock ? `${clock.state}, output ${clock.output}, skew ` +
        `${(clock.skew_ppm ?? 0).toFixed(3)} ppm, round trip ${length_of(clock.round_trip_ns)}, ` +
        `${clock.output_steps} steps of the output clock, ${clock.restarts} restarts, epoch ` +
        `${clock.epoch}` : "");
}

function update_events(state) {
    fill_rows(by_id("events"), state.events.slice(-events_shown).reverse().map((event) =>
        [duration(event.age_s), words(event.kind), event.source,
            event.reason === "none" ? "" : words(event.reason), event.value, `${event.epoch}`]));
}

/** The button, and what became of the recording. */
const recording = {
    running: false,

    show(facts) {
        by_id("recording").hidden = !facts.possible;
        this.running = facts.running;
        set_text(by_id("record"), facts.running ? "Stop recording" : "Record");
        const size = `${duration(facts.seconds)}, ${(facts.bytes / 1e6).toFixed(1)} MB`;
        if (facts.running) this.say(`recording for ${size}, to ${facts.file}`);
        else if (facts.problem) this.say(facts.problem);
        else if (facts.report)
            this.say(`${facts.file}: ${size}, ${facts.report.lost} items lost` +
                (facts.report.stopped_early ? `; ${facts.report.stopped_early}` : ""));
    },

    say(text) {
        set_text(by_id("recording-text"), text);
    },

    async ask(method, query = "") {
        const answer = await fetch(`/api/record${query}`, {method});
        const facts = await answer.json();
        if (answer.ok) this.show(facts);
        else this.say(facts.error);
    },

    async look() {
        if (!document.hidden) await this.ask("GET").catch(() => {});
        setTimeout(() => this.look(), retry_period_ms);
    },

    start() {
        by_id("record").onclick = () => this.ask("POST",
            `?action=${this.running ? "end" : "begin"}`).catch((error) => this.say(error.message));
        this.look();
    },
};

/** Read when it is opened: a configuration does not change by itself. */
async function show_wiring() {
    if (!by_id("wiring").open) return;
    const drawing = by_id("wiring-drawing");
    drawing.hidden = true;
    drawing.onload = () => {
        URL.revokeObjectURL(drawing.src);
        drawing.hidden = false;
    };
    const answer = await fetch("/api/wiring.txt");
    set_text(by_id("wiring-text"), answer.ok ? await answer.text() : (await answer.json()).error);
    const drawn = await fetch("/api/wiring.svg");
    if (drawn.status === 200) drawing.src = URL.createObjectURL(await drawn.blob());
}

function update(state) {
    set_text(by_id("instance"), state.instance);
    document.title = `${state.instance}: ${state.conclusion.state} - VersaVIS`;
    const conclusion = by_id("conclusion");
    conclusion.className = `conclusion ${state.conclusion.state}`;
    set_text(conclusion, state.conclusion.sentence);
    fill_rows(by_id("devices"), state.status ? device_rows(state.status) : []);
    update_cameras(state);
    update_exposures(state);
    update_imus(state);
    update_clock(state);
    update_events(state);
}

let answered = new Date();

async function look() {
    const lost = by_id("lost");
    try {
        if (!document.hidden) {
            const answer = await fetch("/api/state");
            if (!answer.ok) throw new Error((await answer.json()).error);
            update(await answer.json());
            answered = new Date();
            lost.hidden = true;
        }
    } catch (error) {
        set_text(lost, `No answer from versavis-web since ${answered.toLocaleTimeString()} ` +
            `(${error.message}): what is shown is old.`);
        lost.hidden = false;
    }
    setTimeout(look, state_period_ms);
}

by_id("wiring").ontoggle = () => show_wiring().catch((error) =>
    set_text(by_id("wiring-text"), error.message));
zoom.start();
recording.start();
look();
