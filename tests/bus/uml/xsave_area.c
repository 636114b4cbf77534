/* SPDX-License-Identifier: Apache-2.0 */
/* Prints the size in bytes of this machine's XSAVE area (CPUID leaf 0xD), 0 when it has none: what
 * PTRACE_SETREGSET(NT_X86_XSTATE) wants. */
#include <cpuid.h>
#include <stdio.h>

int main(void)
{
    unsigned eax = 0, size = 0, ecx, edx;

    if (!__get_cpuid_count(0xD, 0, &eax, &size, &ecx, &edx)) {
        size = 0;
    }
    printf("%u\n", size);
    return 0;
}
