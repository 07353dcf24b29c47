/* SPDX-License-Identifier: BSD-3-Clause */
/* Reading the streams of VersaVIS from C, and from any language that can call C.
 *
 * Link with -lversavis. Nothing here allocates per item, and nothing writes to what the service
 * publishes.
 *
 * Threads: a versavis_stream, versavis_sets or versavis_wait_set is used by one thread at a time;
 * different ones by different threads. Items may be used, and released, by any thread.
 *
 * After fork(), the child uses and closes only what it opened itself.
 *
 * Results: functions return VERSAVIS_OK or say why not. What is positive is no error but part of
 * life: call again, and the stream goes on. What is negative needs somebody to act; versavis_error
 * has a sentence that says what to do.
 *
 * Structures that may grow begin with their size: begin each with its VERSAVIS_..._INIT. A library
 * fills in what both it and the program's header know. The others never change.
 *
 * Durations are nanoseconds. Docs of all fields: docs/contracts/shm-layout.md.
 */
#ifndef VERSAVIS_H
#define VERSAVIS_H

/* NOLINTBEGIN: C has names of its own */
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define VERSAVIS_EXPORT __attribute__((visibility("default")))

typedef enum versavis_result {
    VERSAVIS_OK = 0,
    VERSAVIS_NOTHING = 1,   /* nothing new in the time given */
    VERSAVIS_LOST = 2,      /* items were overwritten before they were read: item->lost */
    VERSAVIS_RESTARTED = 3, /* the service was restarted; its first item comes next */
    VERSAVIS_GONE = 4,      /* the service has stopped or died; there is no new one yet */
    VERSAVIS_OVERTAKEN = 5, /* the writer needed the memory: what was read or copied is void */
    VERSAVIS_ERROR = -1,    /* see versavis_error */
    VERSAVIS_INVALID = -2, /* an argument is NULL, out of range, without size, of another kind */
    VERSAVIS_NO_MEMORY = -3,   /* no memory left */
    VERSAVIS_ABSENT = -4,      /* there is no such stream: not yet, or not any more */
    VERSAVIS_FORBIDDEN = -5,   /* no permission */
    VERSAVIS_NOT_TRUSTED = -6, /* the stream belongs to, or can be changed by, somebody else */
    VERSAVIS_WRONG_KIND = -7,  /* a stream of another kind */
    VERSAVIS_UNSUPPORTED = -8, /* a ring of a layout that this library does not know */
    VERSAVIS_DAMAGED = -9,     /* no ring, or a damaged one */
    VERSAVIS_EXHAUSTED = -10,  /* no descriptor or thread available */
    VERSAVIS_OTHER_EPOCH = -11 /* times of two epochs, or of none, do not compare */
} versavis_result;

typedef enum versavis_kind {
    VERSAVIS_FRAMES = 1,
    VERSAVIS_IMU = 2,
    VERSAVIS_EVENTS = 3,
    VERSAVIS_STATUS = 4,
    VERSAVIS_EVIDENCE = 5,
    VERSAVIS_CLOCK = 6,
    VERSAVIS_NMEA = 7
} versavis_kind;

/* A place in a stream: where reading begins, or goes on after items were lost. */
typedef enum versavis_position {
    VERSAVIS_DEFAULT = 0, /* next to begin with; after a loss, half a ring back */
    VERSAVIS_NEXT = 1,    /* the item that will be published next */
    VERSAVIS_LATEST = 2,  /* the newest there is */
    VERSAVIS_MIDDLE = 3,  /* half a ring back */
    VERSAVIS_OLDEST = 4   /* the oldest that is not about to be overwritten */
} versavis_position;

enum { /* bits of flags */
    VERSAVIS_STAMP_KIND = 0x3, /* 0 measured middle, 1 predicted, 2 trigger edge, 3 arrival */
    VERSAVIS_SUSPECT = 1 << 2,
    VERSAVIS_HOLDOVER = 1 << 3,
    VERSAVIS_CLAMPED = 1 << 4,
    VERSAVIS_SENSOR_ERROR = 1 << 5,
    VERSAVIS_REPEATED = 1 << 6,
    VERSAVIS_ACCEL_AGE = 1 << 7,
    VERSAVIS_CAMERA_LENGTH = 1 << 8,
    VERSAVIS_SECOND_DOUBTED = 1 << 9,
    VERSAVIS_BY_PTP = 1 << 10 /* of a stamp of kind 3: not the arrival, but the exposure by the
                               * camera's own clock, which follows PTP */
};

