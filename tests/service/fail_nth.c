/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Preloaded into the program under test by fail_nth.py: makes the n-th allocation or the n-th
 * system call of one kind fail. The program is loaded once; from there each line on standard input
 * asks for one run, done by a fork just before main, so that only what the program itself does
 * after the dynamic linker is counted, and so that a run costs no more than main.
 *
 *   a N SPAN               SPAN allocations from the N-th on fail; SPAN 0: all that follow; N 0:
 *                          none
 *   s NUMBER N SPAN WHAT   as above for system call NUMBER: WHAT is the errno that it gives, -1 has
 *                          it transfer half as many bytes as asked; NUMBER -1: none, calls of all
 *                          kinds are counted
 *
 * A run has its working directory and standard streams below $FAIL_NTH_ROOT: work/, out, err. The
 * answer is a line: "exit STATUS" or "signal NUMBER", "seen" and how many calls were counted,
 * "left" and how many processes outlived the program, and then, separated by spaces,
 *   for a 0: each N at which an allocation came from a place (a stack of calls) not seen before;
 *   for other allocations: where the first that failed was made, as MODULE+OFFSET, innermost first;
 *   for s -1: each kind of call as NUMBER:COUNT;
 *   for other calls: the arguments of the last one that was changed, and the text that it points
 *   to.
 */
#include <dlfcn.h>
#include <errno.h>
#include <execinfo.h>
#include <fcntl.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <sys/user.h>
#include <sys/wait.h>
#include <unistd.h>

enum {
    DEPTH = 24,
    PLACES = 16384,
    SYSCALLS = 1024,
    FOREIGN = 64,
    RUN_LIMIT_S = 90,
    LEFT_OVER_TRIES = 50
};
enum { EXCERPT = 128 };

/* What a run and the server both see. */
struct shared {
    atomic_ulong count, first, span; /* first 0: nothing fails, places are noted */
    int depth;
    void *frame[DEPTH];
    struct {
        uint64_t hash;
        unsigned long n;
    } place[PLACES]; /* a hash table: where an allocation was first made from */
};

static struct shared idle;
static struct shared *shared = &idle;

/* ---- allocations ---- */

static void *(*real_malloc)(size_t);
static void *(*real_calloc)(size_t, size_t);
static void *(*real_realloc)(void *, size_t);
static void *(*real_aligned)(size_t, size_t);
static int (*real_posix)(void **, size_t, size_t);
static void *(*real_mmap)(void *, size_t, int, int, int, off_t);

static void find(void *function, const char *name)
{
    void *found = dlsym(RTLD_NEXT, name);

    memcpy(function, &found, sizeof found);
}

/* the first calls come from the linker's own start, before any constructor */
static void find_all(void)
{
    if (!real_malloc) {
        find(&real_calloc, "calloc");
        find(&real_realloc, "realloc");
        find(&real_aligned, "aligned_alloc");
        find(&real_posix, "posix_memalign");
        find(&real_mmap, "mmap");
        find(&real_malloc, "malloc");
    }
}

static bool within(unsigned long n, unsigned long first, unsigned long span)
{
    return first && n >= first && (!span || n - first < span);
}

/* One slot for each stack of calls; threads that meet here lose a place at worst. */
static void note_place(unsigned long n)
{
    void *frame[DEPTH];
    int depth = backtrace(frame, DEPTH);
    uint64_t hash = 14695981039346656037u;

    for (int i = 0; i < depth; i++) {
        hash = (hash ^ (uintptr_t)frame[i]) * 1099511628211u;
    }
    hash += !hash;
    for (size_t i = hash >> 32, tries = 0; tries < PLACES / 2; i++, tries++) {
        if (!shared->place[i % PLACES].hash) {
            shared->place[i % PLACES].hash = hash;
            shared->place[i % PLACES].n = n;
            return;
        }
        if (shared->place[i % PLACES].hash == hash) {
            return;
        }
    }
}

static bool fails(void)
{
    static _Thread_local bool busy;
    unsigned long n;

    if (shared == &idle || busy) {
        return false;
    }
    n = atomic_fetch_add(&shared->count, 1) + 1;
    if (!shared->first) {
        busy = true;
        note_place(n);
        busy = false;
        return false;
    }
    if (!within(n, shared->first, shared->span)) {
        return false;
    }
    if (n == shared->first) {
        busy = true;
        shared->depth = backtrace(shared->frame, DEPTH);
        busy = false;
    }
    errno = ENOMEM;
    return true;
}

