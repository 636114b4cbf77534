/* SPDX-License-Identifier: Apache-2.0 */
/*
 * System calls of the loop's thread. A seccomp filter on this thread turns each into a signal
 * unless the guard makes it; the handler holds it against the table, counts it, makes it and hands
 * the result back. The filter stays after the run, the handler then lets everything pass.
 *
 * The filter knows the guard's own calls by the place that they are made from, and by a word in the
 * sixth argument when they take fewer: user-mode Linux does not tell filters the place. There calls
 * with six arguments pass unseen.
 */
#include "guard.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <stdio.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

enum { DESCRIPTORS = 1024 };
/* Bits of enum loop_phase and of enum loop_clock */
enum { WAIT = 1, RECEIVE = 2, TRANSMIT = 32, PUBLISH = 64, ALL = 127 };
enum { REAL = 1, LOCKSTEP = 2, FREE = 4, ANY = 7 };

enum kind { UNKNOWN, OTHER, CAN, EVENT };

/* What the loop may ask of the kernel, in which clocks and phases, and why. */
static const struct rule {
    long number;
    const char *name;
    unsigned clocks, phases;
    enum kind kind; /* of the descriptor that comes first; UNKNOWN = it has none */
    const char *why;
} rules[] = {
    {SYS_clock_nanosleep, "clock_nanosleep", REAL, WAIT, UNKNOWN, "sleeps until the deadline"},
    {SYS_clock_nanosleep, "clock_nanosleep", LOCKSTEP | FREE, WAIT | RECEIVE | TRANSMIT | PUBLISH,
     UNKNOWN,
     "waits for a lossless recorder that has fallen behind; in wait keeps the speed asked for"},
    {SYS_clock_gettime, "clock_gettime", ANY, ALL, UNKNOWN,
     "the clock of a kernel that does not show it to programs (vDSO)"},
    {SYS_ppoll, "ppoll", ANY, WAIT, UNKNOWN,
     "sleeps until a STEP can have come, in real time until a frame arrives; stands still for who "
     "steers it"},
    {SYS_recvmmsg, "recvmmsg", ANY, WAIT | RECEIVE, CAN,
     "a batch of frames; in wait up to the STEP, or between two ticks"},
    {SYS_sendmmsg, "sendmmsg", ANY, WAIT | TRANSMIT, CAN,
     "a batch of frames; in wait the DONE that refuses a STEP, or answers between two ticks"},
    {SYS_getsockopt, "getsockopt", ANY, WAIT | RECEIVE | TRANSMIT, CAN,
     "what a full socket has lost; that one has failed is taken away"},
    {SYS_write, "write", ANY, WAIT | TRANSMIT, EVENT,
     "a local bus wakes a reader that sleeps; in wait for an inline task"},
    {SYS_read, "read", ANY, WAIT | RECEIVE, EVENT,
     "clears the wake-up of a local bus, or of who steers"},
};

static uint64_t count[sizeof rules / sizeof rules[0]][GUARD_PHASES];
static unsigned char kind_of[DESCRIPTORS];
static bool watched, works;

/* ---- the guard's own calls ----
 *
 * A handler is entered by a stub that leaves the word behind for the restorer, which ends it; an
 * unwinder knows the frame above that by these very bytes. */
#define WORD UINT64_C(0x68696c2d67756172)

#define ENTRY(name, handler)                                                                       \
    ".globl " name "\n"                                                                            \
    ".hidden " name "\n" name ":\n"                                                                \
    "    .cfi_startproc\n"                                                                         \
    "    subq $8, %rsp\n"                                                                          \
    "    .cfi_adjust_cfa_offset 8\n"                                                               \
    "    call " handler "\n"                                                                       \
    "    addq $8, %rsp\n"                                                                          \
    "    .cfi_adjust_cfa_offset -8\n"                                                              \
    "    movabsq $0x68696c2d67756172, %r9\n"                                                       \
    "    ret\n"                                                                                    \
    "    .cfi_endproc\n"

__asm__(".text\n"
        "gate:\n"
        "    movq %rdi, %rax\n"
        "    movq %rsi, %rdi\n"
        "    movq %rdx, %rsi\n"
        "    movq %rcx, %rdx\n"
        "    movq %r8, %r10\n"
        "    movq %r9, %r8\n"
        "    movq 8(%rsp), %r9\n"
        "    syscall\n"
        "gate_end:\n"
        "    ret\n"
        "    nop\n"
        "restorer:\n"
        "    movq $15, %rax\n"
        "    syscall\n"
        "restorer_end:\n"
        "    ud2\n" ENTRY("guard_entry_breakpoint", "guard_on_breakpoint")
            ENTRY("guard_entry_system_call", "guard_on_system_call"));

