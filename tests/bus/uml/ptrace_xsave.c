/* SPDX-License-Identifier: Apache-2.0 */
/* See ptrace_xsave.h. */
#include "bus/uml/ptrace_xsave.h"

#include <cpuid.h>
#include <elf.h>
#include <stdatomic.h>
#include <stdint.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/uio.h>

void xsave_read_layout(struct xsave_component component[XSAVE_COMPONENTS])
{
    for (unsigned number = 2; number < XSAVE_COMPONENTS; number++) {
        unsigned size = 0, offset = 0, flags = 0, unused;

        /* Supervisor components are no part of the standard format. */
        if (!__get_cpuid_count(0xD, number, &size, &offset, &flags, &unused) || flags & 1) {
            size = 0;
        }
        component[number] = (struct xsave_component){.offset = offset, .size = size};
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
    _Alignas(64) unsigned char bytes[XSAVE_AREA_MAX];
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
static void area_overlay(const struct xsave_host *host, unsigned char *area, size_t area_size,
                         const unsigned char *state, size_t state_size)
{
    uint64_t covered = 3, tracee_bits, caller_bits;

    memcpy(&tracee_bits, area + XSAVE_LEGACY, sizeof tracee_bits);
    memcpy(&caller_bits, state + XSAVE_LEGACY, sizeof caller_bits);
    memcpy(area, state, XSAVE_LEGACY + XSAVE_HEADER);

    for (unsigned number = 2; number < XSAVE_COMPONENTS; number++) {
        const struct xsave_component part = host->component[number];

        if (part.size == 0 || part.offset + part.size > state_size ||
            part.offset + part.size > area_size) {
            continue;
        }
        memcpy(area + part.offset, state + part.offset, part.size);
        covered |= UINT64_C(1) << number;
    }

    tracee_bits = (caller_bits & covered) | (tracee_bits & ~covered);
    memcpy(area + XSAVE_LEGACY, &tracee_bits, sizeof tracee_bits);
}

long xsave_ptrace(const struct xsave_host *host, int request, pid_t pid, void *addr, void *data)
{
    const struct iovec *state = data;
    struct area_buffer *buffer;
    struct iovec area;
    long result;

    if (request != PTRACE_SETREGSET || (uintptr_t)addr != NT_X86_XSTATE || !state ||
        state->iov_len < XSAVE_LEGACY + XSAVE_HEADER || !(buffer = buffer_take())) {
        return host->ptrace(request, pid, addr, data);
    }

    /* The whole area, whose size is what the kernel fills. Where this fails or is no larger than
     * the caller's buffer, or might go on beyond ours, the call itself says what the caller shall
     * hear. */
    area = (struct iovec){.iov_base = buffer->bytes, .iov_len = sizeof buffer->bytes};
    if (host->ptrace(PTRACE_GETREGSET, pid, addr, &area) != 0 || area.iov_len <= state->iov_len ||
        area.iov_len >= sizeof buffer->bytes) {
        buffer_release(buffer);
        return host->ptrace(request, pid, addr, data);
    }

    area_overlay(host, buffer->bytes, area.iov_len, state->iov_base, state->iov_len);
    result = host->ptrace(request, pid, addr, &area);
    buffer_release(buffer);
    return result;
}
