/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Breakpoints on the program's tracepoints. The notes of <sys/sdt.h> say where each nop is and
 * where its arguments are ("-4@%esi", "8@-40(%rbp)", "-4@$3"); what the kernel does for perf with a
 * uprobe is done here in the process.
 */
#include "guard.h"

#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

enum { SITES_MAX = 64, NOP = 0x90, BREAKPOINT = 0xcc };

struct site {
    uintptr_t address;
    enum guard_event event;
    const char *arguments;
};

static struct site site[SITES_MAX];
static size_t nsite;

/* ---- arguments ---- */

static const struct {
    const char *name[4]; /* of 8, 4, 2 and 1 bytes */
    int index;
} registers[] = {
    {{"rax", "eax", "ax", "al"}, REG_RAX},      {{"rbx", "ebx", "bx", "bl"}, REG_RBX},
    {{"rcx", "ecx", "cx", "cl"}, REG_RCX},      {{"rdx", "edx", "dx", "dl"}, REG_RDX},
    {{"rsi", "esi", "si", "sil"}, REG_RSI},     {{"rdi", "edi", "di", "dil"}, REG_RDI},
    {{"rbp", "ebp", "bp", "bpl"}, REG_RBP},     {{"rsp", "esp", "sp", "spl"}, REG_RSP},
    {{"r8", "r8d", "r8w", "r8b"}, REG_R8},      {{"r9", "r9d", "r9w", "r9b"}, REG_R9},
    {{"r10", "r10d", "r10w", "r10b"}, REG_R10}, {{"r11", "r11d", "r11w", "r11b"}, REG_R11},
    {{"r12", "r12d", "r12w", "r12b"}, REG_R12}, {{"r13", "r13d", "r13w", "r13b"}, REG_R13},
    {{"r14", "r14d", "r14w", "r14b"}, REG_R14}, {{"r15", "r15d", "r15w", "r15b"}, REG_R15},
};

/* Reads "%NAME" and moves past it */
static int64_t read_register(const char **text, const greg_t *greg)
{
    size_t length = strcspn(++*text, " ,)");

    for (size_t i = 0; i < sizeof registers / sizeof registers[0]; i++) {
        for (int k = 0; k < 4; k++) {
            const char *name = registers[i].name[k];

            if (strlen(name) == length && !strncmp(*text, name, length)) {
                *text += length;
                return greg[registers[i].index];
            }
        }
    }
    guard_fail("cannot read the argument of a probe: %s", *text);
}

/* size: negative = signed */
static int64_t narrow(int64_t value, int size)
{
    switch (size) {
    case -4:
        return (int32_t)value;
    case 4:
        return (uint32_t)value;
    case -1:
        return (int8_t)value;
    case 1:
        return (uint8_t)value;
    default:
        return value;
    }
}

/* Reads "OFFSET(%BASE,%INDEX,SCALE)" */
static int64_t read_memory(const char **text, const greg_t *greg)
{
    char *rest;
    int64_t address = strtoll(*text, &rest, 10), value;

    if (*rest != '(') {
        guard_fail("cannot read the argument of a probe: %s", *text);
    }
    *text = rest + 1;
    address += **text == '%' ? read_register(text, greg) : 0;
    if (**text == ',') {
        int64_t index;

        ++*text;
        index = read_register(text, greg);
        address += index * (**text == ',' ? strtoll(*text + 1, NULL, 10) : 1);
    }
    *text += strcspn(*text, ")") + 1;
    memcpy(&value, (const void *)(uintptr_t)address, sizeof value);
    return value;
}

/* Reads "SIZE@WHERE" and moves behind the blank after it */
static int64_t read_argument(const char **text, const greg_t *greg)
{
    char *rest;
    int size = (int)strtol(*text, &rest, 10);
    int64_t value;

    *text = rest + 1;
    if (**text == '$') {
        value = strtoll(*text + 1, &rest, 10);
        *text = rest;
    } else if (**text == '%') {
        value = read_register(text, greg);
    } else {
        value = read_memory(text, greg);
    }
    *text += **text == ' ';
    return narrow(value, size);
}

/* ---- breakpoints ---- */

void guard_on_breakpoint(int number, siginfo_t *info, void *context)
{
    ucontext_t *at = context;
    uintptr_t address = (uintptr_t)at->uc_mcontext.gregs[REG_RIP] - 1;

    (void)number;
    (void)info;
    for (size_t i = 0; i < nsite; i++) {
        if (site[i].address == address) {
            const char *text = site[i].arguments;
            int64_t a = read_argument(&text, at->uc_mcontext.gregs);
            int64_t b = read_argument(&text, at->uc_mcontext.gregs);

            guard_event(site[i].event, a, b);
            return;
        }
    }
    guard_fail("a breakpoint that is not ours");
}

static void plant(const struct site *at)
{
    uintptr_t page = (uintptr_t)sysconf(_SC_PAGESIZE), start = at->address / page * page;
    unsigned char *code = (unsigned char *)at->address;

    if (mprotect((void *)start, page, PROT_READ | PROT_WRITE | PROT_EXEC)) {
        guard_fail("cannot write a breakpoint");
    }
    if (*code != NOP) {
        guard_fail("there is no nop at a probe");
    }
    *code = BREAKPOINT;
    mprotect((void *)start, page, PROT_READ | PROT_EXEC);
}

/* One note: three addresses, then provider, name and arguments as strings */
static void read_note(const unsigned char *text)
{
    static const char *const names[GUARD_EVENTS] = {"run_begin", "tick_begin", "phase_end",
                                                    "tick_end", "run_end"};
    const char *provider = (const char *)text + 3 * sizeof(Elf64_Addr);
    const char *name = provider + strlen(provider) + 1;
    Elf64_Addr address;

    memcpy(&address, text, sizeof address);
    for (int e = 0; e < GUARD_EVENTS && !strcmp(provider, "coman_hil"); e++) {
        if (!strcmp(name, names[e])) {
            if (nsite == SITES_MAX) {
                guard_fail("more than %d probes", SITES_MAX);
            }
            site[nsite++] = (struct site){address + guard_program.bias, (enum guard_event)e,
                                          name + strlen(name) + 1};
        }
    }
}

void guard_plant_probes(void)
{
    const Elf64_Shdr *section = guard_section(".note.stapsdt");
    const unsigned char *at = guard_program.file + section->sh_offset, *end = at + section->sh_size;

    while (at < end) {
        const Elf64_Nhdr *note = (const void *)at;
        size_t name = (note->n_namesz + 3) / 4 * 4, text = (note->n_descsz + 3) / 4 * 4;

        read_note(at + sizeof *note + name);
        at += sizeof *note + name + text;
    }
    guard_handle(SIGTRAP, guard_entry_breakpoint);
    for (size_t i = 0; i < nsite; i++) {
        plant(&site[i]);
    }
}
