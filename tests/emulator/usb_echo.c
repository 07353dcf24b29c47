// SPDX-License-Identifier: BSD-3-Clause
// A tiny USB serial line for the test of the emulated controller and host: sends each packet back
// with 1 added to its bytes, and toggles GPIO 25 each millisecond. Clocks are set up by the test.
typedef unsigned u32;
typedef unsigned char u8;

#define REGISTER(address) (*(volatile u32*)(address))
#define MEMORY(offset) REGISTER(0x50100000 + (offset))
#define USB(offset) REGISTER(0x50110000 + (offset))
#define USB_CLEAR(offset) REGISTER(0x50113000 + (offset))

enum { available = 1 << 10, data1 = 1 << 13, full = 1 << 15 };
enum { in_0 = 1, out_0 = 2, in_2 = 1 << 4, out_2 = 1 << 5 };

static const u8 device[18] = {18, 1, 0, 2, 2, 0, 0, 64, 0x34, 0x12, 0x78, 0x56, 0, 1, 1, 2, 3, 1};
static const u8 configuration[67] = {
    9, 2,    67,   0,    2,  1,    0,    0x80, 50,     // two interfaces
    9, 4,    0,    0,    1,  2,    2,    0,    0,      // CDC control
    5, 0x24, 0,    0x10, 1,  5,    0x24, 1,    0,  1,  // its functions
    4, 0x24, 2,    2,    5,  0x24, 6,    0,    1,      //
    7, 5,    0x81, 3,    8,  0,    10,                 // notifications
    9, 4,    1,    0,    2,  10,   0,    0,    0,      // CDC data
    7, 5,    0x02, 2,    64, 0,    0,    7,    5,  0x82, 2, 64, 0, 0};

static volatile u8* bytes_at(u32 offset) { return (volatile u8*)(0x50100000 + offset); }

static const u8* reply;
static u32 reply_size, reply_pid, in_pid, out_pid;
static int new_address = -1, reads_reply, takes_data;

static void hand_over(u32 offset, u32 word) {
    MEMORY(offset) = word;
    for (int i = 0; i < 6; ++i) __asm__ volatile("nop\nnop");
    MEMORY(offset) = word | available;
}

static void send_reply(void) {
    u32 size = reply_size > 64 ? 64 : reply_size;
    for (u32 i = 0; i < size; ++i) bytes_at(0x100)[i] = reply[i];
    reply += size;
    reply_size -= size;
    hand_over(0x80, size | full | reply_pid);
    reply_pid ^= data1;
}

static void answer(const u8* bytes, u32 size, u32 wanted) {
    reply = bytes;
    reply_size = size < wanted ? size : wanted;
    reply_pid = data1;
    reads_reply = wanted != 0;
    send_reply();
}

static void take_packet(void) {
    hand_over(0x94, 64 | out_pid);
    out_pid ^= data1;
}

static void configure(void) {
    in_pid = out_pid = 0;
    MEMORY(0x08) = 0xac000180;
    MEMORY(0x14) = 0xa80001c0;
    MEMORY(0x10) = 0xa8000200;
    take_packet();
}

static u8 text[8] = {8, 3, 0, 0, 'b', 0, 'c', 0};
static const u8 languages[4] = {4, 3, 9, 4};

static void describe(u32 kind, u32 index, u32 wanted) {
    if (kind == 1) return answer(device, sizeof device, wanted);
    if (kind == 2) return answer(configuration, sizeof configuration, wanted);
    if (index == 0) return answer(languages, sizeof languages, wanted);
    text[2] = (u8)('a' + index);
    answer(text, sizeof text, wanted);
}

static void handle_setup(void) {
    volatile u8* setup = bytes_at(0);
    u8 request = setup[1];
    if (request == 6) return describe(setup[3], setup[2], setup[6] | setup[7] << 8);
    if (request == 5) new_address = setup[2];
    if (request == 9) configure();
    if (request != 0x20) return answer(0, 0, 0);
    takes_data = 1;
    hand_over(0x84, 64 | data1);
}

static void echo(void) {
    u32 size = MEMORY(0x94) & 0x3ff;
    for (u32 i = 0; i < size; ++i) bytes_at(0x200)[i] = (u8)(bytes_at(0x1c0)[i] + 1);
    hand_over(0x90, size | full | in_pid);
    in_pid ^= data1;
}

static void handle_buffers(u32 done) {
    if (done & in_0) {
        if (new_address >= 0) USB(0) = (u32)new_address;
        new_address = -1;
        if (reply_size != 0)
            send_reply();
        else if (reads_reply) {
            reads_reply = 0;
            hand_over(0x84, 64 | data1);
        }
    }
    if ((done & out_0) && takes_data) {
        takes_data = 0;
        answer(0, 0, 0);
    }
    if (done & out_2) echo();
    if (done & in_2) take_packet();
}

void on_usb(void) {
    u32 causes = USB(0x98);
    if (causes & 1 << 12) {
        USB_CLEAR(0x50) = 1 << 19;
        USB(0) = 0;
    }
    if (causes & 1 << 16) {
        USB_CLEAR(0x50) = 1 << 17;
        handle_setup();
    }
    if (causes & 1 << 4) {
        u32 done = USB(0x58);
        USB_CLEAR(0x58) = done;
        handle_buffers(done);
    }
}

void on_alarm(void) {
    REGISTER(0x40054034) = 1;
    REGISTER(0x40054010) = REGISTER(0x40054010) + 1000;
    REGISTER(0xd000001c) = 1 << 25;
}

void start(void) {
    REGISTER(0x400140cc) = 5;
    REGISTER(0xd0000024) = 1 << 25;
    REGISTER(0x40054038) = 1;
    REGISTER(0x40054010) = REGISTER(0x40054028) + 1000;
    for (u32 i = 0; i < 64; ++i) MEMORY(4 * i) = 0;
    USB(0x74) = 9;
    USB(0x78) = 0xc;
    USB(0x40) = 1;
    USB(0x4c) = 1 << 29;
    USB(0x90) = 1 << 12 | 1 << 16 | 1 << 4;
    REGISTER(0xe000e100) = 1 << 5 | 1;
    USB(0x4c) = 1 << 29 | 1 << 16;
    for (;;) __asm__ volatile("wfi");
}

__attribute__((section(".vectors"), used)) const void* const vectors[22] = {
    (void*)0x20040000, (void*)start, [16] = (void*)on_alarm, [21] = (void*)on_usb};