long gate(long number, long a, long b, long c, long d, long e, long f) __asm__("gate");
void restorer(void) __asm__("restorer");
extern const unsigned char gate_end[] __asm__("gate_end"), restorer_end[] __asm__("restorer_end");

/* Those that a program without a loop makes and that take six arguments */
static const long six[] = {SYS_mmap, SYS_futex, SYS_sendto, SYS_recvfrom, SYS_pselect6};

enum { NSIX = sizeof six / sizeof six[0] };

long guard_syscall(long number, long a, long b, long c, long d, long e, long f)
{
    for (int i = 0; i < NSIX; i++) {
        if (six[i] == number) {
            return gate(number, a, b, c, d, e, f);
        }
    }
    return gate(number, a, b, c, d, e, (long)WORD);
}

/* libc's sigaction would put its own restorer in, which the filter stops */
void guard_handle(int number, void (*entry)(int, siginfo_t *, void *))
{
    const struct {
        void (*entry)(int, siginfo_t *, void *);
        unsigned long flags;
        void (*restorer)(void);
        uint64_t mask;
    } action = {entry, SA_SIGINFO | SA_NODEFER | 0x04000000 /* SA_RESTORER */, restorer, 0};

    if (guard_syscall(SYS_rt_sigaction, number, (long)&action, 0, 8, 0, 0)) {
        guard_fail("cannot handle signal %d", number);
    }
}

/* ---- judging ---- */

static enum kind look(long descriptor)
{
    char path[32], target[64];
    int domain = 0;
    socklen_t size = sizeof domain;
    long length;

    if (guard_syscall(SYS_getsockopt, descriptor, SOL_SOCKET, SO_DOMAIN, (long)&domain, (long)&size,
                      0) == 0) {
        return domain == AF_CAN ? CAN : OTHER;
    }
    snprintf(path, sizeof path, "/proc/self/fd/%ld", descriptor);
    length = guard_syscall(SYS_readlink, (long)path, (long)target, sizeof target - 1, 0, 0, 0);
    target[length > 0 ? length : 0] = '\0';
    return !strcmp(target, "anon_inode:[eventfd]") ? EVENT : OTHER;
}

static bool fits(const struct rule *rule, long descriptor)
{
    if (rule->kind == UNKNOWN) {
        return true;
    }
    if (descriptor < 0 || descriptor >= DESCRIPTORS) {
        return false;
    }
    if (kind_of[descriptor] == UNKNOWN) {
        kind_of[descriptor] = (unsigned char)look(descriptor);
    }
    return kind_of[descriptor] == rule->kind;
}

static const char *name_of(long number)
{
    static const struct {
        long number;
        const char *name;
    } others[] = {{SYS_openat, "openat"},
                  {SYS_open, "open"},
                  {SYS_close, "close"},
                  {SYS_futex, "futex"},
                  {SYS_mmap, "mmap"},
                  {SYS_munmap, "munmap"},
                  {SYS_brk, "brk"},
                  {SYS_mprotect, "mprotect"},
                  {SYS_madvise, "madvise"},
                  {SYS_sched_yield, "sched_yield"},
                  {SYS_nanosleep, "nanosleep"},
                  {SYS_clock_gettime, "clock_gettime"},
                  {SYS_writev, "writev"},
                  {SYS_pwrite64, "pwrite64"},
                  {SYS_sendto, "sendto"},
                  {SYS_sendmsg, "sendmsg"},
                  {SYS_recvmsg, "recvmsg"},
                  {SYS_recvfrom, "recvfrom"},
                  {SYS_poll, "poll"},
                  {SYS_ioctl, "ioctl"},
                  {SYS_clone, "clone"},
                  {SYS_getrusage, "getrusage"},
                  {SYS_getppid, "getppid"},
                  {SYS_fsync, "fsync"},
                  {SYS_rt_sigaction, "sigaction"}};

    for (size_t i = 0; i < sizeof rules / sizeof rules[0]; i++) {
        if (rules[i].number == number) {
            return rules[i].name;
        }
    }
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++) {
        if (others[i].number == number) {
            return others[i].name;
        }
    }
    return "?";
}

