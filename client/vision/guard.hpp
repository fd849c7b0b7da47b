/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The border between OpenCV's C++ and our C: no exception crosses it.
 */
#ifndef GN_CLIENT_VISION_GUARD_HPP
#define GN_CLIENT_VISION_GUARD_HPP

#include <cerrno>
#include <exception>
#include <memory>
#include <new>

extern "C" {
#include "common/error.h"
}

/** Returns what f() does; -ENOMEM, or -EIO and a sentence, where it throws. */
template <typename F> int gn_vision_guard(gn_error *out_error, const char *what, F f) noexcept
{
    try {
        return f();
    } catch (const std::bad_alloc &) {
        return gn_error_set(out_error, -ENOMEM, "%s: out of memory", what);
    } catch (const std::exception &e) {
        return gn_error_set(out_error, -EIO, "%s: OpenCV says: %s", what, e.what());
    } catch (...) {
        return gn_error_set(out_error, -EIO, "%s: OpenCV failed", what);
    }
}

#endif
