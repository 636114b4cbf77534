/* SPDX-License-Identifier: Apache-2.0 */
/* The interrupt controller (GICv2), the console (UART 0) and a watchdog on the core's timer. */
#include "machine.h"

enum { GICD_CTLR = 0xf9010000, GICD_ISENABLER = GICD_CTLR + 0x100 };
enum { GICD_ICENABLER = GICD_CTLR + 0x180, GICD_IPRIORITYR = GICD_CTLR + 0x400 };
enum { GICD_ITARGETSR = GICD_CTLR + 0x800 };
enum { GICC_CTLR = 0xf9020000, GICC_PMR = GICC_CTLR + 4, GICC_IAR = GICC_CTLR + 12 };
enum { GICC_EOIR = GICC_CTLR + 16, SPURIOUS = 1020, INTERRUPTS = 192, SHARED = 32 };

enum { UART_CR = 0xff000000, UART_MR = UART_CR + 4, UART_SR = UART_CR + 0x2c };
enum { UART_FIFO = UART_CR + 0x30, UART_TX_FULL = 1 << 4 };

enum { TIMER_INTERRUPT = 30, WATCHDOG_S = 5 };
enum { RESTARTS_KNOWN = 0x57415443 };

static struct {
    void (*handler)(void *context);
    void *context;
} connected[INTERRUPTS];

/* Not zeroed by a restart. */
static struct {
    uint32_t known, count;
} restarts __attribute__((section(".noinit")));

void machine_restart(void);
void machine_fatal(unsigned vector, uint64_t address, uint64_t data);
void interrupts_serve(void);

/* ---- interrupts ---- */

void interrupts_init(void)
{
    register_write(GICD_CTLR, 0);
    for (unsigned i = 0; i < INTERRUPTS / 32; i++) {
        register_write(GICD_ICENABLER + 4 * i, UINT32_MAX);
    }
    register_write(GICC_PMR, 0xff);
    register_write(GICC_CTLR, 1);
    register_write(GICD_CTLR, 1);
}

void interrupts_connect(unsigned number, void (*handler)(void *context), void *context)
{
    volatile uint8_t *priority = (volatile uint8_t *)(uintptr_t)GICD_IPRIORITYR;
    volatile uint8_t *target = (volatile uint8_t *)(uintptr_t)GICD_ITARGETSR;

    connected[number].handler = handler;
    connected[number].context = context;
    priority[number] = 0x80;
    if (number >= SHARED) {
        target[number] = 1;
    }
    register_write(GICD_ISENABLER + 4 * (number / 32), UINT32_C(1) << number % 32);
}

/* Every interrupt that is pending, so that what was interrupted sees the result of all. */
void interrupts_serve(void)
{
    uint32_t taken;

    while ((taken = register_read(GICC_IAR)) < SPURIOUS) {
        if (taken < INTERRUPTS && connected[taken].handler) {
            connected[taken].handler(connected[taken].context);
        }
        register_write(GICC_EOIR, taken);
    }
}

/* ---- console ---- */

void console_init(void)
{
    register_write(UART_CR, 0x14); /* transmitter and receiver on */
    register_write(UART_MR, 0x20); /* 8N1 */
}

static void console_put(char c)
{
    while (register_read(UART_SR) & UART_TX_FULL) {
    }
    register_write(UART_FIFO, (uint8_t)c);
}

void console_print(const char *text)
{
    while (*text) {
        console_put(*text++);
    }
}

void console_print_number(int32_t value)
{
    uint32_t left = value < 0 ? -(uint32_t)value : (uint32_t)value;
    char digits[12];
    unsigned n = 0;

    do {
        digits[n++] = (char)('0' + left % 10);
        left /= 10;
    } while (left);
    if (value < 0) {
        digits[n++] = '-';
    }
    while (n > 0) {
        console_put(digits[--n]);
    }
}

void machine_fatal(unsigned vector, uint64_t address, uint64_t data)
{
    console_print("exception ");
    console_print_number((int32_t)vector);
    console_print(" at ");
    console_print_number((int32_t)address);
    console_print(", address ");
    console_print_number((int32_t)data);
    console_print("\n");
    for (;;) {
        interrupts_await();
    }
}

/* ---- watchdog ---- */

/* Not an interrupt to come back from: the controller is told that it is served, and the program
 * begins again. A watchdog with a reset line of its own would do the same to more of the chip. */
static void watchdog_bite(void *unused)
{
    (void)unused;
    restarts.count++;
    console_print("watchdog: the program hangs, restart\n");
    __asm__ volatile("msr cntp_ctl_el0, xzr");
    register_write(GICC_EOIR, TIMER_INTERRUPT);
    machine_restart();
}

void watchdog_feed(void)
{
    static bool runs;
    uint64_t frequency;

    __asm__ volatile("mrs %0, cntfrq_el0" : "=r"(frequency));
    __asm__ volatile("msr cntp_tval_el0, %0" ::"r"(frequency * WATCHDOG_S));
    if (!runs) {
        runs = true;
        interrupts_connect(TIMER_INTERRUPT, watchdog_bite, NULL);
        __asm__ volatile("msr cntp_ctl_el0, %0" ::"r"(UINT64_C(1)));
    }
}

unsigned watchdog_restarts(void)
{
    if (restarts.known != RESTARTS_KNOWN) {
        restarts.known = RESTARTS_KNOWN;
        restarts.count = 0;
    }
    return restarts.count;
}