static void judge(long number, long descriptor)
{
    for (size_t i = 0; i < sizeof rules / sizeof rules[0]; i++) {
        const struct rule *rule = &rules[i];

        if (rule->number == number && rule->clocks >> guard_state.clock & 1 &&
            rule->phases >> guard_state.phase & 1 && fits(rule, descriptor)) {
            count[i][guard_state.phase]++;
            return;
        }
    }
    guard_violation("system call %s (%ld), first argument %ld", name_of(number), number,
                    descriptor);
}

void guard_on_system_call(int signal, siginfo_t *info, void *context)
{
    greg_t *greg = ((ucontext_t *)context)->uc_mcontext.gregs;
    long number = info->si_syscall;

    (void)signal;
    if (number == SYS_rt_sigreturn) {
        /* Another handler ends: its frame is on the stack, as the kernel wants it */
        greg[REG_RIP] = (greg_t)(uintptr_t)restorer;
        greg[REG_R9] = (greg_t)WORD;
        return;
    }
    if (guard_inside()) {
        judge(number, greg[REG_RDI]);
    }
    greg[REG_RAX] = guard_syscall(number, greg[REG_RDI], greg[REG_RSI], greg[REG_RDX],
                                  greg[REG_R10], greg[REG_R8], greg[REG_R9]);
}

/* ---- the filter ---- */

#define LOW(value) ((uint32_t)(uintptr_t)(value))
#define HIGH(value) ((uint32_t)((uintptr_t)(value) >> 32))
#define LOAD(at) BPF_STMT(BPF_LD | BPF_W | BPF_ABS, (uint32_t)(at))
#define WHEN_EQUAL(value, otherwise) BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, 0, otherwise)
#define ALLOW BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW)

enum { PLACE = offsetof(struct seccomp_data, instruction_pointer) };
enum { SIXTH = offsetof(struct seccomp_data, args) + 5 * sizeof(uint64_t) };

/* User-mode Linux gives filters an instruction pointer of its own */
static bool place_is_told(void)
{
    char text[4096];
    int descriptor = open("/proc/cpuinfo", O_RDONLY | O_CLOEXEC);
    ssize_t size = read(descriptor, text, sizeof text - 1);

    close(descriptor);
    text[size > 0 ? size : 0] = '\0';
    return !strstr(text, "User Mode Linux");
}

void guard_watch_syscalls(void)
{
    struct sock_filter filter[] = {
        LOAD(PLACE + 4),
        WHEN_EQUAL(HIGH(gate_end), 5),
        LOAD(PLACE),
        WHEN_EQUAL(LOW(gate_end), 1),
        ALLOW,
        WHEN_EQUAL(LOW(restorer_end), 1),
        ALLOW,
        LOAD(SIXTH),
        WHEN_EQUAL(LOW(WORD), 3),
        LOAD(SIXTH + 4),
        WHEN_EQUAL(HIGH(WORD), 1),
        ALLOW,
        LOAD(offsetof(struct seccomp_data, nr)),
        /* Without the place */
        WHEN_EQUAL(SYS_mmap, 1),
        ALLOW,
        WHEN_EQUAL(SYS_futex, 1),
        ALLOW,
        WHEN_EQUAL(SYS_sendto, 1),
        ALLOW,
        WHEN_EQUAL(SYS_recvfrom, 1),
        ALLOW,
        WHEN_EQUAL(SYS_pselect6, 1),
        ALLOW,
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRAP),
    };
    const size_t size = sizeof filter / sizeof filter[0];
    struct sock_fprog program = {(unsigned short)size, filter};

    if (watched) {
        return;
    }
    watched = true;
    if (place_is_told()) {
        filter[size - 1 - 2 * NSIX] = filter[size - 1];
    }
    guard_handle(SIGSYS, guard_entry_system_call);
    works = prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
            prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program, 0, 0) == 0;
    if (!works) {
        guard_print("rt guard: no seccomp filter (%s): system calls are not watched\n",
                    strerror(errno));
    }
}

void guard_report_syscalls(void)
{
    if (!works) {
        return;
    }
    guard_print("rt guard: %-16s%9s%9s%9s%9s%9s%9s%9s\n", "system call", "wait", "receive",
                "boards", "plant", "sensors", "transmit", "publish");
    for (size_t i = 0; i < sizeof rules / sizeof rules[0]; i++) {
        const uint64_t *of = count[i];
        uint64_t sum = 0;

        for (int p = 0; p < GUARD_PHASES; p++) {
            sum += of[p];
        }
        if (sum) {
            guard_print("rt guard: %-16s", rules[i].name);
            for (int p = 0; p < GUARD_PHASES; p++) {
                guard_print("%9llu", (unsigned long long)of[p]);
            }
            guard_print("   %s\n", rules[i].why);
        }
    }
}