#define VERSAVIS_SIGMA_UNKNOWN 0xFFFFFFFFu
#define VERSAVIS_ANY_OWNER (-1LL)
#define VERSAVIS_NO_EPOCH 0xFFFFFFFFu

#ifdef __cplusplus
#define VERSAVIS_ZEROS {}
#define VERSAVIS_ZERO_UNION {}
#else
#define VERSAVIS_ZEROS {0}
#define VERSAVIS_ZERO_UNION {{0}}
#endif

typedef struct versavis_stream versavis_stream;
typedef struct versavis_wait_set versavis_wait_set;
typedef struct versavis_sets versavis_sets;

typedef struct versavis_error {
    char message[512]; /* what is wrong, where, and what to do */
} versavis_error;

/* An instant of the output time, with what it belongs to. Times of two epochs do not compare: in
 * between, a clock was set, or the service restarted. versavis_time_difference looks first. */
typedef struct versavis_time {
    uint64_t life; /* of the service */
    int64_t ns;
    uint32_t epoch; /* VERSAVIS_NO_EPOCH: of none, as that of a status document */
    uint32_t reserved;
} versavis_time;

typedef struct versavis_options {
    uint32_t size;
    uint32_t start;       /* versavis_position */
    uint32_t after_loss;  /* versavis_position */
    uint32_t sealed_only; /* 1: only streams that nobody can cut short */
    int64_t owner;        /* user id that the streams must belong to; -1: root, you, 'versavis' */
    int64_t wait;         /* how long opening waits for streams that are not there yet */
} versavis_options;
#define VERSAVIS_OPTIONS_INIT \
    {sizeof(versavis_options), 0, 0, 0, VERSAVIS_ANY_OWNER, 0}

typedef struct versavis_frame {
    uint64_t trigger;
    uint64_t block_id;
    int64_t board_time;
    int64_t host_time;
    int64_t arrival;
    int64_t exposure;
    int64_t camera_time;
    uint32_t sigma;
    uint32_t width;
    uint32_t height;
    uint32_t stride;
    uint32_t pixel_format;
    uint32_t epoch;
    uint32_t flags;
    uint32_t tick_low;
    int32_t delay;
    uint32_t tick_high;
} versavis_frame;

typedef struct versavis_imu {
    int64_t board_time;
    int64_t host_time;
    uint64_t number;
    float gyro[3];
    float accel[3];
    float magnetic[3];
    float temperature;
    float pressure;
    uint32_t sigma;
    uint32_t epoch;
    uint32_t flags;
    int64_t filter_delay;
    int32_t accel_age;
    uint32_t reserved;
} versavis_imu;

typedef struct versavis_event {
    uint32_t kind;
    uint32_t source;
    uint32_t reason;
    uint32_t flags;
    int64_t value;
    int64_t board_time;
    int64_t host_time;
    uint32_t sigma;
    uint32_t epoch;
    char source_name[32];
    int64_t expected;
    uint32_t count;
    uint32_t reserved;
} versavis_event;

/* A line of a GNSS receiver; its text is the payload, which no zero ends. */
typedef struct versavis_nmea {
    int64_t board_time;
    int64_t host_time;
    uint64_t number;
    uint32_t sigma;
    uint32_t epoch;
    uint32_t flags; /* VERSAVIS_SENSOR_ERROR: its checksum is wrong, or there is none */
    uint32_t reserved[15];
} versavis_nmea;

/* An item in place. Begin with VERSAVIS_ITEM_INIT; end with versavis_release. Until then its memory
 * stays mapped, whatever becomes of stream and service. Do not copy it. */
typedef struct versavis_item {
    uint32_t size;
    uint32_t kind;   /* versavis_kind: which of data holds */
    uint64_t number; /* since the stream was made */
    uint64_t lost;   /* with VERSAVIS_LOST: how many */
    versavis_time time;
    uint32_t stale; /* 1: its writer was dead, or had closed the stream, when it was read */
    uint32_t reserved;
    union {
        versavis_frame frame;
        versavis_imu imu;
        versavis_event event;
        versavis_nmea nmea;
        uint64_t words[12];
    } data;
    const void *payload; /* what is read of it is good if versavis_valid says so afterwards */
    size_t payload_size;
    uint64_t held[6]; /* of the library */
} versavis_item;
#define VERSAVIS_ITEM_INIT                                                               \
    {sizeof(versavis_item), 0,    0, 0,             VERSAVIS_ZEROS, 0, 0,                \
     VERSAVIS_ZERO_UNION,   NULL, 0, VERSAVIS_ZEROS}

