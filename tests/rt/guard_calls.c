/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Calls out of the program. What the program imports it calls through a table of addresses that the
 * dynamic linker has filled in (the global offset table); for each name that is not on the list
 * below the guard puts a doorstep of its own there, which looks whether the caller is in the loop
 * and goes on to the function when it is not. So nothing must be known about what a function takes
 * and returns, and a function that nobody has thought of is not allowed.
 *
 * Patched are the program, modules that it has loaded, and the C library, whose own calls of malloc
 * and its kin go over such a table too. Other libraries are entered only through the program's
 * table.
 */
#include "guard.h"

#include <dlfcn.h>
#include <link.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

enum { CALLS_MAX = 2048 };

/* Harmless: they look at their arguments and at nothing else. The system calls at the end are
 * judged by guard_syscalls.c. */
static const char *const allowed[] = {
    "memchr",
    "memcmp",
    "memcpy",
    "memmove",
    "memset",
    "strchr",
    "strcmp",
    "strcpy",
    "strlen",
    "strncmp",
    "strncpy",
    "strnlen",
    "strrchr",
    "__errno_location",
    /* Text in memory: no lock and no output; should it ever allocate, the C library's own call of
     * malloc is seen */
    "snprintf",
    "vsnprintf",
    /* Mathematics */
    "acos",
    "asin",
    "atan",
    "atan2",
    "cbrt",
    "ceil",
    "cos",
    "exp",
    "expm1",
    "floor",
    "fmax",
    "fmin",
    "fmod",
    "hypot",
    "ldexp",
    "log",
    "log10",
    "log1p",
    "lround",
    "pow",
    "remainder",
    "round",
    "sin",
    "sincos",
    "sqrt",
    "tan",
    "trunc",
    /* The clock: no system call on a kernel with a vDSO, and counted when it is one */
    "clock_gettime",
    /* System calls */
    "clock_nanosleep",
    "getsockopt",
    "nanosleep",
    "poll",
    "ppoll",
    "read",
    "recvmmsg",
    "sendmmsg",
    "write",
};

/* What the doorsteps know; the names are used in the assembly below */
void *guard_target[CALLS_MAX];
static const char *call_name[CALLS_MAX];
static size_t ncall;
static bool watched;

void guard_call_seen(uint64_t index);

/* Doorstep i puts i into r11, which belongs to the linker between caller and function, and jumps to
 * `judge`; that saves all that may hold an argument, asks, and goes on. */
__asm__(".text\n"
        ".balign 16\n"
        ".globl guard_doorstep\n"
        ".hidden guard_doorstep\n"
        "guard_doorstep:\n"
        ".set i, 0\n"
        ".rept 2048\n"
        "    movl $i, %r11d\n"
        "    jmp judge\n"
        ".balign 16\n"
        ".set i, i + 1\n"
        ".endr\n"
        "judge:\n"
        "    .cfi_startproc\n"
        "    pushq %rbp\n"
        "    .cfi_adjust_cfa_offset 8\n"
        "    .cfi_rel_offset rbp, 0\n"
        "    movq %rsp, %rbp\n"
        "    .cfi_def_cfa_register rbp\n"
        "    subq $256, %rsp\n"
        "    andq $-64, %rsp\n"
        "    movq %rax, 0(%rsp)\n"
        "    movq %rdi, 8(%rsp)\n"
        "    movq %rsi, 16(%rsp)\n"
        "    movq %rdx, 24(%rsp)\n"
        "    movq %rcx, 32(%rsp)\n"
        "    movq %r8, 40(%rsp)\n"
        "    movq %r9, 48(%rsp)\n"
        "    movq %r10, 56(%rsp)\n"
        "    movq %r11, 64(%rsp)\n"
        "    movaps %xmm0, 80(%rsp)\n"
        "    movaps %xmm1, 96(%rsp)\n"
        "    movaps %xmm2, 112(%rsp)\n"
        "    movaps %xmm3, 128(%rsp)\n"
        "    movaps %xmm4, 144(%rsp)\n"
        "    movaps %xmm5, 160(%rsp)\n"
        "    movaps %xmm6, 176(%rsp)\n"
        "    movaps %xmm7, 192(%rsp)\n"
        "    movq %r11, %rdi\n"
        "    call guard_call_seen@PLT\n"
        "    movaps 80(%rsp), %xmm0\n"
        "    movaps 96(%rsp), %xmm1\n"
        "    movaps 112(%rsp), %xmm2\n"
        "    movaps 128(%rsp), %xmm3\n"
        "    movaps 144(%rsp), %xmm4\n"
        "    movaps 160(%rsp), %xmm5\n"
        "    movaps 176(%rsp), %xmm6\n"
        "    movaps 192(%rsp), %xmm7\n"
        "    movq 0(%rsp), %rax\n"
        "    movq 8(%rsp), %rdi\n"
        "    movq 16(%rsp), %rsi\n"
        "    movq 24(%rsp), %rdx\n"
        "    movq 32(%rsp), %rcx\n"
        "    movq 40(%rsp), %r8\n"
        "    movq 48(%rsp), %r9\n"
        "    movq 56(%rsp), %r10\n"
        "    movq 64(%rsp), %r11\n"
        "    leave\n"
        "    .cfi_def_cfa rsp, 8\n"
        "    shlq $3, %r11\n"
        "    addq guard_target@GOTPCREL(%rip), %r11\n"
        "    jmp *(%r11)\n"
        "    .cfi_endproc\n");

extern const unsigned char guard_doorstep[];

void guard_call_seen(uint64_t index)
{
    if (guard_inside()) {
        guard_violation("calls %s", call_name[index]);
    }
}

