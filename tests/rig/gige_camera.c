/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon-fake-gige: a GigE Vision camera on a loopback address, made of Aravis' fake camera (its
 * registers and GenICam file) and control and stream sockets of our own, which can do what Aravis'
 * cannot: send packets again when asked, lose them, serve files, and lie. With --stock it is
 * Aravis' own camera. GVCP and GVSP: GigE Vision 2.0, sections 16 and 24.
 */
#include <arpa/inet.h>
#include <errno.h>
#include <glob.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include <arv.h>

#include "common/clock.h"
#include "common/image_file.h"
#include "tests/random.h"
#include "tests/rig/gige_genicam.h"
#include "tests/rig/gige_options.h"
#include "tests/rig/gige_picture.h"
#include "tests/rig/sensor.h"

#define GVCP_PORT 3956
/** Bootstrap registers (GigE Vision 2.0, 28). */
#define REG_VERSION 0x0000
#define REG_ADDRESS 0x0024
#define REG_DESCRIPTION 0x0200
#define URL_BYTES 512
#define REG_CAPABILITY 0x0934
#define REG_HEARTBEAT_MS 0x0938
#define REG_CONTROL 0x0a00
#define REG_STREAM_PORT 0x0d00
#define REG_PACKET_SIZE 0x0d04
#define REG_STREAM_ADDRESS 0x0d18
#define CAN_RESEND (1u << 2)
#define CAN_WRITE (1u << 1)
/** GVSP data packet: IP, UDP and GVSP headers. */
#define OVERHEAD 36
/** Frames kept for sending again. */
#define N_KEPT 8
#define MAX_FILES 4096
/** Commands that are answered before the next picture is sent. */
#define MAX_COMMANDS 64
/** Some faults begin after so many frames. */
#define N_FAULTLESS 20
#define DIM_US 600000
#define LONG_US 10000000

/** A frame that was sent and may be asked for again. */
struct frame {
    uint16_t id;
    uint32_t format, width, height;
    uint64_t time_ns;
    size_t n_bytes, n_sent; // of the picture; what of it is ever sent
    size_t chunk;           // of it in a packet
    bool has_chunks;        // a stamp follows the picture
    uint8_t *data;
};

struct camera {
    ArvFakeCamera *fake;
    enum fault fault;
    double loss, step_s, delay_ms, noise, trigger_ms;
    size_t max_packet;
    bool can_resend, has_chunks;
    int n_files;
    struct gn_image16 *files;
    struct gn_rig_curve response; // NONE: the files are codes
    struct gn_image16 exposed;    // what the response makes of a file
    uint32_t exposure_us[2];      // of the next picture, and of the one after
    uint64_t random;
    int control, stream; // sockets
    struct sockaddr_in to;
    struct sockaddr_in controller; // port 0: nobody
    int64_t heard_ns;              // of the controller
    int64_t looked_ns;             // when its heartbeat was last looked for
    bool is_streaming;
    int64_t next_ns, begin_ns;
    uint64_t n_frames;
    struct frame kept[N_KEPT];
    unsigned long n_packets, n_dropped, n_asked, n_resent;
};

static atomic_bool is_ending; // atomic: set by the signal handler

static void on_signal(int number)
{
    (void)number;
    atomic_store(&is_ending, true);
}

static void put16(uint8_t *out, unsigned value)
{
    out[0] = (uint8_t)(value >> 8);
    out[1] = (uint8_t)value;
}

static void put32(uint8_t *out, uint32_t value)
{
    put16(out, value >> 16);
    put16(out + 2, value & 0xffff);
}

static uint32_t get32(const uint8_t *in)
{
    return (uint32_t)in[0] << 24 | (uint32_t)in[1] << 16 | (uint32_t)in[2] << 8 | in[3];
}

static uint32_t read_register(const struct camera *c, uint32_t address)
{
    uint32_t value = 0;
    arv_fake_camera_read_register(c->fake, address, &value);
    return value;
}

