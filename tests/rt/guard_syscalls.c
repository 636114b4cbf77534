/* SPDX-License-Identifier: Apache-2.0 */
/*
 * System calls of the loop's thread. A seccomp filter on this thread turns each into a signal unless
 * it is made from one place in this file; the handler holds it against the table, counts it, makes it
 * from that place and hands the result back. The filter stays after the run, the handler then lets
 * everything pass.
 */
#include "guard.h"

#include <errno.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <signal.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

enum { DESCRIPTORS = 1024 };
enum { WAIT = 1, RECEIVE = 2, TRANSMIT = 32, PUBLISH = 64, ALL = 127 }; /* bits of enum loop_phase */
enum { REAL = 1, LOCKSTEP = 2, FREE = 4, ANY = 7 };          /* bits of enum rig_clock */

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
     UNKNOWN, "waits for a lossless recorder that has fallen behind"},
    {SYS_clock_gettime, "clock_gettime", ANY, ALL, UNKNOWN,
     "the clock of a kernel that does not show it to programs (vDSO)"},
    {SYS_ppoll, "ppoll", LOCKSTEP, WAIT, UNKNOWN, "sleeps until a STEP can have come"},
    {SYS_recvmmsg, "recvmmsg", ANY, WAIT | RECEIVE, CAN, "a batch of frames; in wait up to the STEP"},
    {SYS_sendmmsg, "sendmmsg", ANY, WAIT | TRANSMIT, CAN,
     "a batch of frames; in wait the DONE that refuses a STEP"},
    {SYS_getsockopt, "getsockopt", ANY, WAIT | RECEIVE | TRANSMIT, CAN, "why a socket has failed"},
    {SYS_write, "write", ANY, WAIT | TRANSMIT, EVENT,
     "a local bus wakes a reader that sleeps; in wait for an inline task"},
    {SYS_read, "read", ANY, WAIT | RECEIVE, EVENT, "a local bus clears the wake-up that it was given"},
};

static uint64_t count[sizeof rules / sizeof rules[0]][GUARD_PHASES];
static unsigned char kind_of[DESCRIPTORS];
static bool watched, works;

/* ---- the place that may ----
 *
 * guard_restorer ends a signal handler; an unwinder knows the frame above it by these very bytes. */
__asm__(".text\n"
        ".globl guard_syscall\n"
        ".hidden guard_syscall\n"
        "guard_syscall:\n"
        "    movq %rdi, %rax\n"
        "    movq %rsi, %rdi\n"
        "    movq %rdx, %rsi\n"
        "    movq %rcx, %rdx\n"
        "    movq %r8, %r10\n"
        "    movq %r9, %r8\n"
        "    movq 8(%rsp), %r9\n"
        "    syscall\n"
        "guard_syscall_end:\n"
        "    ret\n"
        "    nop\n"
        ".globl guard_restorer\n"
        ".hidden guard_restorer\n"
        "guard_restorer:\n"
        "    movq $15, %rax\n"
        "    syscall\n"
        "guard_restorer_end:\n"
        "    ud2\n");

extern const unsigned char guard_syscall_end[], guard_restorer_end[];

/* libc's sigaction would put its own restorer in, which the filter stops */
void guard_handle(int number, void (*handler)(int, siginfo_t *, void *))
{
    const struct {
        void (*handler)(int, siginfo_t *, void *);
        unsigned long flags;
        void (*restorer)(void);
        uint64_t mask;
    } action = {handler, SA_SIGINFO | SA_NODEFER | 0x04000000 /* SA_RESTORER */, guard_restorer, 0};

    if (guard_syscall(SYS_rt_sigaction, number, (long)&action, 0, 8, 0, 0)) {
        guard_fail("cannot handle signal %d", number);
    }
}

/* ---- judging ---- */

static enum kind look(long descriptor)
{
    char path[32], link[64];
    int domain = 0;
    socklen_t size = sizeof domain;
    long length;

    if (guard_syscall(SYS_getsockopt, descriptor, SOL_SOCKET, SO_DOMAIN, (long)&domain, (long)&size,
                      0) == 0) {
        return domain == AF_CAN ? CAN : OTHER;
    }
    memcpy(path, "/proc/self/fd/", 14);
    path[14] = (char)('0' + descriptor / 100 % 10);
    path[15] = (char)('0' + descriptor / 10 % 10);
    path[16] = (char)('0' + descriptor % 10);
    path[17] = '\0';
    /* no leading zeros in that folder */
    memmove(path + 14, path + 14 + (descriptor < 10 ? 2 : descriptor < 100),
            descriptor < 10    ? 2
            : descriptor < 100 ? 3
                               : 4);
    length = guard_syscall(SYS_readlink, (long)path, (long)link, sizeof link - 1, 0, 0, 0);
    link[length > 0 ? length : 0] = '\0';
    return !strcmp(link, "anon_inode:[eventfd]") ? EVENT : OTHER;
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
    } others[] = {
        {SYS_openat, "openat"},         {SYS_open, "open"},
        {SYS_close, "close"},           {SYS_futex, "futex"},
        {SYS_mmap, "mmap"},             {SYS_munmap, "munmap"},
        {SYS_brk, "brk"},               {SYS_mprotect, "mprotect"},
        {SYS_madvise, "madvise"},       {SYS_sched_yield, "sched_yield"},
        {SYS_nanosleep, "nanosleep"},   {SYS_clock_gettime, "clock_gettime"},
        {SYS_writev, "writev"},         {SYS_pwrite64, "pwrite64"},
        {SYS_sendto, "sendto"},         {SYS_sendmsg, "sendmsg"},
        {SYS_recvmsg, "recvmsg"},       {SYS_recvfrom, "recvfrom"},
        {SYS_poll, "poll"},             {SYS_ioctl, "ioctl"},
        {SYS_clone, "clone"},           {SYS_getrusage, "getrusage"},
        {SYS_getppid, "getppid"},       {SYS_fsync, "fsync"},
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
    guard_violation("system call %s (%ld), first argument %ld", name_of(number), number, descriptor);
}

static void on_system_call(int signal, siginfo_t *info, void *context)
{
    greg_t *greg = ((ucontext_t *)context)->uc_mcontext.gregs;
    long number = info->si_syscall;

    (void)signal;
    if (number == SYS_rt_sigreturn) {
        /* another handler ends: its frame is on the stack, as the kernel wants it */
        greg[REG_RIP] = (greg_t)(uintptr_t)guard_restorer;
        return;
    }
    if (guard_inside()) {
        judge(number, greg[REG_RDI]);
    }
    greg[REG_RAX] = guard_syscall(number, greg[REG_RDI], greg[REG_RSI], greg[REG_RDX],
                                  greg[REG_R10], greg[REG_R8], greg[REG_R9]);
}

/* ---- the filter ---- */

#define LOW(address) ((uint32_t)(uintptr_t)(address))
#define HIGH(address) ((uint32_t)((uintptr_t)(address) >> 32))

void guard_watch_syscalls(void)
{
    const size_t at = offsetof(struct seccomp_data, instruction_pointer);
    struct sock_filter filter[] = {
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, (uint32_t)at + 4),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, HIGH(guard_syscall_end), 0, 3),
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, (uint32_t)at),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, LOW(guard_syscall_end), 2, 0),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, LOW(guard_restorer_end), 1, 0),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRAP),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
    };
    struct sock_fprog program = {sizeof filter / sizeof filter[0], filter};

    if (watched) {
        return;
    }
    watched = true;
    guard_handle(SIGSYS, on_system_call);
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
