/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The page, page.html, as it is built into the program.
 */
#ifndef GN_SERVER_HTTP_PAGE_H
#define GN_SERVER_HTTP_PAGE_H

/** UTF-8, NUL-terminated. */
extern const char gn_http_page[];

#endif
