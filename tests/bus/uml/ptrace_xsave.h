/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Purpose: PTRACE_SETREGSET(NT_X86_XSTATE) with a buffer shorter than the host's XSAVE area.
 * Linux takes the whole area or nothing (EFAULT); Debian 12's linux.uml has a buffer of 2,696
 * bytes, and a CPU with AMX has an area of 11,008, so that the guest panics when it starts its
 * first process.
 *
 * Errors: as ptrace(2), return value and errno. Thread-safe, async-signal-safe, no allocation.
 */
#ifndef TESTS_BUS_UML_PTRACE_XSAVE_H
#define TESTS_BUS_UML_PTRACE_XSAVE_H

#include <stddef.h>
#include <sys/types.h>

enum {
    XSAVE_AREA_MAX =
        32768,             /* bytes of the largest host area; a larger one is passed on unchanged */
    XSAVE_LEGACY = 512,    /* bytes of the x87 and SSE state */
    XSAVE_HEADER = 64,     /* bytes of the header behind it; its first eight are XSTATE_BV */
    XSAVE_COMPONENTS = 63, /* numbers of components; 0 and 1 are the legacy state */
};

/* Where a component lies in the area that ptrace uses (the standard format); no size: there is
 * none. */
struct xsave_component {
    size_t offset;
    size_t size;
};

/* What is below the call; the test has its own. The caller owns it. The layout is a table because
 * CPUID leaves a virtual machine, which takes up to 20 us. */
struct xsave_host {
    long (*ptrace)(int request, pid_t pid, void *addr, void *data);
    struct xsave_component component[XSAVE_COMPONENTS];
};

/* Fills in this machine's layout (CPUID leaf 0xD). */
void xsave_read_layout(struct xsave_component component[XSAVE_COMPONENTS]);

/*
 * ptrace, except that a short PTRACE_SETREGSET(NT_X86_XSTATE) is widened to the host's whole
 * area: the components that the caller's buffer holds entirely are set to the caller's, all
 * others keep the state that the tracee has. The caller's iovec is left as it was.
 */
long xsave_ptrace(const struct xsave_host *host, int request, pid_t pid, void *addr, void *data);

#endif