/** Sends a leader (0), a block, or the trailer (blocks + 1) of a frame. */
static void send_packet(struct camera *c, const struct frame *f, uint32_t packet, bool is_resent)
{
    uint8_t bytes[65536] = {0};
    uint32_t n_blocks = (uint32_t)((f->n_bytes + f->chunk - 1) / f->chunk);
    size_t n = 8;
    put16(bytes, is_resent ? 0x0100 : 0); // status: GEV_STATUS_PACKET_RESEND
    put16(bytes + 2, f->id);
    if (packet == 0) {
        put32(bytes + 4, 1u << 24);
        put16(bytes + 10, f->has_chunks ? 0x4001 : 1); // payload type: image, and chunks
        put32(bytes + 12, (uint32_t)(f->time_ns >> 32));
        put32(bytes + 16, (uint32_t)f->time_ns);
        put32(bytes + 20, f->format);
        put32(bytes + 24, f->width);
        put32(bytes + 28, f->height);
        n = 44;
    } else if (packet <= n_blocks) {
        size_t at = (size_t)(packet - 1) * f->chunk;
        size_t length = f->n_bytes - at < f->chunk ? f->n_bytes - at : f->chunk;
        if (at >= f->n_sent)
            return;
        put32(bytes + 4, 3u << 24 | packet);
        memcpy(bytes + 8, f->data + at, length);
        n = 8 + length;
        if (c->fault == FAULT_OVERLONG &&
            packet == n_blocks) { // of a part, at 0; whole it is small
            put32(bytes + 4, 7u << 24 | packet);
            memset(bytes + 8, 0, 8 + f->chunk);
            n = 8 + f->chunk;
        }
    } else if (packet == n_blocks + 1) {
        put32(bytes + 4, 2u << 24 | packet);
        put32(bytes + 8, 1);
        put32(bytes + 12, f->height);
        n = 16;
    } else {
        return;
    }
    if (n + 28 > c->max_packet || c->fault == FAULT_SILENT)
        return;
    if (!is_resent && drand48() < c->loss) {
        c->n_dropped++;
        return;
    }
    c->n_packets++;
    c->n_resent += is_resent;
    (void)!sendto(c->stream, bytes, n, 0, (const struct sockaddr *)&c->to, sizeof(c->to));
}

static void answer_waiting(struct camera *c, int timeout_ms);

/** The codes of a file's light at the exposure that holds now. */
static const struct gn_image16 *expose(struct camera *c, const struct gn_image16 *light)
{
    struct gn_image16 *out = &c->exposed;
    double scale = c->exposure_us[0] / (65535.0 * ARV_FAKE_CAMERA_EXPOSURE_TIME_US_DEFAULT);
    size_t n = (size_t)light->width * (size_t)light->height * (size_t)light->channels;
    if (out->channels != light->channels) {
        gn_image16_finish(out);
        if (gn_image16_init(out, light->width, light->height, light->channels) < 0)
            return NULL;
    }
    for (size_t i = 0; i < n; i++) {
        double code = gn_rig_encode_curve(&c->response, light->data[i] * scale);
        double noise = c->noise > 0 ? c->noise * gn_test_random_normal(&c->random) : 0;
        out->data[i] = (uint16_t)lround(fmin(fmax(4095 * code + noise, 0), 4095));
    }
    c->exposure_us[0] = c->exposure_us[1];
    c->exposure_us[1] = read_register(c, ARV_FAKE_CAMERA_REGISTER_EXPOSURE_TIME_US);
    return out;
}

/** What follows a picture of n bytes: each chunk's data, its id, its length; the picture's first.
 */
static void put_chunks(uint8_t *out, uint32_t n, uint64_t time_ns, uint32_t exposure_us)
{
    put32(out, 1);
    put32(out + 4, n);
    put32(out + 8, (uint32_t)(time_ns >> 32));
    put32(out + 12, (uint32_t)time_ns);
    put32(out + 16, GN_GIGE_CHUNK_ID);
    put32(out + 20, 8);
    double exposure = exposure_us;
    uint64_t bits;
    memcpy(&bits, &exposure, sizeof(bits));
    put32(out + 24, (uint32_t)(bits >> 32));
    put32(out + 28, (uint32_t)bits);
    put32(out + 32, GN_GIGE_CHUNK_ID_EXPOSURE);
    put32(out + 36, 8);
}

