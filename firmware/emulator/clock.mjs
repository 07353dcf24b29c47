// SPDX-License-Identifier: BSD-3-Clause
// The machine's only clock: cycles of clk_sys since boot, and what is to happen when.

/// A queue of events by cycle; those of one cycle happen in the order in which they were queued.
export class Queue {
    constructor() {
        this.heap = [];
        this.count = 0;
    }

    get due() {
        return this.heap.length > 0 ? this.heap[0].cycle : Infinity;
    }

    push(cycle, action) {
        const event = { cycle, order: this.count++, action };
        const { heap } = this;
        let at = heap.length;
        while (at > 0) {
            const above = (at - 1) >> 1;
            if (!is_before(event, heap[above])) break;
            heap[at] = heap[above];
            at = above;
        }
        heap[at] = event;
        return event;
    }

    pop() {
        const { heap } = this;
        const first = heap[0];
        const last = heap.pop();
        if (heap.length > 0) this.sink(last);
        return first;
    }

    /// Puts `event` into the free place at the top.
    sink(event) {
        const { heap } = this;
        let at = 0;
        for (;;) {
            let below = 2 * at + 1;
            if (below >= heap.length) break;
            if (below + 1 < heap.length && is_before(heap[below + 1], heap[below])) ++below;
            if (!is_before(heap[below], event)) break;
            heap[at] = heap[below];
            at = below;
        }
        heap[at] = event;
    }
}

function is_before(left, right) {
    return left.cycle < right.cycle || (left.cycle === right.cycle && left.order < right.order);
}

/// Within a cycle, inputs change first, then the state machines of the PIO act, then all other
/// events happen, and at last the processor acts.
export class Clock {
    constructor() {
        this.now = 0;
        this.due = Infinity; // when something but the processor acts next, at the latest
        this.inputs = new Queue();
        this.events = new Queue();
        this.pios = [];
    }

    /// `action` happens at `cycle`, not before now. Returns an event for `cancel`.
    at(cycle, action) {
        if (cycle < this.due) this.due = cycle;
        return this.events.push(cycle, action);
    }

    after(cycles, action) {
        return this.at(this.now + cycles, action);
    }

    input_at(cycle, action) {
        if (cycle < this.due) this.due = cycle;
        return this.inputs.push(cycle, action);
    }

    /// An event that is undefined or over is no error.
    cancel(event) {
        if (event !== undefined) event.action = undefined;
    }

    /// Lives everything up to `cycle`, and that cycle.
    settle(cycle) {
        const { inputs, events, pios } = this;
        for (;;) {
            let next = Math.min(inputs.due, events.due);
            for (const pio of pios) if (pio.due < next) next = pio.due;
            if (next > cycle) {
                this.due = next;
                break;
            }
            this.now = Math.max(this.now, next);
            while (inputs.due <= next) inputs.pop().action?.();
            for (const pio of pios) if (pio.due <= next) pio.run(next);
            while (events.due <= next) events.pop().action?.();
        }
        this.now = cycle;
    }
}
