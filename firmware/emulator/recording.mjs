// SPDX-License-Identifier: BSD-3-Clause
// A recording of the core's calls: holds each call of a replay against it, and answers from it.
// firmware/replay/recorder.hpp describes the file, firmware/replay/image/window.hpp the other side.

const magic = 0x31505653; // "SVP1"
const poll_name = 'poll';

// Calls that an error shows before the one that differs.
const shown_before = 6;

function show(name, words) {
    return `${name}(${Array.from(words, (word) => `0x${word.toString(16)}`).join(', ')})`;
}

export class Recording {
    /// `read_text(address)` returns a text of the program; `on_poll(mark)` hears of each poll that
    /// follows, and of the end.
    constructor(bytes, read_text, on_poll) {
        if (bytes.byteLength % 4 !== 0) throw new Error('the recording was cut');
        this.words = new Uint32Array(
            bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength),
        );
        if (this.words[0] !== magic) throw new Error('this is no recording of the core');
        this.read_text = read_text;
        this.on_poll = on_poll;
        this.texts = new Map();
        this.calls = 0;
        this.polls = 0;
        this.first = this.next = this.read_names();
        this.results_end = this.result_at = this.next;
        this.name = '';
        this.arguments = [];
    }

    read_names() {
        let at = 2;
        this.names = Array.from({ length: this.words[1] }, () => {
            const size = this.words[at];
            const begin = (at + 1) * 4;
            at += 1 + Math.ceil(size / 4);
            return Buffer.from(this.words.buffer).toString('latin1', begin, begin + size);
        });
        return at;
    }

    write(offset, value) {
        if (offset === 4) this.arguments.push(value);
        else if (offset === 8) this.check_call();
        else this.begin_call(value);
    }

    read() {
        if (this.result_at >= this.results_end)
            this.fail(`${this.name} asks for more than it returned`);
        const word = this.words[this.result_at++];
        if (this.name === poll_name) {
            this.polls += word & 1;
            this.on_poll(word);
        }
        return word;
    }

    begin_call(address) {
        if (this.result_at !== this.results_end)
            this.fail(`${this.name} returned more than was asked for`);
        if (!this.texts.has(address)) this.texts.set(address, this.read_text(address));
        this.name = this.texts.get(address);
        this.arguments.length = 0;
        ++this.calls;
    }

    /// The recorded call at `at`, and where the next one begins.
    call_at(at) {
        const results = at + 2 + this.words[at + 1];
        return {
            name: this.names[this.words[at]] ?? 'no call',
            words: this.words.subarray(at + 2, results),
            results: results + 1,
            next: results + 1 + this.words[results],
        };
    }

    check_call() {
        if (this.next >= this.words.length) this.fail(`${this.name} follows the recording's end`);
        const recorded = this.call_at(this.next);
        if (!(recorded.next <= this.words.length)) this.fail('the recording was cut');
        const same =
            recorded.name === this.name &&
            recorded.words.length === this.arguments.length &&
            recorded.words.every((word, index) => word === this.arguments[index]);
        if (!same)
            this.fail(
                `recorded: ${show(recorded.name, recorded.words)}\n` +
                    `replayed: ${show(this.name, this.arguments)}`,
            );
        this.result_at = recorded.results;
        this.results_end = this.next = recorded.next;
    }

    fail(what) {
        const before = [];
        for (let at = this.first; at < this.next; at = this.call_at(at).next) before.push(at);
        const context = before.slice(-shown_before).map((at) => {
            const { name, words } = this.call_at(at);
            return `  before: ${show(name, words)}`;
        });
        throw new Error(
            [`call ${this.calls}, of poll ${this.polls}, differs`, ...context, what].join('\n'),
        );
    }
}