typedef struct versavis_image {
    uint32_t size;
    uint32_t width;
    uint32_t height;
    uint32_t stride;
    uint32_t pixel_format;
    uint32_t channels;          /* 0: samples are packed across bytes */
    uint32_t bytes_per_channel; /* 1 or 2 */
    uint32_t reserved;
    const uint8_t *data; /* row y begins at data + y * stride */
} versavis_image;
#define VERSAVIS_IMAGE_INIT \
    {sizeof(versavis_image), 0, 0, 0, 0, 0, 0, 0, NULL}

/* How the sensor was when it took a frame, by the camera's own account; NaN: not known. */
typedef struct versavis_sensor_state {
    uint32_t size;
    float gain;        /* dB, or the unit of the camera */
    float temperature; /* degree Celsius */
} versavis_sensor_state;
#define VERSAVIS_SENSOR_STATE_INIT \
    {sizeof(versavis_sensor_state), 0, 0}

VERSAVIS_EXPORT const char *versavis_version(void);

/* One sentence about a result. */
VERSAVIS_EXPORT const char *versavis_result_text(int result);

/* The span from earlier to later, negative where they are the other way round. Else
 * VERSAVIS_OTHER_EPOCH. */
VERSAVIS_EXPORT int versavis_time_difference(const versavis_time *later,
                                             const versavis_time *earlier, int64_t *ns);

/* ---- Which streams there are --------------------------------------------------------------- */

typedef struct versavis_stream_info {
    uint32_t size;
    uint32_t kind; /* versavis_kind; 0: it cannot be opened */
    const char *name;
    uint64_t published; /* items since it was made */
    uint64_t retained;  /* how many can be read at any one time, at most */
    int32_t alive;      /* 1: its writer is */
    int32_t error;      /* versavis_result: why it cannot be opened */
    const char *why;    /* and in a sentence; else "" */
} versavis_stream_info;

/* Calls visit with each stream, by name, until it returns another value than 0, which is then
 * returned. Infos are the library's, and last as long as the call. */
VERSAVIS_EXPORT int versavis_list(const char *instance, const versavis_options *options,
                                  int (*visit)(const versavis_stream_info *info, void *context),
                                  void *context, versavis_error *error);

/* ---- One stream -------------------------------------------------------------------------- */

/* instance NULL: $VERSAVIS_INSTANCE, or "default". options and error may be NULL. */
VERSAVIS_EXPORT int versavis_open(const char *instance, const char *stream,
                                  const versavis_options *options, versavis_stream **opened,
                                  versavis_error *error);
VERSAVIS_EXPORT void versavis_close(versavis_stream *stream); /* NULL does nothing */

VERSAVIS_EXPORT int versavis_stream_kind(const versavis_stream *stream);
VERSAVIS_EXPORT const char *versavis_stream_name(const versavis_stream *stream);

/* The next item, waiting for it up to timeout (0 or less: not at all). What the item held is
 * released. */
VERSAVIS_EXPORT int versavis_next(versavis_stream *stream, versavis_item *item, int64_t timeout);

/* The newest item, passing over older ones; if it has been read already, the next one. */
VERSAVIS_EXPORT int versavis_latest(versavis_stream *stream, versavis_item *item, int64_t timeout);

/* position: a versavis_position. */
VERSAVIS_EXPORT int versavis_seek(versavis_stream *stream, uint32_t position);

/* To the oldest item from which on none is before time. VERSAVIS_OTHER_EPOCH: it is of another life
 * or of no epoch, as are the items of a status stream; the stream stays where it is. */
VERSAVIS_EXPORT int versavis_seek_time(versavis_stream *stream, const versavis_time *time);

/* For poll and epoll, the stream's own: readable when versavis_next may find something, until it
 * returns VERSAVIS_NOTHING or VERSAVIS_GONE. Negative: an error. */
