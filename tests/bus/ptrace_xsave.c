/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The ptrace that user-mode Linux is given on machines with a large XSAVE area: against a kernel
 * that has the area of a CPU with AMX and insists on the whole of it, and against this machine's.
 */
#include "bus/uml/ptrace_xsave.h"
#include "tests/test.h"

#include <elf.h>
#include <errno.h>
#include <pthread.h>
#include <signal.h>
#include <stdbool.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <unistd.h>

enum { AMX_AREA = 11008, GUEST_AREA = 2696, TRACEE = 4711 };

enum { AVX = 2, PKRU = 9, TILE_CONFIG = 17, TILE_DATA = 18 };

/* A kernel with one tracee; one a thread, so that threads do not disturb each other's records. */
struct kernel {
    unsigned char area[AMX_AREA];
    size_t size;
    int calls;
    int get_errno, set_errno;
    int request;
    void *addr, *data;       /* of the last call */
    void (*interrupt)(void); /* a signal that comes when the set is about to be made */
};

static _Thread_local struct kernel kernel;

static long kernel_refuse(int code)
{
    errno = code;
    return -1;
}

static long kernel_ptrace(int request, pid_t pid, void *addr, void *data)
{
    struct iovec *given = data;

    assert_int_equal(pid, TRACEE);
    kernel.calls++;
    kernel.request = request;
    kernel.addr = addr;
    kernel.data = data;
    if ((uintptr_t)addr != NT_X86_XSTATE) {
        return 42;
    }
    if (request == PTRACE_GETREGSET) {
        if (kernel.get_errno) {
            return kernel_refuse(kernel.get_errno);
        }
        given->iov_len = given->iov_len < kernel.size ? given->iov_len : kernel.size;
        if (kernel.size <= sizeof kernel.area) {
            memcpy(given->iov_base, kernel.area, given->iov_len);
        }
        return 0;
    }
    if (request == PTRACE_SETREGSET) {
        if (kernel.interrupt) {
            void (*interrupt)(void) = kernel.interrupt;

            kernel.interrupt = NULL;
            interrupt();
        }
        if (kernel.set_errno) {
            return kernel_refuse(kernel.set_errno);
        }
        if (given->iov_len < kernel.size) {
            return kernel_refuse(EFAULT);
        }
        memcpy(kernel.area, given->iov_base, kernel.size);
        return 0;
    }
    return 42;
}

/* The layout of a CPU with AVX-512, protection keys and AMX */
static const struct xsave_host amx_host = {
    .ptrace = kernel_ptrace,
    .component = {[AVX] = {576, 256},
                  [5] = {1088, 64},
                  [6] = {1152, 512},
                  [7] = {1664, 1024},
                  [PKRU] = {2688, 8},
                  [TILE_CONFIG] = {2752, 64},
                  [TILE_DATA] = {2816, 8192}},
};

static void set_bits(unsigned char *area, uint64_t bits)
{
    memcpy(area + XSAVE_LEGACY, &bits, sizeof bits);
}

static uint64_t get_bits(const unsigned char *area)
{
    uint64_t bits;

    memcpy(&bits, area + XSAVE_LEGACY, sizeof bits);
    return bits;
}

static bool all(const unsigned char *bytes, size_t size, unsigned char value)
{
    while (size > 0 && bytes[size - 1] == value) {
        size--;
    }
    return size == 0;
}

#define BIT(n) (UINT64_C(1) << (n))

/* A kernel whose tracee has 0x11 everywhere and tiles in use. */
FIXTURE(boot)
{
    kernel = (struct kernel){.size = AMX_AREA};
    memset(kernel.area, 0x11, sizeof kernel.area);
    memset(kernel.area + XSAVE_LEGACY, 0, XSAVE_HEADER);
    set_bits(kernel.area, BIT(0) | BIT(AVX) | BIT(TILE_CONFIG));
    return 0;
}