void *aligned_alloc(size_t alignment, size_t size)
{
    find_all();
    return fails() ? NULL : real_aligned(alignment, size);
}

int posix_memalign(void **memory, size_t alignment, size_t size)
{
    find_all();
    return fails() ? ENOMEM : real_posix(memory, alignment, size);
}

void *mmap(void *address, size_t size, int protection, int flags, int descriptor, off_t offset)
{
    find_all();
    return fails() ? MAP_FAILED : real_mmap(address, size, protection, flags, descriptor, offset);
}

void *malloc(size_t size)
{
    find_all();
    return fails() ? NULL : real_malloc(size);
}

void *calloc(size_t n, size_t size)
{
    find_all();
    return fails() ? NULL : real_calloc(n, size);
}

void *realloc(void *memory, size_t size)
{
    find_all();
    return fails() ? NULL : real_realloc(memory, size);
}

/* ---- system calls: a filter stops the call, the tracer changes or answers it ---- */

struct request {
    char kind;
    long number, what; /* of a system call */
    unsigned long first, span;
};

struct outcome {
    int status, left;
    unsigned long seen;
    bool hit;
    unsigned long argument[6];
    char about[EXCERPT];
    unsigned count[SYSCALLS];
};

static void install_filter(long number)
{
    struct sock_filter one[] = {
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr)),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, (unsigned)number, 0, 1),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRACE),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
    };
    struct sock_filter all[] = {BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRACE)};
    struct sock_fprog program = {number < 0 ? 1 : 4, number < 0 ? all : one};

    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) ||
        prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program)) {
        _exit(125);
    }
}

/* Processes that became another program, with their children: what those call is not ours. */
struct foreign {
    pid_t pid[FOREIGN];
    size_t count;
};

static bool is_foreign(const struct foreign *foreign, pid_t pid)
{
    for (size_t i = 0; i < foreign->count; i++) {
        if (foreign->pid[i] == pid) {
            return true;
        }
    }
    return false;
}

static void add_foreign(struct foreign *foreign, pid_t pid)
{
    if (foreign->count < FOREIGN && !is_foreign(foreign, pid)) {
        foreign->pid[foreign->count++] = pid;
    }
}

#if defined(__x86_64__)

static bool read_text(pid_t pid, unsigned long address, char *text, size_t size)
{
    struct iovec here = {text, size - 1}, there = {(void *)address, size - 1};
    ssize_t length;

    /* not over the end of a page, which may be that of the mapping */
    there.iov_len = address % 4096 + size - 1 > 4096 ? 4096 - address % 4096 : size - 1;
    length = process_vm_readv(pid, &here, 1, &there, 1, 0);
    if (length <= 0) {
        return false;
    }
    text[length] = '\0';
    for (char *c = text; *c; c++) {
        if (*c < ' ' || *c > '~') {
            *c = '\0';
        }
    }
    return strlen(text) > 1;
}

static bool is_event(pid_t pid, unsigned long descriptor)
{
    char path[64], target[64] = "";

    snprintf(path, sizeof path, "/proc/%d/fd/%lu", (int)pid, descriptor);
    return readlink(path, target, sizeof target - 1) > 0 && strstr(target, "eventfd");
}

/* At the stop before a call: counts it, and when it is its turn has it fail or shortens it. */
static void intercept(pid_t pid, const struct request *request, struct outcome *outcome)
{
    struct user_regs_struct regs;
    long number;

    if (ptrace(PTRACE_GETREGS, pid, NULL, &regs)) {
        return;
    }
    number = (long)regs.orig_rax;
    if (request->number < 0) {
        outcome->count[number >= 0 && number < SYSCALLS ? number : SYSCALLS - 1]++;
        return;
    }
    if (number == SYS_write && is_event(pid, regs.rdi)) {
        return; /* which cannot fail: its counter is far from its limit */
    }
    outcome->seen++;
    if (!within(outcome->seen, request->first, request->span)) {
        return;
    }
    outcome->hit = true;
    memcpy(outcome->argument,
           (unsigned long[]){regs.rdi, regs.rsi, regs.rdx, regs.r10, regs.r8, regs.r9},
           sizeof outcome->argument);
    if (!read_text(pid, regs.rdi, outcome->about, sizeof outcome->about) &&
        !read_text(pid, regs.rsi, outcome->about, sizeof outcome->about)) {
        outcome->about[0] = '\0';
    }
    if (request->what < 0) {
        regs.rdx = regs.rdx / 2 + (regs.rdx == 1);
    } else {
        regs.orig_rax = (unsigned long)-1;
        regs.rax = (unsigned long)-request->what;
    }
    ptrace(PTRACE_SETREGS, pid, NULL, &regs);
}

