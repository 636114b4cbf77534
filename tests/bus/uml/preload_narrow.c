/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Preloaded into linux.uml by narrow.sh: the guest's buffer of floating-point registers seems to
 * have no more than the legacy state and the header, less than the area of any CPU with AVX. So a
 * machine without AMX shows what linux.uml does on one with AMX.
 */
#include <dlfcn.h>
#include <elf.h>
#include <stdarg.h>
#include <stdint.h>
#include <sys/ptrace.h>
#include <sys/uio.h>

static long (*next_ptrace)(int request, ...);

__attribute__((constructor)) static void find_next_ptrace(void)
{
    *(void **)&next_ptrace = dlsym(RTLD_NEXT, "ptrace");
}

long ptrace(enum __ptrace_request request, ...)
{
    va_list arguments;
    pid_t pid;
    void *addr, *data;
    struct iovec narrow;

    va_start(arguments, request);
    pid = va_arg(arguments, pid_t);
    addr = va_arg(arguments, void *);
    data = va_arg(arguments, void *);
    va_end(arguments);
    if ((request == PTRACE_GETREGSET || request == PTRACE_SETREGSET) &&
        (uintptr_t)addr == NT_X86_XSTATE) {
        narrow = *(struct iovec *)data;
        narrow.iov_len = 512 + 64; /* the x87 and SSE state, and the header */
        data = &narrow;
    }
    return next_ptrace((int)request, pid, addr, data);
}