/** Takes the picture and sends it. */
static void send_frame(struct camera *c)
{
    int width = (int)read_register(c, ARV_FAKE_CAMERA_REGISTER_WIDTH);
    int height = (int)read_register(c, ARV_FAKE_CAMERA_REGISTER_HEIGHT);
    uint32_t code = read_register(c, ARV_FAKE_CAMERA_REGISTER_PIXEL_FORMAT);
    const struct gn_pixels_format *format = gn_pixels_find(code);
    size_t n_bytes = format ? gn_pixels_get_bytes(format, width, height) : 0;
    struct frame *f = &c->kept[c->n_frames % N_KEPT];
    // Taken when it was due, by a clock of the camera's own: from another zero, 20 ppm fast.
    uint64_t time_ns = (uint64_t)((double)c->next_ns * 1.00002) + 7;
    bool has_chunks = c->has_chunks && read_register(c, GN_GIGE_REG_CHUNK_MODE) &&
                      read_register(c, GN_GIGE_REG_CHUNK_ENABLE);
    size_t n_extra = has_chunks ? GN_GIGE_CHUNK_BYTES : 0;
    bool is_half =
        c->fault == FAULT_SIZE || (c->fault == FAULT_CHANGE && c->n_frames >= N_FAULTLESS);
    free(f->data);
    *f = (struct frame){.id = (uint16_t)(c->n_frames % 65535 + 1),
                        .format = c->fault == FAULT_FORMAT ? 0x01080002 : code,
                        .width = (uint32_t)width / (is_half ? 2 : 1),
                        .height = (uint32_t)height,
                        .time_ns = c->has_chunks ? 0 : time_ns,
                        .n_bytes = n_bytes + n_extra,
                        .chunk = (read_register(c, REG_PACKET_SIZE) & 0xffff) - OVERHEAD,
                        .has_chunks = has_chunks,
                        .data = calloc(1, n_bytes + n_extra + 1)};
    if (!f->data || n_bytes == 0)
        return;
    double now_s = (double)(gn_clock_get_monotonic_ns() - c->begin_ns) * 1e-9;
    uint64_t k = c->step_s > 0 ? (uint64_t)(now_s / c->step_s) : c->n_frames;
    const struct gn_image16 *picture = c->n_files ? &c->files[k % (uint64_t)c->n_files] : NULL;
    bool has_response = c->response.type != GN_RIG_CURVE_NONE;
    uint32_t exposure_us = has_response
                               ? c->exposure_us[0]
                               : read_register(c, ARV_FAKE_CAMERA_REGISTER_EXPOSURE_TIME_US);
    if (c->fault == FAULT_EXPOSURE && c->n_frames % 2)
        exposure_us = LONG_US;
    if (picture && has_response)
        picture = expose(c, picture);
    gn_gige_pack(format, picture, c->n_frames, width, height, f->data);
    if (has_chunks)
        put_chunks(f->data + n_bytes, (uint32_t)n_bytes, time_ns, exposure_us);
    if (c->fault == FAULT_CODES)
        f->data[n_bytes - 1] = 0xff;
    f->n_sent = c->fault == FAULT_TRUNCATED ? f->n_bytes / 2 : f->n_bytes;
    if (c->delay_ms > 0)
        g_usleep((gulong)(drand48() * c->delay_ms * 1e3));
    uint32_t n_blocks = (uint32_t)((f->n_bytes + f->chunk - 1) / f->chunk);
    bool is_dropped = c->fault == FAULT_DROP && c->n_frames % 5 == 4;
    for (uint32_t i = 0; i <= n_blocks + 1 && !is_dropped; i++) {
        send_packet(c, f, i, false);
        if (i % 64 == 63)
            answer_waiting(c, 0); // a request to send again does not wait for long
    }
    c->n_frames++;
}

/** PACKETRESEND_CMD: blocks first to last of one frame. */
static void send_again(struct camera *c, const uint8_t *command)
{
    uint32_t first = get32(command + 4) & 0xffffff, last = get32(command + 8) & 0xffffff;
    c->n_asked++;
    for (int i = 0; c->can_resend && i < N_KEPT; i++) {
        if (!c->kept[i].data || c->kept[i].id != (command[2] << 8 | command[3]))
            continue;
        for (uint32_t k = first; k <= last && k < first + 4096; k++)
            send_packet(c, &c->kept[i], k, true);
    }
}

static bool is_controller(const struct camera *c, const struct sockaddr_in *from)
{
    return c->controller.sin_port == 0 || (c->controller.sin_port == from->sin_port &&
                                           c->controller.sin_addr.s_addr == from->sin_addr.s_addr);
}