/* What a guest sets: 0xEE everywhere. */
static struct iovec guest_state(unsigned char *bytes, size_t size, uint64_t bits)
{
    memset(bytes, 0xEE, size);
    memset(bytes + XSAVE_LEGACY, 0, XSAVE_HEADER);
    set_bits(bytes, bits);
    return (struct iovec){.iov_base = bytes, .iov_len = size};
}

static long guest_set(struct iovec *state)
{
    return xsave_ptrace(&amx_host, PTRACE_SETREGSET, TRACEE, (void *)NT_X86_XSTATE, state);
}

TEST_WITH(kernel_itself_refuses_a_short_set, boot, NULL)
{
    unsigned char bytes[GUEST_AREA];
    struct iovec state = guest_state(bytes, sizeof bytes, BIT(0));

    assert_int_equal(kernel_ptrace(PTRACE_SETREGSET, TRACEE, (void *)NT_X86_XSTATE, &state), -1);
    assert_int_equal(errno, EFAULT);
}

TEST_WITH(short_set_becomes_one_of_the_whole_area, boot, NULL)
{
    unsigned char bytes[GUEST_AREA];
    struct iovec state = guest_state(bytes, sizeof bytes, BIT(0) | BIT(1) | BIT(AVX) | BIT(PKRU));

    assert_int_equal(guest_set(&state), 0);
    assert_int_equal(kernel.calls, 2);
    assert_int_equal(((struct iovec *)kernel.data)->iov_len, AMX_AREA);
    /* What the guest has given, up to its end, and what it knows nothing of */
    assert_true(all(kernel.area, XSAVE_LEGACY, 0xEE));
    assert_true(all(kernel.area + 576, 256, 0xEE));
    assert_true(all(kernel.area + 1088, GUEST_AREA - 1088, 0xEE));
    assert_true(all(kernel.area + 2752, AMX_AREA - 2752, 0x11));
    /* and its iovec is as it was */
    assert_ptr_equal(state.iov_base, bytes);
    assert_int_equal(state.iov_len, GUEST_AREA);
}

TEST_WITH(components_beyond_the_buffer_stay_in_use_or_initial, boot, NULL)
{
    unsigned char bytes[GUEST_AREA];
    struct iovec state = guest_state(bytes, sizeof bytes, BIT(1));

    /* AVX goes back to its initial state as the guest says, the tiles stay configured */
    assert_int_equal(guest_set(&state), 0);
    assert_int_equal(get_bits(kernel.area), BIT(1) | BIT(TILE_CONFIG));
    /* and what is initial is not woken up by a bit of the guest's */
    state = guest_state(bytes, sizeof bytes, BIT(0) | BIT(TILE_DATA));
    assert_int_equal(guest_set(&state), 0);
    assert_int_equal(get_bits(kernel.area), BIT(0) | BIT(TILE_CONFIG));
}

TEST_WITH(header_is_otherwise_the_guests, boot, NULL)
{
    unsigned char bytes[GUEST_AREA];
    struct iovec state = guest_state(bytes, sizeof bytes, BIT(0));

    bytes[XSAVE_LEGACY + 8] = 1; /* XCOMP_BV, which the kernel checks */
    assert_int_equal(guest_set(&state), 0);
    assert_int_equal(kernel.area[XSAVE_LEGACY + 8], 1);
}

TEST_WITH(half_a_component_is_left_alone, boot, NULL)
{
    unsigned char bytes[2784]; /* ends in the middle of the tile configuration */
    struct iovec state = guest_state(bytes, sizeof bytes, BIT(0));

    assert_int_equal(guest_set(&state), 0);
    assert_true(all(kernel.area + 2752, AMX_AREA - 2752, 0x11));
    assert_int_equal(get_bits(kernel.area), BIT(0) | BIT(TILE_CONFIG));
}