VERSAVIS_EXPORT int versavis_fd(versavis_stream *stream, versavis_error *error);

/* 1 while the writer has not touched the payload: what was read of it before is good. Else 0. */
VERSAVIS_EXPORT int versavis_valid(const versavis_item *item);

/* Copies the payload; VERSAVIS_OVERTAKEN when the copy is void, VERSAVIS_INVALID when size is
 * less than payload_size. */
VERSAVIS_EXPORT int versavis_copy(const versavis_item *item, void *to, size_t size);

VERSAVIS_EXPORT void versavis_release(versavis_item *item);

/* The pixels of a frame. VERSAVIS_INVALID: no frame, or fewer bytes than its numbers claim. */
VERSAVIS_EXPORT int versavis_view(const versavis_item *item, versavis_image *image);

/* VERSAVIS_INVALID: no frame. VERSAVIS_OVERTAKEN: the writer needed the memory. */
VERSAVIS_EXPORT int versavis_sensor(const versavis_item *item, versavis_sensor_state *state);

/* As "Mono8"; "unknown" for others. */
VERSAVIS_EXPORT const char *versavis_pixel_format_name(uint32_t pixel_format);
VERSAVIS_EXPORT const char *versavis_event_name(uint32_t kind);
VERSAVIS_EXPORT const char *versavis_reason_name(uint32_t reason);

/* ---- Several streams --------------------------------------------------------------------- */

/* NULL: no memory. */
VERSAVIS_EXPORT versavis_wait_set *versavis_wait_set_new(void);
VERSAVIS_EXPORT void versavis_wait_set_free(versavis_wait_set *set);

/* The stream must not be closed before the set is freed. */
VERSAVIS_EXPORT int versavis_wait_set_add(versavis_wait_set *set, versavis_stream *stream,
                                          versavis_error *error);

/* Sleeps until versavis_next of one of the streams has something to return: which one, in the order
 * in which they were added. VERSAVIS_NOTHING: none within timeout. */
VERSAVIS_EXPORT int versavis_wait_set_wait(versavis_wait_set *set, int64_t timeout,
                                           uint32_t *which);

/* Readable when versavis_wait_set_wait may find something, until it returns VERSAVIS_NOTHING. */
VERSAVIS_EXPORT int versavis_wait_set_fd(versavis_wait_set *set, versavis_error *error);

typedef struct versavis_imu_sample {
    versavis_time time;
    versavis_imu data;
} versavis_imu_sample;

/* ---- IMU samples between two instants ----------------------------------------------------- */

typedef struct versavis_imu_window versavis_imu_window;

/* Why samples do not reach from the first instant to the second. */
typedef enum versavis_span_gap {
    VERSAVIS_SPAN_COVERED = 0,
    VERSAVIS_SPAN_BEGIN = 1,   /* no sample at or before the first instant is known */
    VERSAVIS_SPAN_END = 2,     /* no sample of the second instant or later has come yet */
    VERSAVIS_SPAN_EPOCH = 3,   /* the epoch began or ended within: times beyond do not compare */
    VERSAVIS_SPAN_NUMBERS = 4, /* numbers stand still or go back: how many are lost is unknown */
} versavis_span_gap;

typedef struct versavis_imu_span {
    uint32_t size;
    uint32_t gap;                       /* a versavis_span_gap */
    const versavis_imu_sample *samples; /* until the next call or close */
    size_t count;
    uint64_t lost;                     /* samples missing within them */
    const versavis_imu_sample *beyond; /* the first one after the second instant; NULL: none yet */
} versavis_imu_span;
#define VERSAVIS_IMU_SPAN_INIT \
    {sizeof(versavis_imu_span), 0, NULL, 0, 0, NULL}

/* Begins with what the ring still holds, whatever options say of the start. */
VERSAVIS_EXPORT int versavis_imu_window_open(const char *instance, const char *stream,
                                             const versavis_options *options,
                                             versavis_imu_window **opened, versavis_error *error);
VERSAVIS_EXPORT void versavis_imu_window_close(versavis_imu_window *window);

/* Samples with after < time <= upto. Waits up to patience until one of upto or later has come, or
 * of a later epoch. Spans may follow each other or overlap. VERSAVIS_RESTARTED, once: times before
 * and after do not compare. VERSAVIS_OTHER_EPOCH: after and upto do not. */