static const bool traceable = true;

#else

static void intercept(pid_t pid, const struct request *request, struct outcome *outcome)
{
    (void)pid, (void)request, (void)outcome;
}

static const bool traceable = false;

#endif

/* What a stop of a traced process asks for; returns the signal to pass on to it. */
static int handle_stop(pid_t pid, int status, const struct request *request,
                       struct foreign *foreign, struct outcome *outcome)
{
    unsigned long message = 0;
    int number = WSTOPSIG(status);

    switch (status >> 16) {
    case 0:
        return number == SIGSTOP ? 0 : number;
    case PTRACE_EVENT_SECCOMP:
        if (!is_foreign(foreign, pid)) {
            intercept(pid, request, outcome);
        }
        return 0;
    case PTRACE_EVENT_EXEC:
        add_foreign(foreign, pid);
        return 0;
    case PTRACE_EVENT_CLONE:
    case PTRACE_EVENT_FORK:
    case PTRACE_EVENT_VFORK:
        ptrace(PTRACE_GETEVENTMSG, pid, NULL, &message);
        if (is_foreign(foreign, pid)) {
            add_foreign(foreign, (pid_t)message);
        }
        return 0;
    default:
        return 0;
    }
}

/* Until every process of the run has ended; those that outlive the first by much are killed. */
static void supervise(pid_t main_pid, const struct request *request, struct outcome *outcome)
{
    struct foreign foreign = {.count = 0};
    bool ended = false;
    int tries = 0, status;

    for (;;) {
        pid_t pid = waitpid(-1, &status, __WALL | (ended ? WNOHANG : 0));

        if (pid < 0 && errno == ECHILD) {
            return;
        }
        if (pid == 0) {
            /* a thread or child whose end is still on its way is not left over */
            usleep(2000);
            if (++tries == LEFT_OVER_TRIES) {
                outcome->left++;
                kill(-main_pid, SIGKILL);
            }
            if (tries > 2 * LEFT_OVER_TRIES) {
                return;
            }
        } else if (pid > 0 && WIFSTOPPED(status)) {
            int number = handle_stop(pid, status, request, &foreign, outcome);

            ptrace(PTRACE_CONT, pid, NULL, (long)number);
        } else if (pid == main_pid) {
            ended = true;
            outcome->status = status;
        }
    }
}

/* ---- the server ---- */

static int (*program_main)(int, char **, char **);