TEST_WITH(all_other_calls_are_passed_on, boot, NULL)
{
    static const int request[] = {PTRACE_PEEKUSER, PTRACE_GETREGSET, PTRACE_SETREGSET, PTRACE_CONT};
    unsigned char bytes[AMX_AREA];
    struct iovec state = guest_state(bytes, GUEST_AREA, BIT(0));

    for (size_t n = 0; n < sizeof request / sizeof *request; n++) {
        kernel.calls = 0;
        assert_int_equal(xsave_ptrace(&amx_host, request[n], TRACEE, (void *)NT_PRSTATUS, &state),
                         42);
        assert_int_equal(kernel.calls, 1);
        assert_int_equal(kernel.request, request[n]);
        assert_ptr_equal(kernel.addr, NT_PRSTATUS);
        assert_ptr_equal(kernel.data, &state);
    }
    /* Reading is no business of the shim's */
    kernel.calls = 0;
    assert_int_equal(
        xsave_ptrace(&amx_host, PTRACE_GETREGSET, TRACEE, (void *)NT_X86_XSTATE, &state), 0);
    assert_int_equal(kernel.calls, 1);
    assert_ptr_equal(kernel.data, &state);
    /* A whole set, and one that has not even a header */
    state = guest_state(bytes, sizeof bytes, BIT(0));
    assert_int_equal(guest_set(&state), 0);
    assert_ptr_equal(kernel.data, &state);
    state.iov_len = 512;
    assert_int_equal(guest_set(&state), -1);
    assert_int_equal(errno, EFAULT);
    assert_ptr_equal(kernel.data, &state);
}

TEST_WITH(area_that_is_too_large_is_passed_on, boot, NULL)
{
    unsigned char bytes[GUEST_AREA];
    struct iovec state = guest_state(bytes, sizeof bytes, BIT(0));

    kernel.size = XSAVE_AREA_MAX + 8;
    assert_int_equal(guest_set(&state), -1);
    assert_int_equal(errno, EFAULT);
    assert_ptr_equal(kernel.data, &state);
}

TEST_WITH(errors_are_the_kernels, boot, NULL)
{
    unsigned char bytes[GUEST_AREA];
    struct iovec state = guest_state(bytes, sizeof bytes, BIT(0));

    kernel.set_errno = EINVAL;
    assert_int_equal(guest_set(&state), -1);
    assert_int_equal(errno, EINVAL);
    /* A tracee that is gone: the set itself says so */
    kernel.get_errno = EIO;
    kernel.set_errno = ESRCH;
    assert_int_equal(guest_set(&state), -1);
    assert_int_equal(errno, ESRCH);
    assert_ptr_equal(kernel.data, &state);
}

TEST_WITH(buffers_are_given_back, boot, NULL)
{
    unsigned char bytes[GUEST_AREA];
    struct iovec state = guest_state(bytes, sizeof bytes, BIT(0));

    for (int n = 0; n < 1000; n++) {
        kernel.get_errno = n % 3 == 1 ? ESRCH : 0;
        kernel.set_errno = n % 3 == 2 ? EINVAL : 0;
        guest_set(&state);
    }
    kernel.get_errno = kernel.set_errno = 0;
    assert_int_equal(guest_set(&state), 0);
}

static void interrupting_set(void)
{
    unsigned char bytes[GUEST_AREA];
    struct iovec state = guest_state(bytes, sizeof bytes, BIT(0));

    memset(bytes, 0x77, XSAVE_LEGACY);
    assert_int_equal(guest_set(&state), 0);
    assert_true(all(kernel.area, XSAVE_LEGACY, 0x77));
}

TEST_WITH(set_may_be_interrupted_by_another, boot, NULL)
{
    unsigned char bytes[GUEST_AREA];
    struct iovec state = guest_state(bytes, sizeof bytes, BIT(0));

    kernel.interrupt = interrupting_set;
    assert_int_equal(guest_set(&state), 0);
    assert_true(all(kernel.area, XSAVE_LEGACY, 0xEE));
}

