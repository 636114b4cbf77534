/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reset and exceptions of a Cortex-A53 at EL1, one core, without an MMU: the stack, vectors, the
 * floating-point unit, zeroed data; an interrupt handler that saves what a C function may change
 * (interrupt handlers are compiled without floating point); anything else is fatal.
 */
    .section .text.start, "ax"
    .global _start, machine_restart
_start:
machine_restart:
    msr     daifset, #0xf
    ldr     x0, =stack_top
    mov     sp, x0
    ldr     x0, =vectors
    msr     vbar_el1, x0
    mov     x0, #(3 << 20)              /* CPACR_EL1.FPEN: no trap */
    msr     cpacr_el1, x0
    isb
    ldr     x0, =bss_start
    ldr     x1, =bss_end
1:  cmp     x0, x1
    b.hs    2f
    str     xzr, [x0], #8
    b       1b
2:  bl      main
3:  wfi
    b       3b

    .macro  fatal number
    .balign 128
    mov     x0, #\number
    mrs     x1, elr_el1
    mrs     x2, far_el1
    b       machine_fatal
    .endm

    .balign 2048
vectors:
    fatal   0
    fatal   1
    fatal   2
    fatal   3
    fatal   4                           /* synchronous, this level */
    .balign 128
    sub     sp, sp, #192                /* interrupt, this level */
    stp     x0, x1, [sp]
    stp     x2, x3, [sp, #16]
    stp     x4, x5, [sp, #32]
    stp     x6, x7, [sp, #48]
    stp     x8, x9, [sp, #64]
    stp     x10, x11, [sp, #80]
    stp     x12, x13, [sp, #96]
    stp     x14, x15, [sp, #112]
    stp     x16, x17, [sp, #128]
    stp     x18, x30, [sp, #144]
    b       interrupt_entry
    fatal   6
    fatal   7
    fatal   8
    fatal   9
    fatal   10
    fatal   11
    fatal   12
    fatal   13
    fatal   14
    fatal   15

interrupt_entry:
    mrs     x0, elr_el1
    mrs     x1, spsr_el1
    stp     x0, x1, [sp, #160]
    bl      interrupts_serve
    ldp     x0, x1, [sp, #160]
    msr     elr_el1, x0
    msr     spsr_el1, x1
    ldp     x2, x3, [sp, #16]
    ldp     x4, x5, [sp, #32]
    ldp     x6, x7, [sp, #48]
    ldp     x8, x9, [sp, #64]
    ldp     x10, x11, [sp, #80]
    ldp     x12, x13, [sp, #96]
    ldp     x14, x15, [sp, #112]
    ldp     x16, x17, [sp, #128]
    ldp     x18, x30, [sp, #144]
    ldp     x0, x1, [sp]
    add     sp, sp, #192
    eret