/** The client asked whether packets of this size arrive. */
static void fire_test_packet(const struct camera *c, uint32_t value)
{
    static const uint8_t zeros[65536];
    struct sockaddr_in to = {.sin_family = AF_INET,
                             .sin_port = htons((uint16_t)read_register(c, REG_STREAM_PORT))};
    arv_fake_camera_read_memory(c->fake, REG_STREAM_ADDRESS, 4, &to.sin_addr);
    if ((value & 0xffff) > c->max_packet)
        return;
    (void)!sendto(c->stream, zeros, (value & 0xffff) - 28, 0, (const struct sockaddr *)&to,
                  sizeof(to));
}

static void write_register(struct camera *c, const struct sockaddr_in *from, uint32_t address,
                           uint32_t value)
{
    arv_fake_camera_write_register(c->fake, address, value);
    if (address == REG_CONTROL)
        c->controller = value ? *from : (struct sockaddr_in){0};
    if (address == REG_PACKET_SIZE && value >> 31)
        fire_test_packet(c, value);
}

/** Answers one GVCP command. */
static void answer(struct camera *c, const uint8_t *command, size_t n,
                   const struct sockaddr_in *from)
{
    uint8_t out[1024] = {0};
    const uint8_t *arguments = command + 8;
    size_t n_out = 0;
    unsigned code = (unsigned)command[2] << 8 | command[3], status = 0;
    uint32_t address = n >= 12 ? get32(arguments) : 0;
    bool may_write = is_controller(c, from);
    if (is_controller(c, from))
        c->heard_ns = gn_clock_get_monotonic_ns();
    if (code == 0x0002) { // DISCOVERY
        arv_fake_camera_read_memory(c->fake, 0, 0xf8, out + 8);
        n_out = 0xf8;
    } else if (code == 0x0080 && n >= 12) { // READREG
        put32(out + 8, read_register(c, address));
        n_out = 4;
    } else if (code == 0x0084 && n >= 16) { // READMEM
        uint32_t size = get32(arguments + 4) & 0xffff;
        n_out = 4 + (size > 512 ? 512 : size);
        put32(out + 8, address);
        arv_fake_camera_read_memory(c->fake, address, (uint32_t)n_out - 4, out + 12);
    } else if ((code == 0x0082 || code == 0x0086) && n >= 16) { // WRITEREG, WRITEMEM
        put32(out + 8, code == 0x0082 ? 1 : address);
        n_out = 4;
        if (!may_write)
            status = 0x8006; // access denied
        else if (code == 0x0082)
            write_register(c, from, address, get32(arguments + 4));
        else
            arv_fake_camera_write_memory(c->fake, address, (uint32_t)n - 12, arguments + 4);
    } else if (code == 0x0040 && n >= 20) { // PACKETRESEND: not acknowledged
        send_again(c, arguments);
        return;
    } else {
        return;
    }
    put16(out, status);
    put16(out + 2, code + 1);
    put16(out + 4, (unsigned)n_out);
    memcpy(out + 6, command + 6, 2);
    (void)!sendto(c->control, out, 8 + n_out, 0, (const struct sockaddr *)from, sizeof(*from));
}

/** Answers a command, if one comes in time, and those that wait behind it: a camera that is behind
 * with its pictures must not fall behind with what is lost of them. */
static void answer_waiting(struct camera *c, int timeout_ms)
{
    struct pollfd wait = {.fd = c->control, .events = POLLIN};
    for (int i = 0; i < MAX_COMMANDS && poll(&wait, 1, i ? 0 : timeout_ms) == 1; i++) {
        uint8_t command[2048];
        struct sockaddr_in from = {0};
        socklen_t length = sizeof(from);
        ssize_t n =
            recvfrom(c->control, command, sizeof(command), 0, (struct sockaddr *)&from, &length);
        if (n >= 8 && command[0] == 0x42)
            answer(c, command, (size_t)n, &from);
    }
}

