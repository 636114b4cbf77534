/* SPDX-License-Identifier: Apache-2.0 */
/* The page's bundle, viewer/page.js.gz, as bytes of the program. Not RT-safe: nothing to call. */
#include "viewer/private.h"

__asm__(".section .rodata\n"
        ".balign 16\n"
        ".global viewer_page_begin\n"
        "viewer_page_begin:\n"
        ".incbin \"" VIEWER_PAGE "\"\n"
        ".global viewer_page_end\n"
        "viewer_page_end:\n"
        ".byte 0\n"
        ".previous\n");
