/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Preloaded into linux.uml by run.sh on machines whose XSAVE area is larger than linux.uml knows:
 * PTRACE_SETREGSET(NT_X86_XSTATE) with a buffer shorter than the host's area. Linux takes the whole
 * area or nothing (EFAULT); Debian 12's linux.uml has a buffer of 2,696 bytes, and a CPU with AMX
 * has an area of 11,008, so that the guest panics when it starts its first process.
 *
 * Errors: as ptrace(2), return value and errno. Thread-safe, async-signal-safe, no allocation.
 */
#include <cpuid.h>
#include <dlfcn.h>
#include <elf.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/uio.h>

enum {
    AREA_MAX = 32768, /* bytes of the largest host area; a larger one is passed on unchanged */
    LEGACY = 512,     /* bytes of the x87 and SSE state */
    HEADER = 64,      /* bytes of the header behind it; its first eight are XSTATE_BV */
    COMPONENTS = 63,  /* numbers of components; 0 and 1 are the legacy state */
};

static long (*next_ptrace)(int request, ...);

/* Where a component lies in the area that ptrace uses (the standard format); no size: there is
 * none. A table, because CPUID leaves a virtual machine, which takes up to 20 us. */
static struct xsave_component {
    size_t offset;
    size_t size;
} layout[COMPONENTS];

/* Fills in this machine's layout (CPUID leaf 0xD). */
static void read_layout(void)
{
    for (unsigned number = 2; number < COMPONENTS; number++) {
        unsigned size = 0, offset = 0, flags = 0, unused;

        /* Supervisor components are no part of the standard format. */
        if (!__get_cpuid_count(0xD, number, &size, &offset, &flags, &unused) || flags & 1) {
            size = 0;
        }
        layout[number] = (struct xsave_component){.offset = offset, .size = size};
    }
}

/*
 * Buffers of whole areas. Not on the stack, because a kernel stack of the guest has 16 KiB; not
 * thread-local, because the guest makes threads by bare clone(2) that share one thread pointer. A
 * call owns a buffer from the test-and-set to the clear, also against a signal handler that
 * interrupts it.
 */
enum { BUFFERS = 8 };

struct area_buffer {
    atomic_flag taken;
    _Alignas(64) unsigned char bytes[AREA_MAX];
};

static struct area_buffer buffers[BUFFERS];

static struct area_buffer *buffer_take(void)
{
    for (size_t n = 0; n < BUFFERS; n++) {
        if (!atomic_flag_test_and_set_explicit(&buffers[n].taken, memory_order_acquire)) {
            return &buffers[n];
        }
    }
    return NULL;
}

static void buffer_release(struct area_buffer *buffer)
{
    atomic_flag_clear_explicit(&buffer->taken, memory_order_release);
}

/*
 * Lays the caller's state over the host's area, component by component, because in the area their
 * order is not that of their numbers, and because half a component would be neither's. A
 * component's bit in XSTATE_BV goes with its bytes: a clear bit means "initial state", so that
 * the bit of a component beyond the caller's buffer must stay as the tracee has it (or'ing it in
 * would wake up stale bytes, the caller's own header would wipe the state out). The rest of the
 * header is the caller's.
 */
static void area_overlay(unsigned char *area, size_t area_size, const unsigned char *state,
                         size_t state_size)
{
    uint64_t covered = 3, tracee_bits, caller_bits;

    memcpy(&tracee_bits, area + LEGACY, sizeof tracee_bits);
    memcpy(&caller_bits, state + LEGACY, sizeof caller_bits);
    memcpy(area, state, LEGACY + HEADER);

    for (unsigned number = 2; number < COMPONENTS; number++) {
        const struct xsave_component part = layout[number];

        if (part.size == 0 || part.offset + part.size > state_size ||
            part.offset + part.size > area_size) {
            continue;
        }
        memcpy(area + part.offset, state + part.offset, part.size);
        covered |= UINT64_C(1) << number;
    }

    tracee_bits = (caller_bits & covered) | (tracee_bits & ~covered);
    memcpy(area + LEGACY, &tracee_bits, sizeof tracee_bits);
}

/* Widens a short PTRACE_SETREGSET(NT_X86_XSTATE) to the host's whole area: the components that the
 * caller's buffer holds entirely are set to the caller's, all others keep the state that the tracee
 * has. The caller's iovec is left as it was. */
static long xsave_ptrace(int request, pid_t pid, void *addr, void *data)
{
    const struct iovec *state = data;
    struct area_buffer *buffer;
    struct iovec area;
    long result;

    if (request != PTRACE_SETREGSET || (uintptr_t)addr != NT_X86_XSTATE || !state ||
        state->iov_len < LEGACY + HEADER || !(buffer = buffer_take())) {
        return next_ptrace(request, pid, addr, data);
    }

    /* The whole area, whose size is what the kernel fills. Where this fails or is no larger than
     * the caller's buffer, or might go on beyond ours, the call itself says what the caller shall
     * hear. */
    area = (struct iovec){.iov_base = buffer->bytes, .iov_len = sizeof buffer->bytes};
    if (next_ptrace(PTRACE_GETREGSET, pid, addr, &area) != 0 || area.iov_len <= state->iov_len ||
        area.iov_len >= sizeof buffer->bytes) {
        buffer_release(buffer);
        return next_ptrace(request, pid, addr, data);
    }

    area_overlay(buffer->bytes, area.iov_len, state->iov_base, state->iov_len);
    result = next_ptrace(request, pid, addr, &area);
    buffer_release(buffer);
    return result;
}

/* Before main, because what looks symbols up may allocate. */
__attribute__((constructor)) static void find_next_ptrace(void)
{
    *(void **)&next_ptrace = dlsym(RTLD_NEXT, "ptrace");
    read_layout();
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
    return xsave_ptrace((int)request, pid, addr, data);
}