static void say(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* stdio is left as the program finds it */
static void say(const char *format, ...)
{
    static char text[8192];
    va_list arguments;
    int length;

    va_start(arguments, format);
    length = vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    for (int at = 0; at < length;) {
        ssize_t wrote = write(STDOUT_FILENO, text + at, (size_t)(length - at));

        if (wrote <= 0) {
            _exit(124);
        }
        at += (int)wrote;
    }
}

static bool redirect(const char *folder, const char *name, int flags, int to)
{
    char path[4096];
    int descriptor;

    snprintf(path, sizeof path, "%s/%s", folder, name);
    descriptor = open(path, flags, 0600);
    if (descriptor < 0 || dup2(descriptor, to) < 0) {
        return false;
    }
    return close(descriptor) == 0;
}

static void prepare_run(const char *root, const struct request *request)
{
    char path[4096];
    const int create = O_WRONLY | O_CREAT | O_TRUNC | O_APPEND;

    setpgid(0, 0);
    snprintf(path, sizeof path, "%s/work", root);
    if (chdir(path) || !redirect("/dev", "null", O_RDONLY, 0) ||
        !redirect(root, "out", create, 1) || !redirect(root, "err", create, 2)) {
        _exit(125);
    }
    alarm(RUN_LIMIT_S);
    if (request->kind == 'a') {
        shared->first = request->first;
        shared->span = request->span;
        return;
    }
    shared = &idle;
    if (ptrace(PTRACE_TRACEME, 0, NULL, NULL) || raise(SIGSTOP)) {
        _exit(125);
    }
    install_filter(request->number);
}

static void report(const struct request *request, const struct outcome *outcome)
{
    const int status = outcome->status;

    say("%s %d seen %lu left %d", WIFEXITED(status) ? "exit" : "signal",
        WIFEXITED(status) ? WEXITSTATUS(status) : WTERMSIG(status),
        request->kind == 'a' ? (unsigned long)shared->count : outcome->seen, outcome->left);
    for (size_t i = 0; request->kind == 'a' && !request->first && i < PLACES; i++) {
        if (shared->place[i].hash) {
            say(" %lu", shared->place[i].n);
        }
    }
    for (int i = 0; request->kind == 'a' && i < shared->depth; i++) {
        Dl_info info;

        if (dladdr(shared->frame[i], &info) && info.dli_fname) {
            say(" %s+0x%lx", info.dli_fname,
                (unsigned long)((char *)shared->frame[i] - (char *)info.dli_fbase));
        }
    }
    for (int i = 0; request->kind == 's' && request->number < 0 && i < SYSCALLS; i++) {
        if (outcome->count[i]) {
            say(" %d:%u", i, outcome->count[i]);
        }
    }
    if (outcome->hit) {
        say(" (%lx, %lx, %lx, %lx) %s", outcome->argument[0], outcome->argument[1],
            outcome->argument[2], outcome->argument[3], outcome->about);
    }
    say("\n");
}

/* True in the process that is to go on with main. */
static bool serve(const char *root, const struct request *request)
{
    static struct outcome outcome;
    const long options = PTRACE_O_TRACESECCOMP | PTRACE_O_TRACECLONE | PTRACE_O_TRACEFORK |
                         PTRACE_O_TRACEVFORK | PTRACE_O_TRACEEXEC | PTRACE_O_EXITKILL;
    pid_t pid;
    int status;

    memset(&outcome, 0, sizeof outcome);
    memset(shared, 0, sizeof *shared);
    pid = fork();
    if (pid == 0) {
        prepare_run(root, request);
        return true;
    }
    if (request->kind == 's') {
        waitpid(pid, &status, WUNTRACED);
        ptrace(PTRACE_SETOPTIONS, pid, NULL, options);
        ptrace(PTRACE_CONT, pid, NULL, 0);
    }
    supervise(pid, request, &outcome);
    report(request, &outcome);
    return false;
}

static bool read_line(char *line, size_t size)
{
    size_t used = 0;

    while (used + 1 < size && read(STDIN_FILENO, line + used, 1) == 1) {
        if (line[used++] == '\n') {
            line[used] = '\0';
            return true;
        }
    }
    return false;
}

static int server_main(int argc, char **argv, char **environment)
{
    const char *root = getenv("FAIL_NTH_ROOT");
    struct shared *both =
        mmap(NULL, sizeof *both, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    void *frame[DEPTH];
    char line[256];

    /* the first backtrace loads a library, which is not the program's doing */
    if (!root || both == MAP_FAILED || backtrace(frame, DEPTH) < 1) {
        return 125;
    }
    shared = both;
    unsetenv("LD_PRELOAD");
    /* orphans of a run come to us */
    prctl(PR_SET_CHILD_SUBREAPER, 1);
    while (read_line(line, sizeof line)) {
        struct request request = {.number = -1};

        if (sscanf(line, "a %lu %lu", &request.first, &request.span) == 2) {
            request.kind = 'a';
        } else if (traceable && sscanf(line, "s %ld %lu %lu %ld", &request.number, &request.first,
                                       &request.span, &request.what) == 4) {
            request.kind = 's';
        } else {
            say("unsupported\n");
            continue;
        }
        if (serve(root, &request)) {
            return program_main(argc, argv, environment);
        }
    }
    return 0;
}

typedef int main_function(int, char **, char **);

int __libc_start_main(main_function *entry, int argc, char **argv, void (*init)(void),
                      void (*fini)(void), void (*rtld_fini)(void), void *stack_end);

int __libc_start_main(main_function *entry, int argc, char **argv, void (*init)(void),
                      void (*fini)(void), void (*rtld_fini)(void), void *stack_end)
{
    int (*real)(main_function *, int, char **, void (*)(void), void (*)(void), void (*)(void),
                void *);

    find(&real, "__libc_start_main");
    program_main = entry;
    return real(server_main, argc, argv, init, fini, rtld_fini, stack_end);
}
