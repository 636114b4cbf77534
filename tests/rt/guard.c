/* SPDX-License-Identifier: Apache-2.0 */
/* The state of the guard, what it says, and the symbols that it says it with. */
#include "guard.h"

#include <dlfcn.h>
#include <execinfo.h>
#include <fcntl.h>
#include <link.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

struct guard_state guard_state;
struct guard_program guard_program;

static __thread bool is_loop __attribute__((tls_model("initial-exec")));
static int log_descriptor = STDERR_FILENO;

bool guard_inside(void)
{
    return is_loop && guard_state.inside;
}

const char *guard_phase_name(int phase)
{
    static const char *const names[GUARD_PHASES] = {
        "wait", "receive", "boards", "plant", "sensors", "transmit", "publish",
    };

    return phase >= 0 && phase < GUARD_PHASES ? names[phase] : "?";
}

/* ---- what it says ---- */

static void print(const char *format, va_list args)
{
    char text[512];
    int size = vsnprintf(text, sizeof text, format, args);

    size = size < (int)sizeof text ? size : (int)sizeof text - 1;
    (void)!write(log_descriptor, text, (size_t)size);
}

void guard_print(const char *format, ...)
{
    va_list args;

    va_start(args, format);
    print(format, args);
    va_end(args);
}

void guard_fail(const char *format, ...)
{
    va_list args;

    guard_print("rt guard: ");
    va_start(args, format);
    print(format, args);
    va_end(args);
    guard_print("\n");
    _exit(99);
}

static bool is_own(uintptr_t address)
{
    Dl_info at, own;

    return dladdr((void *)address, &at) && dladdr(&guard_state, &own) &&
           at.dli_fbase == own.dli_fbase;
}

static void print_backtrace(void)
{
    void *frame[64];
    int count = backtrace(frame, 64);
    bool begun = false;

    for (int i = 0; i < count; i++) {
        uintptr_t address = (uintptr_t)frame[i] - 1;
        char place[128];

        begun |= !is_own(address);
        if (begun) {
            guard_place(address, place, sizeof place);
            guard_print("  %s\n", place);
        }
    }
}

void guard_violation(const char *format, ...)
{
    va_list args;

    guard_state.inside = false;
    guard_print("rt guard: VIOLATION in phase %s of tick %lld: ",
                guard_phase_name(guard_state.phase), (long long)guard_state.tick);
    va_start(args, format);
    print(format, args);
    va_end(args);
    guard_print("\n");
    print_backtrace();
    abort();
}

static void report(void)
{
    static const char *const clocks[] = {"real", "lockstep", "free"};

    guard_print("rt guard: clock %s, ticks %llu, probes %llu\n",
                guard_state.clock >= 0 && guard_state.clock < 3 ? clocks[guard_state.clock] : "?",
                (unsigned long long)guard_state.ticks, (unsigned long long)guard_state.probes);
    guard_report_syscalls();
    guard_report_faults();
}

/* ---- where the loop is ---- */

void guard_event(enum guard_event event, int64_t a, int64_t b)
{
    (void)b;
    guard_state.probes++;
    switch (event) {
    case RUN_BEGIN:
        is_loop = true;
        guard_state.clock = a;
        guard_state.phase = 0;
        guard_state.tick = 0;
        guard_watch_calls();
        guard_watch_syscalls();
        guard_watch_faults();
        guard_state.runs++;
        guard_state.inside = true;
        break;
    case TICK_BEGIN:
        guard_state.tick = a;
        break;
    case PHASE_END:
        guard_count_faults((int)a);
        /* What follows the last phase is the account of the tick */
        guard_state.phase = a < GUARD_PHASES - 1 ? (int)a + 1 : (int)a;
        break;
    case TICK_END:
        guard_count_faults(guard_state.phase);
        guard_state.ticks++;
        guard_state.phase = 0;
        guard_state.tick = a + 1;
        break;
    case RUN_END:
        guard_count_faults(guard_state.phase);
        guard_state.inside = false;
        report();
        break;
    default:
        break;
    }
}

/* ---- the program ---- */

const Elf64_Shdr *guard_section(const char *name)
{
    const Elf64_Ehdr *header = (const void *)guard_program.file;
    const Elf64_Shdr *section = (const void *)(guard_program.file + header->e_shoff);
    const char *names = (const char *)guard_program.file + section[header->e_shstrndx].sh_offset;

    for (int i = 0; i < header->e_shnum; i++) {
        if (!strcmp(names + section[i].sh_name, name)) {
            return &section[i];
        }
    }
    return NULL;
}

void guard_place(uintptr_t address, char *text, size_t size)
{
    Dl_info info;

    for (size_t i = 0; i < guard_program.nsymbol; i++) {
        const Elf64_Sym *symbol = &guard_program.symbol[i];
        uintptr_t begin = symbol->st_value + guard_program.bias;

        if (symbol->st_value && address - begin < symbol->st_size) {
            snprintf(text, size, "%s+%#zx", guard_program.name + symbol->st_name, address - begin);
            return;
        }
    }
    if (dladdr((void *)address, &info) && info.dli_fname) {
        snprintf(text, size, "%s+%#zx", info.dli_fname, address - (uintptr_t)info.dli_fbase);
    } else {
        snprintf(text, size, "%#zx", address);
    }
}

/* The first object is the program */
static int note_bias(struct dl_phdr_info *info, size_t size, void *unused)
{
    (void)size;
    (void)unused;
    guard_program.bias = info->dlpi_addr;
    return 1;
}

void guard_open_program(void)
{
    int descriptor = open("/proc/self/exe", O_RDONLY | O_CLOEXEC);
    const Elf64_Shdr *symbols, *names;
    struct stat about;
    void *file;

    if (descriptor < 0 || fstat(descriptor, &about)) {
        guard_fail("cannot open the program");
    }
    file = mmap(NULL, (size_t)about.st_size, PROT_READ, MAP_PRIVATE, descriptor, 0);
    close(descriptor);
    if (file == MAP_FAILED || memcmp(file, ELFMAG, SELFMAG)) {
        guard_fail("cannot read the program");
    }
    guard_program.file = file;
    guard_program.size = (size_t)about.st_size;
    dl_iterate_phdr(note_bias, NULL);
    symbols = guard_section(".symtab");
    names = guard_section(".strtab");
    if (symbols && names) {
        guard_program.symbol = (const void *)(guard_program.file + symbols->sh_offset);
        guard_program.nsymbol = symbols->sh_size / sizeof(Elf64_Sym);
        guard_program.name = (const char *)guard_program.file + names->sh_offset;
    }
}

/* Only a program with our probes is watched: a shell that runs it inherits the environment. */
static void __attribute__((constructor)) begin(void)
{
    const char *log = getenv("RT_GUARD_LOG");
    void *frame[2];

    guard_open_program();
    if (!guard_section(".note.stapsdt")) {
        return;
    }
    if (log) {
        log_descriptor = open(log, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
        if (log_descriptor < 0) {
            _exit(99);
        }
    }
    backtrace(frame, 2); /* loads what it needs, which it would do at the first use */
    guard_plant_probes();
}