/** Frees a dead controller's hold, and begins or ends the stream. */
static void look_after_stream(struct camera *c)
{
    int64_t now_ns = gn_clock_get_monotonic_ns();
    int64_t heartbeat_ns = read_register(c, REG_HEARTBEAT_MS) * GN_NS_PER_MS;
    if (now_ns - c->looked_ns > GN_NS_PER_S) // where the machine stood still the client did, too
        c->heard_ns += now_ns - c->looked_ns;
    c->looked_ns = now_ns;
    if (c->controller.sin_port && now_ns - c->heard_ns > heartbeat_ns) {
        c->controller = (struct sockaddr_in){0};
        arv_fake_camera_set_control_channel_privilege(c->fake, 0);
    }
    bool is_on = arv_fake_camera_get_acquisition_status(c->fake) && c->controller.sin_port;
    if (is_on && !c->is_streaming) {
        c->to = (struct sockaddr_in){
            .sin_family = AF_INET, .sin_port = htons((uint16_t)read_register(c, REG_STREAM_PORT))};
        arv_fake_camera_read_memory(c->fake, REG_STREAM_ADDRESS, 4, &c->to.sin_addr);
        c->next_ns = now_ns;
    }
    c->is_streaming = is_on;
}

/** From one picture to the next; INT64_MAX: a trigger is waited for that never comes. */
static int64_t get_period_ns(const struct camera *c)
{
    uint32_t us = read_register(c, ARV_FAKE_CAMERA_REGISTER_ACQUISITION_FRAME_PERIOD_US);
    if (read_register(c, ARV_FAKE_CAMERA_REGISTER_TRIGGER_MODE))
        return c->trigger_ms > 0 ? (int64_t)(c->trigger_ms * 1e6) : INT64_MAX;
    if (c->fault == FAULT_DIM && c->n_frames >= N_FAULTLESS) {
        arv_fake_camera_write_register(c->fake, ARV_FAKE_CAMERA_REGISTER_EXPOSURE_TIME_US, DIM_US);
        us = DIM_US;
    }
    return (us ? us : 1) * GN_NS_PER_US;
}

static void run(struct camera *c)
{
    while (!atomic_load(&is_ending)) {
        int64_t left_ns = c->is_streaming ? c->next_ns - gn_clock_get_monotonic_ns() : 0;
        answer_waiting(c, !c->is_streaming ? 20 : left_ns > 0 ? (int)(left_ns / GN_NS_PER_MS) : 0);
        look_after_stream(c);
        if (c->is_streaming && gn_clock_get_monotonic_ns() >= c->next_ns) {
            int64_t period_ns = get_period_ns(c);
            if (period_ns < INT64_MAX)
                send_frame(c);
            else
                period_ns = 20 * GN_NS_PER_MS; // until the triggers are off
            // Where the machine stood still, what was missed is left out, not sent in a burst.
            do {
                c->next_ns += period_ns;
            } while (c->next_ns < gn_clock_get_monotonic_ns());
        }
    }
    printf("%llu frames, %lu packets, %lu lost, %lu requests, %lu sent again\n",
           (unsigned long long)c->n_frames, c->n_packets, c->n_dropped, c->n_asked, c->n_resent);
    printf("set to an exposure of %u us, automatic gain %u\n",
           read_register(c, ARV_FAKE_CAMERA_REGISTER_EXPOSURE_TIME_US),
           read_register(c, ARV_FAKE_CAMERA_REGISTER_GAIN_MODE));
}

/** Reads the pictures to serve; all must have the camera's size. */
static int read_files(struct camera *c, const char *pattern, int width, int height,
                      struct gn_error *error)
{
    glob_t found = {0};
    if (glob(pattern, 0, NULL, &found) != 0 || found.gl_pathc > MAX_FILES)
        return gn_error_set(error, -ENOENT, "--files %s: nothing, or too much", pattern);
    c->files = calloc(found.gl_pathc, sizeof(*c->files));
    int err = c->files ? 0 : -ENOMEM;
    for (size_t i = 0; i < found.gl_pathc && !err; i++) {
        struct gn_image_file file = {0};
        err = gn_image_read_file(found.gl_pathv[i], &file, error);
        if (err)
            break;
        bool is_8 = file.kind == GN_IMAGE_CODES8;
        const struct gn_image16 like = {file.codes8.width, file.codes8.height, file.codes8.channels,
                                        NULL};
        const struct gn_image16 *image = is_8 ? &like : &file.codes16;
        if (file.kind == GN_IMAGE_LINEAR || image->width != width || image->height != height)
            err = gn_error_set(error, -EINVAL, "%s: no PNG of %dx%d", found.gl_pathv[i], width,
                               height);
        else
            err = gn_image16_init(&c->files[i], width, height, image->channels);
        size_t n = (size_t)width * (size_t)height * (size_t)image->channels;
        for (size_t k = 0; k < n && !err; k++)
            c->files[i].data[k] = !is_8 ? file.codes16.data[k]
                                  : c->response.type != GN_RIG_CURVE_NONE
                                      ? (uint16_t)(file.codes8.data[k] * 257)
                                      : (uint16_t)((file.codes8.data[k] * 4095 + 127) / 255);
        gn_image_file_finish(&file);
        c->n_files += !err;
    }
    globfree(&found);
    return err;
}