static void *set_often(void *wrong)
{
    unsigned char bytes[GUEST_AREA], mine = (unsigned char)(uintptr_t)pthread_self() | 1;
    struct iovec state = guest_state(bytes, sizeof bytes, BIT(0));

    boot(NULL);
    memset(bytes, mine, XSAVE_LEGACY);
    memset(kernel.area + 2752, mine, AMX_AREA - 2752);
    for (int n = 0; n < 20000; n++) {
        if (guest_set(&state) != 0 || !all(kernel.area, XSAVE_LEGACY, mine) ||
            !all(kernel.area + 2752, AMX_AREA - 2752, mine)) {
            *(int *)wrong = 1;
        }
    }
    return NULL;
}

TEST(threads_do_not_mix_their_states)
{
    pthread_t thread[4];
    int wrong[4] = {0};

    for (size_t n = 0; n < 4; n++) {
        assert_int_equal(pthread_create(&thread[n], NULL, set_often, &wrong[n]), 0);
    }
    for (size_t n = 0; n < 4; n++) {
        pthread_join(thread[n], NULL);
        assert_int_equal(wrong[n], 0);
    }
}

/* ---- this machine ---- */

static long machine_ptrace(int request, pid_t pid, void *addr, void *data)
{
    return ptrace((enum __ptrace_request)request, pid, addr, data);
}

static long whole_set(int request, pid_t pid, unsigned char *bytes, size_t *size)
{
    struct iovec state = {.iov_base = bytes, .iov_len = *size};
    long result = ptrace((enum __ptrace_request)request, pid, (void *)NT_X86_XSTATE, &state);

    *size = state.iov_len;
    return result;
}

/* A child that stands still, with 0x11 in the low and the high halves of its vector registers;
 * then only the low halves are set, by a buffer that has room for no more. */
TEST(this_kernel_takes_the_widened_set)
{
    struct xsave_host machine = {.ptrace = machine_ptrace};
    const struct xsave_component *avx = &machine.component[AVX];
    unsigned char area[XSAVE_AREA_MAX] = {0}, bytes[XSAVE_LEGACY + XSAVE_HEADER];
    struct iovec state = {.iov_base = bytes, .iov_len = sizeof bytes};
    size_t size = sizeof area;
    long short_set, errno_of_it, wide_set;
    bool low, high;
    pid_t child;

    xsave_read_layout(machine.component);
    if (avx->size == 0) {
        skip(); /* no AVX: the area has no more than the guest's buffer */
    }
    if (!(child = fork())) {
        ptrace(PTRACE_TRACEME, 0, NULL, NULL);
        raise(SIGSTOP);
        _exit(0);
    }
    assert_true(child > 0);
    assert_int_equal(waitpid(child, NULL, 0), child);

    assert_int_equal(whole_set(PTRACE_GETREGSET, child, area, &size), 0);
    memset(area + 160, 0x11, 256);
    memset(area + avx->offset, 0x11, avx->size);
    set_bits(area, get_bits(area) | BIT(1) | BIT(AVX));
    assert_int_equal(whole_set(PTRACE_SETREGSET, child, area, &size), 0);
    memcpy(bytes, area, sizeof bytes);
    memset(bytes + 160, 0xEE, 256);

    short_set = machine_ptrace(PTRACE_SETREGSET, child, (void *)NT_X86_XSTATE, &state);
    errno_of_it = errno;
    wide_set = xsave_ptrace(&machine, PTRACE_SETREGSET, child, (void *)NT_X86_XSTATE, &state);
    memset(area, 0, sizeof area);
    size = sizeof area;
    whole_set(PTRACE_GETREGSET, child, area, &size);
    low = all(area + 160, 256, 0xEE);
    high = all(area + avx->offset, avx->size, 0x11);
    kill(child, SIGKILL);
    waitpid(child, NULL, 0);

    assert_int_equal(short_set, -1);
    assert_int_equal(errno_of_it, EFAULT);
    assert_int_equal(wide_set, 0);
    assert_true(low);
    assert_true(high);
}
