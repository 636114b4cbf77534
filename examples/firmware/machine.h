/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The machine: a Xilinx ZynqMP (board ZCU102), of which one Cortex-A53, the interrupt controller,
 * the UART, the core's timer and two CAN controllers are used. Register names are those of the
 * Technical Reference Manual (UG1085, UG1087) and of Arm's GICv2.
 */
#ifndef MACHINE_H
#define MACHINE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define COUNT_OF(array) (sizeof(array) / sizeof *(array))

static inline uint32_t register_read(uintptr_t address)
{
    return *(volatile uint32_t *)address;
}

static inline void register_write(uintptr_t address, uint32_t value)
{
    *(volatile uint32_t *)address = value;
}

/* ---- interrupts ---- */

static inline void interrupts_disable(void)
{
    __asm__ volatile("msr daifset, #2" ::: "memory");
}

static inline void interrupts_enable(void)
{
    __asm__ volatile("msr daifclr, #2" ::: "memory");
}

/* Sleeps until an interrupt is pending, also one that is disabled. */
static inline void interrupts_await(void)
{
    __asm__ volatile("dsb sy\n wfi" ::: "memory");
}

/* The controller with every interrupt off. */
void interrupts_init(void);

/* Has handler called for an interrupt of the controller, with interrupts disabled. */
void interrupts_connect(unsigned number, void (*handler)(void *context), void *context);

/* ---- console ---- */

void console_init(void);
void console_print(const char *text);
void console_print_number(int32_t value);

/* ---- watchdog ---- */

/* Starts the program again when it is not fed for so long; the first call starts it. */
void watchdog_feed(void);

/* How often it has; 0 after power-up. */
unsigned watchdog_restarts(void);

#endif