/** Opens the sockets. */
static int open_sockets(struct camera *c, const char *address, struct gn_error *error)
{
    struct sockaddr_in at = {.sin_family = AF_INET}, any = {.sin_family = AF_INET};
    int one = 1, size = 8 << 20;
    if (inet_pton(AF_INET, address, &at.sin_addr) != 1)
        return gn_error_set(error, -EINVAL, "--address %s: no IPv4 address", address);
    // Discovery is a broadcast, so the first camera listens at all addresses; more do at their own.
    if (at.sin_addr.s_addr != htonl(INADDR_LOOPBACK))
        any.sin_addr = at.sin_addr;
    any.sin_port = htons(GVCP_PORT);
    c->control = socket(AF_INET, SOCK_DGRAM, 0);
    c->stream = socket(AF_INET, SOCK_DGRAM, 0);
    setsockopt(c->control, SOL_SOCKET, SO_REUSEADDR, &one, sizeof(one));
    setsockopt(c->control, SOL_SOCKET, SO_BROADCAST, &one, sizeof(one));
    setsockopt(c->stream, SOL_SOCKET, SO_SNDBUF, &size, sizeof(size));
    if (bind(c->control, (const struct sockaddr *)&any, sizeof(any)) != 0 ||
        bind(c->stream, (const struct sockaddr *)&at, sizeof(at)) != 0)
        return gn_error_set(error, -errno, "cannot bind to %s port %d: %s", address, GVCP_PORT,
                            strerror(errno));
    arv_fake_camera_write_memory(c->fake, REG_ADDRESS, 4, &at.sin_addr);
    return 0;
}

/** Lies of the registers that a client reads first. */
static int set_lies(struct camera *c, const struct gn_options *options, struct gn_error *error)
{
    const char *address = gn_options_get_string(options, NULL, NULL, "said-address");
    const char *url = gn_options_get_string(options, NULL, NULL, "description");
    struct in_addr said;
    char text[URL_BYTES] = "";
    if (address && inet_pton(AF_INET, address, &said) != 1)
        return gn_error_set(error, -EINVAL, "--said-address %s: no IPv4 address", address);
    if (address)
        arv_fake_camera_write_memory(c->fake, REG_ADDRESS, 4, &said);
    if (url) {
        snprintf(text, sizeof(text), "%s", url);
        arv_fake_camera_write_memory(c->fake, REG_DESCRIPTION, sizeof(text), text);
    }
    return 0;
}

/** The pattern into a buffer of Aravis' camera, whose size it does not know. */
static void fill(ArvBuffer *buffer, void *context, guint32 exposure_us, guint32 gain,
                 ArvPixelFormat code)
{
    (void)context, (void)exposure_us, (void)gain;
    int width = arv_buffer_get_image_width(buffer), height = arv_buffer_get_image_height(buffer);
    const struct gn_pixels_format *format = gn_pixels_find(code);
    size_t unknown;
    uint8_t *data = (uint8_t *)(uintptr_t)arv_buffer_get_data(buffer, &unknown);
    if (!format)
        return;
    memset(data, 0, gn_pixels_get_bytes(format, width, height));
    gn_gige_pack(format, NULL, arv_buffer_get_frame_id(buffer), width, height, data);
}

/** Aravis' own camera, until the end. */
static int run_stock(const char *serial, const char *genicam, struct gn_error *error)
{
    ArvGvFakeCamera *camera = arv_gv_fake_camera_new_full("lo", serial, genicam);
    unlink(genicam);
    if (!camera || !arv_gv_fake_camera_is_running(camera))
        return gn_error_set(error, -EADDRINUSE,
                            "--stock: Aravis' camera does not start; is port %d "
                            "in use?",
                            GVCP_PORT);
    arv_fake_camera_set_fill_pattern(arv_gv_fake_camera_get_fake_camera(camera), fill, NULL);
    printf("ready\n");
    fflush(stdout);
    while (!atomic_load(&is_ending))
        g_usleep(20000);
    g_object_unref(camera);
    return 0;
}