VERSAVIS_EXPORT int versavis_imu_window_span(versavis_imu_window *window,
                                             const versavis_time *after, const versavis_time *upto,
                                             int64_t patience, versavis_imu_span *span);

/* Readable when samples may have come, until versavis_imu_window_span has looked. */
VERSAVIS_EXPORT int versavis_imu_window_fd(versavis_imu_window *window, versavis_error *error);

/* ---- Sets of frames ---------------------------------------------------------------------- */

enum { VERSAVIS_MOST_CAMERAS = 16 };

typedef struct versavis_sets_options {
    uint32_t size;
    uint32_t partial; /* 1: sets that lack a frame, too; cameras may appear later */
    uint32_t suspect; /* 1: frames whose pairing is not proved count, too */
    uint32_t reserved;
    const char *imu;                 /* name of its stream, as a camera's; NULL: none */
    int64_t patience;                /* from a set's first frame until it is given up; 0: 200 ms */
    const versavis_options *streams; /* NULL: the defaults */
} versavis_sets_options;
#define VERSAVIS_SETS_OPTIONS_INIT \
    {sizeof(versavis_sets_options), 0, 0, 0, NULL, 0, NULL}

/* Begin with VERSAVIS_SET_INIT; end with versavis_set_release. Do not copy it. */
typedef struct versavis_set {
    uint32_t size;
    uint32_t present; /* bit i: the frame of camera i is there, in the order of their names */
    uint64_t tick;
    versavis_time time;             /* of the first camera that is there */
    int64_t spread;                 /* latest less earliest stamp */
    const versavis_imu_sample *imu; /* since the set before; until the set is released */
    size_t imu_count;
    uint64_t imu_lost; /* samples missing within them */
    uint32_t imu_gap;  /* a versavis_span_gap: why they do not reach from the set before to here */
    uint32_t reserved;
    void *held; /* of the library */
} versavis_set;
#define VERSAVIS_SET_INIT \
    {sizeof(versavis_set), 0, 0, VERSAVIS_ZEROS, 0, NULL, 0, 0, 0, 0, NULL}

/* What became of frames that are in no set. */
typedef struct versavis_set_report {
    uint32_t size;
    uint32_t reserved;
    uint64_t sets;       /* delivered */
    uint64_t incomplete; /* sets that lacked a frame, delivered or not */
    uint64_t left_out;   /* frames without a tick, suspect, of another life, or of a set given up */
    uint64_t lost;       /* frames overwritten before they were read */
    uint64_t skipped;    /* sets that versavis_sets_latest passed over */
} versavis_set_report;
#define VERSAVIS_SET_REPORT_INIT \
    {sizeof(versavis_set_report), 0, 0, 0, 0, 0, 0}

/* Cameras of another instance on the same grid as "rear/cam0": frames are of one set that lie within
 * 0.5 ms of each other in host time. */
VERSAVIS_EXPORT int versavis_sets_open(const char *instance, const char *const *cameras,
                                       size_t count, const versavis_sets_options *options,
                                       versavis_sets **opened, versavis_error *error);
VERSAVIS_EXPORT void versavis_sets_close(versavis_sets *sets);

/* The next set, in the order of ticks. What the set held is released. */
VERSAVIS_EXPORT int versavis_sets_next(versavis_sets *sets, versavis_set *set, int64_t timeout);

/* The newest set, passing over older ones; if there is none, the next. */
VERSAVIS_EXPORT int versavis_sets_latest(versavis_sets *sets, versavis_set *set, int64_t timeout);

VERSAVIS_EXPORT int versavis_sets_report(const versavis_sets *sets, versavis_set_report *report);
VERSAVIS_EXPORT int versavis_sets_fd(versavis_sets *sets, versavis_error *error);

/* The frame of one camera, to be released by itself. VERSAVIS_NOTHING: it is missing. */
VERSAVIS_EXPORT int versavis_set_frame(const versavis_set *set, uint32_t camera,
                                       versavis_item *item);

/* 1 while the writer has touched no payload: what was read of them before is good. Else 0. */
VERSAVIS_EXPORT int versavis_set_valid(const versavis_set *set);

VERSAVIS_EXPORT void versavis_set_release(versavis_set *set);

#ifdef __cplusplus
}
#endif

/* NOLINTEND */
#endif /* VERSAVIS_H */
