/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/capture/v4l2_io.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include "common/clock.h"

static int kernel_open(void *context, const char *path)
{
    (void)context;
    int fd = open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC);
    return fd < 0 ? -errno : fd;
}

static void kernel_close(void *context, int fd)
{
    (void)context;
    (void)close(fd);
}

static int kernel_control(void *context, int fd, unsigned long request, void *argument)
{
    (void)context;
    int ret;
    do
        ret = ioctl(fd, request, argument);
    while (ret < 0 && errno == EINTR);
    return ret < 0 ? -errno : 0;
}

static int kernel_map(void *context, int fd, size_t n_bytes, int64_t offset, uint8_t **out_start)
{
    (void)context;
    // Read only: nothing here writes into the driver's memory.
    void *start = mmap(NULL, n_bytes, PROT_READ, MAP_SHARED, fd, (off_t)offset);
    if (start == MAP_FAILED)
        return -errno;
    *out_start = start;
    return 0;
}

static void kernel_unmap(void *context, uint8_t *start, size_t n_bytes)
{
    (void)context;
    (void)munmap(start, n_bytes);
}

static int kernel_wait(void *context, int fd, int timeout_ms)
{
    (void)context;
    struct pollfd p = {.fd = fd, .events = POLLIN | POLLPRI};
    int n = poll(&p, 1, timeout_ms);
    if (n < 0)
        return errno == EINTR ? 0 : -errno;
    return n > 0 ? p.revents : 0;
}

static int64_t kernel_now_ns(void *context)
{
    (void)context;
    return gn_clock_get_monotonic_ns();
}

const struct gn_v4l2_io gn_v4l2_kernel = {
    .open = kernel_open,
    .close = kernel_close,
    .control = kernel_control,
    .map = kernel_map,
    .unmap = kernel_unmap,
    .wait = kernel_wait,
    .now_ns = kernel_now_ns,
};
