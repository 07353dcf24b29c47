// SPDX-License-Identifier: BSD-3-Clause
// An ICM-42688-P at the chip's SPI or I2C: its registers, and its data-ready line on time of its
// own.
const registers = { device_config: 0x11, status: 0x2d, who_am_i: 0x75, data: 0x1d };
const identity = 0x47;
const i2c_address = 0x68;

export class Icm42688p {
    /// Data is ready every `period` cycles, which the GPIO `ready` shows for `pulse` cycles. On SPI
    /// the GPIO `select` selects it; without one, it is on I2C.
    constructor(machine, { select, ready, period, pulse = 12_500 }) {
        Object.assign(this, { machine, ready, period, pulse });
        this.bytes = new Uint8Array(128);
        this.bytes[registers.who_am_i] = identity;
        this.position = 0;
        this.edges = []; // cycles of data-ready
        this.begins = []; // cycles at which bursts of data began
        this.samples = 0;
        machine.set_input(ready, 0, 0);
        if (select === undefined) machine.i2c[1].attach(i2c_address, this);
        else machine.spi[0].attach({ gpio: select, device: this });
    }

    /// Data-ready edges from here on, up to a cycle.
    run(from, to) {
        for (let cycle = from; cycle < to; cycle += this.period) {
            this.edges.push(cycle);
            this.machine.set_input(this.ready, 1, cycle);
            this.machine.set_input(this.ready, 0, cycle + this.pulse);
        }
    }

    // SPI

    select(is_selected) {
        if (is_selected) this.position = 0;
    }

    exchange(word, { begin }) {
        if (this.position++ === 0) {
            this.reads = (word & 0x80) !== 0;
            this.address = word & 0x7f;
            if (this.reads) this.begin_reading(begin);
            return 0xff;
        }
        if (this.reads) return this.read();
        this.put(word);
        return 0xff;
    }

    // I2C

    start(is_read, cycle) {
        if (is_read) this.begin_reading(cycle);
        else this.position = 0;
        return true;
    }

    write(byte) {
        if (this.position++ === 0) this.address = byte & 0x7f;
        else this.put(byte);
        return true;
    }

    read() {
        return this.bytes[this.address++ & 0x7f];
    }

    // Both

    put(byte) {
        this.bytes[this.address++ & 0x7f] = byte;
    }

    begin_reading(cycle) {
        if (this.address !== registers.data) return;
        this.begins.push(cycle);
        this.take_sample();
    }

    take_sample() {
        const number = ++this.samples;
        for (let i = 0; i < 7; ++i) {
            this.bytes[registers.data + 2 * i] = (number >> 8) & 0xff;
            this.bytes[registers.data + 2 * i + 1] = (number + i) & 0xff;
        }
        this.bytes[registers.status] = 0x08;
    }
}
