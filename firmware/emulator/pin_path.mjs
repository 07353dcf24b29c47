// SPDX-License-Identifier: BSD-3-Clause
// What lies between a pin and whoever drives it: delays of pads and drivers, a capacitor, a contact
// that bounces or fails, a level that nothing moves; and the moment at which the chip's clock takes
// the level in. Instants are cycles and may lie between two of them.

const cycle_ns = 8;

/// Numbers from 0 to 1, the same for each run.
export function random_numbers(seed) {
    let state = seed >>> 0;
    return () => {
        state = (state + 0x6d2b79f5) >>> 0;
        let word = Math.imul(state ^ (state >>> 15), state | 1);
        word ^= word + Math.imul(word ^ (word >>> 7), word | 61);
        return ((word ^ (word >>> 14)) >>> 0) / 2 ** 32;
    };
}

const ideal = {
    rise_ns: 0, // an edge comes so much later
    fall_ns: 0,
    shortest_ns: 0, // shorter levels do not pass; others come so much later, too
    loses: 0, // probability that a pulse is lost; it leads away from the level of the begin
    bounces: 0, // after an edge, at most so many times back and forth...
    bounce_ns: 1000, // ... within that time
    clamp: undefined, // the level of the pin, whoever drives it
    jitter_ns: 0, // half of it from the clock's edge, chance says which one takes a level in
    seed: 1,
};

export class PinPath {
    /// `moved` is called when the level at the pin has changed.
    constructor(clock, properties, level, moved) {
        for (const name of Object.keys(properties))
            if (!(name in ideal)) throw new Error(`a pin's path has no property ${name}`);
        Object.assign(this, { ...ideal, ...properties, clock, moved });
        this.random = random_numbers(this.seed);
        this.wanted = level;
        this.rest = level;
        this.level = this.clamp ?? level; // at the pin, as the chip sees it
        this.coming = []; // changes on their way
        this.edges = []; // {at, level} of the pin: when they came, in fractions of cycles
    }

    /// Who drives the pin gives it this level at the instant `from`.
    drive(level, from) {
        if (level === this.wanted) return;
        this.wanted = level;
        if (this.clamp !== undefined) return;
        while (this.coming.length > 0 && this.coming.at(-1).from >= from) this.drop_last();
        if (level === (this.coming.at(-1)?.level ?? this.level)) return;
        if (level !== this.rest && this.random() < this.loses) return;
        this.pass(level, from);
        if (this.bounces > 0) this.bounce(level, from);
    }

    bounce(level, from) {
        const changes = 2 * Math.floor(this.random() * (this.bounces + 1));
        const instants = Array.from({ length: changes }, () => this.random());
        instants.sort((a, b) => a - b);
        instants.forEach((part, i) =>
            this.pass(i % 2 === 0 ? 1 - level : level, from + (part * this.bounce_ns) / cycle_ns),
        );
    }

    pass(level, from) {
        const { coming } = this;
        const at = from + ((level ? this.rise_ns : this.fall_ns) + this.shortest_ns) / cycle_ns;
        const before = coming.at(-1);
        const is_short = (from - before?.from) * cycle_ns < this.shortest_ns;
        if (is_short || at <= before?.at) return this.drop_last();
        const cycle = Math.max(this.taken_in(at, from), before?.cycle ?? 0);
        const event = this.clock.input_at(cycle, () => this.arrive());
        coming.push({ level, from, at, cycle, event });
    }

    /// The cycle whose end takes in what came at `at`, like the level that an output has since the
    /// begin of that cycle.
    taken_in(at, from) {
        const nearest = Math.round(at);
        const is_near = Math.abs(at - nearest) * cycle_ns < this.jitter_ns / 2;
        if (!is_near) return Math.floor(at);
        return Math.max(nearest - Math.floor(this.random() * 2), Math.floor(from));
    }

    arrive() {
        const { level, at } = this.coming.shift();
        this.level = level;
        this.edges.push({ at, level });
        this.moved();
    }

    drop_last() {
        this.clock.cancel(this.coming.pop().event);
    }

    /// What is on its way does not come.
    cut() {
        while (this.coming.length > 0) this.drop_last();
    }
}