static int serve(const struct gn_options *options, const char *genicam, struct gn_error *error)
{
    int width = gn_options_get_int(options, NULL, NULL, "width");
    int height = gn_options_get_int(options, NULL, NULL, "height");
    const char *pattern = gn_options_get_string(options, NULL, NULL, "files");
    static struct camera c;
    c.fake =
        arv_fake_camera_new_full(gn_options_get_string(options, NULL, NULL, "serial"), genicam);
    unlink(genicam); // it is read; who kills this program leaves nothing behind
    c.fault = (enum fault)gn_options_get_enum(options, NULL, NULL, "fault");
    c.loss = gn_options_get_double(options, NULL, NULL, "loss");
    c.step_s = gn_options_get_double(options, NULL, NULL, "step-s");
    c.delay_ms = gn_options_get_double(options, NULL, NULL, "delay-ms");
    c.trigger_ms = gn_options_get_double(options, NULL, NULL, "trigger-ms");
    c.max_packet = (size_t)gn_options_get_int(options, NULL, NULL, "max-packet");
    c.has_chunks = gn_options_get_bool(options, NULL, NULL, "chunks");
    c.can_resend = !gn_options_get_bool(options, NULL, NULL, "no-resend");
    c.noise = gn_options_get_double(options, NULL, NULL, "noise");
    c.exposure_us[0] = c.exposure_us[1] = (uint32_t)ARV_FAKE_CAMERA_EXPOSURE_TIME_US_DEFAULT;
    c.begin_ns = gn_clock_get_monotonic_ns();
    arv_fake_camera_write_register(c.fake, REG_VERSION, 0x00010002);
    arv_fake_camera_write_register(c.fake, REG_CAPABILITY,
                                   CAN_WRITE | (c.can_resend ? CAN_RESEND : 0));
    arv_fake_camera_write_register(c.fake, ARV_FAKE_CAMERA_REGISTER_WIDTH,
                                   c.fault == FAULT_HUGE ? 0x7ffffff0 : (uint32_t)width);
    arv_fake_camera_write_register(c.fake, ARV_FAKE_CAMERA_REGISTER_HEIGHT, (uint32_t)height);
    const char *response = gn_options_get_string(options, NULL, NULL, "response");
    int err = 0;
    if (response && !gn_rig_read_curve(response, &c.response))
        err = gn_error_set(error, -EINVAL,
                           "--response %s: right would be log:A,B,C, srgb or linear", response);
    if (!err)
        err = open_sockets(&c, gn_options_get_string(options, NULL, NULL, "address"), error);
    if (!err)
        err = set_lies(&c, options, error);
    if (!err && pattern)
        err = read_files(&c, pattern, width, height, error);
    if (!err) {
        printf("ready\n");
        fflush(stdout);
        run(&c);
    }
    for (int i = 0; i < N_KEPT; i++)
        free(c.kept[i].data);
    for (int i = 0; i < c.n_files; i++)
        gn_image16_finish(&c.files[i]);
    free(c.files);
    gn_image16_finish(&c.exposed);
    g_object_unref(c.fake);
    return err;
}

int main(int argc, char *argv[])
{
    struct gn_options *options = NULL;
    struct gn_error error = {0};
    struct sigaction action = {.sa_handler = on_signal};
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    int err = gn_options_load(&gn_gige_program, argc, argv, &options, &error);
    const char *genicam = err ? NULL : gn_gige_write_genicam();
    if (!err && gn_options_wants_help(options)) {
        gn_options_print_help(&gn_gige_program, stdout);
    } else if (!err && !genicam) {
        err = gn_error_set(&error, -EIO, "cannot write its GenICam file");
    } else if (!err && gn_options_get_bool(options, NULL, NULL, "stock")) {
        err = run_stock(gn_options_get_string(options, NULL, NULL, "serial"), genicam, &error);
    } else if (!err) {
        err = serve(options, genicam, &error);
    }
    if (err)
        fprintf(stderr, "gnomon-fake-gige: %s\n", error.text);
    gn_options_destroy(&options);
    return err ? 1 : 0;
}