/* Whether the two are one name, or the second is the first with its buffer's size checked: what
 * _FORTIFY_SOURCE makes of memcpy is __memcpy_chk. */
static bool is_same_function(const char *plain, const char *name)
{
    size_t length = strlen(plain);

    return !strcmp(plain, name) || (!strncmp(name, "__", 2) && !strncmp(name + 2, plain, length) &&
                                    !strcmp(name + 2 + length, "_chk"));
}

static bool is_allowed(const char *name)
{
    for (size_t i = 0; i < sizeof allowed / sizeof allowed[0]; i++) {
        if (is_same_function(allowed[i], name)) {
            return true;
        }
    }
    return false;
}

/* ---- the tables of one object ---- */

struct object {
    uintptr_t bias;
    const Elf64_Sym *symbol;
    const char *string;
    const Elf64_Rela *table[2]; /* of functions, of everything */
    size_t size[2];
    bool bind_now;
};

static struct object read_object(uintptr_t bias, const Elf64_Dyn *entry)
{
    struct object object = {.bias = bias};

    for (; entry->d_tag != DT_NULL; entry++) {
        /* The dynamic linker has turned these into addresses */
        const void *pointer = (const void *)entry->d_un.d_ptr;

        switch (entry->d_tag) {
        case DT_SYMTAB:
            object.symbol = pointer;
            break;
        case DT_STRTAB:
            object.string = pointer;
            break;
        case DT_JMPREL:
            object.table[0] = pointer;
            break;
        case DT_PLTRELSZ:
            object.size[0] = entry->d_un.d_val / sizeof(Elf64_Rela);
            break;
        case DT_RELA:
            object.table[1] = pointer;
            break;
        case DT_RELASZ:
            object.size[1] = entry->d_un.d_val / sizeof(Elf64_Rela);
            break;
        case DT_FLAGS:
            object.bind_now |= (entry->d_un.d_val & DF_BIND_NOW) != 0;
            break;
        case DT_FLAGS_1:
            object.bind_now |= (entry->d_un.d_val & DF_1_NOW) != 0;
            break;
        default:
            break;
        }
    }
    return object;
}

static void redirect(void **slot, const char *name, void *target)
{
    uintptr_t page = (uintptr_t)sysconf(_SC_PAGESIZE), start = (uintptr_t)slot / page * page;

    if (ncall == CALLS_MAX) {
        guard_fail("more than %d imported functions", CALLS_MAX);
    }
    call_name[ncall] = name;
    guard_target[ncall] = target;
    if (mprotect((void *)start, page, PROT_READ | PROT_WRITE)) {
        guard_fail("cannot write the table of %s", name);
    }
    *slot = (void *)(uintptr_t)&guard_doorstep[16 * ncall++];
}

static void patch(const struct object *object)
{
    for (int t = 0; t < 2; t++) {
        for (size_t i = 0; i < object->size[t]; i++) {
            const Elf64_Rela *entry = &object->table[t][i];
            const Elf64_Sym *symbol = &object->symbol[ELF64_R_SYM(entry->r_info)];
            void **slot = (void **)(object->bias + entry->r_offset);
            const char *name = object->string + symbol->st_name;
            uint64_t type = ELF64_R_TYPE(entry->r_info);

            if ((type == R_X86_64_JUMP_SLOT || type == R_X86_64_GLOB_DAT) &&
                ELF64_ST_TYPE(symbol->st_info) == STT_FUNC && !is_allowed(name)) {
                /* A slot that is not bound yet holds the way to the linker */
                void *target = object->bind_now ? *slot : dlsym(RTLD_DEFAULT, name);

                if (target) {
                    redirect(slot, name, target);
                }
            }
        }
    }
}

/* ---- the objects ---- */

struct objects {
    size_t index, at_start; /* at_start: those that were there before main */
};

static const Elf64_Dyn *dynamic_of(const struct dl_phdr_info *info)
{
    for (int i = 0; i < info->dlpi_phnum; i++) {
        if (info->dlpi_phdr[i].p_type == PT_DYNAMIC) {
            return (const Elf64_Dyn *)(info->dlpi_addr + info->dlpi_phdr[i].p_vaddr);
        }
    }
    return NULL;
}

static int count(struct dl_phdr_info *info, size_t size, void *context)
{
    struct objects *objects = context;

    (void)info;
    (void)size;
    objects->at_start++;
    return 0;
}

/* Checks whether a loaded object is a library, which a module has brought with it. */
static bool is_library(const char *path)
{
    const char *slash = strrchr(path, '/');

    return strncmp(slash ? slash + 1 : path, "lib", 3) == 0;
}

static int visit(struct dl_phdr_info *info, size_t size, void *context)
{
    struct objects *objects = context;
    bool program = objects->index == 0;
    bool module = objects->index >= objects->at_start && !is_library(info->dlpi_name);
    const Elf64_Dyn *dynamic = dynamic_of(info);
    struct object object;

    (void)size;
    objects->index++;
    if (!dynamic || !(program || module || strstr(info->dlpi_name, "/libc.so"))) {
        return 0;
    }
    object = read_object(info->dlpi_addr, dynamic);
    guard_program.bind_now |= program && object.bind_now;
    patch(&object);
    return 0;
}

static struct objects objects;

static void __attribute__((constructor)) count_objects(void)
{
    dl_iterate_phdr(count, &objects);
}

void guard_watch_calls(void)
{
    if (watched) {
        return;
    }
    watched = true;
    dl_iterate_phdr(visit, &objects);
    if (!guard_program.bind_now) {
        guard_violation("functions are looked up at their first call (link with -z now)");
    }
}
