/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Preloaded into linux.uml by run.sh on machines whose XSAVE area is larger than linux.uml knows:
 * its ptrace is xsave_ptrace over that of the C library.
 */
#include "bus/uml/ptrace_xsave.h"

#include <dlfcn.h>
#include <stdarg.h>
#include <sys/ptrace.h>

static long (*libc_ptrace)(int request, ...);

static long next_ptrace(int request, pid_t pid, void *addr, void *data)
{
    return libc_ptrace(request, pid, addr, data);
}

static struct xsave_host host = {.ptrace = next_ptrace};

/* Before main, because what looks symbols up may allocate. */
__attribute__((constructor)) static void find_host(void)
{
    *(void **)&libc_ptrace = dlsym(RTLD_NEXT, "ptrace");
    xsave_read_layout(host.component);
}

long ptrace(enum __ptrace_request request, ...)
{
    va_list arguments;
    pid_t pid;
    void *addr, *data;

    va_start(arguments, request);
    pid = va_arg(arguments, pid_t);
    addr = va_arg(arguments, void *);
    data = va_arg(arguments, void *);
    va_end(arguments);
    return xsave_ptrace(&host, (int)request, pid, addr, data);
}
