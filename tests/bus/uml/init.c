/* SPDX-License-Identifier: Apache-2.0 */
/*
 * First process of the guest that run.sh boots: prepares the machine, runs the command, powers off.
 * One static program, because user-mode Linux is slow at starting processes: as a script of some
 * forty commands this took longer than the kernel's own start.
 *
 * It reads from the folder HIL_WORK, strings that end in NUL each: "environment" has variables as
 * NAME=VALUE, "command" the command's words, before which an empty one says that the command takes
 * the place of this process. It writes "output" (the command's, or why there is none) and "status".
 */
#include <errno.h>
#include <fcntl.h>
#include <linux/netlink.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mount.h>
#include <sys/reboot.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/sysmacros.h>
#include <sys/utsname.h>
#include <sys/wait.h>
#include <unistd.h>

enum { TEXT_MAX = 65536, WORDS_MAX = 256, INTERFACES = 5, FAILED = 71 };

static const char *work;

/* ---- the end ---- */

/* Never returns: a first process that ends is a kernel panic. */
__attribute__((noreturn)) static void power_off(int status)
{
    char path[4096];
    FILE *file;

    snprintf(path, sizeof path, "%s/status", work);
    file = fopen(path, "w");
    if (file) {
        fprintf(file, "%d\n", status);
        fclose(file);
    }
    sync();
    reboot(RB_POWER_OFF);
    for (;;) {
        pause();
    }
}

__attribute__((noreturn, format(printf, 1, 2))) static void fail(const char *format, ...)
{
    char path[4096], reason[4096];
    const char *cause = strerror(errno);
    va_list arguments;
    FILE *file;

    va_start(arguments, format);
    vsnprintf(reason, sizeof reason, format, arguments);
    va_end(arguments);
    printf("guest: %s: %s\n", reason, cause);
    fflush(stdout);
    snprintf(path, sizeof path, "%s/output", work);
    file = fopen(path, "a");
    if (file) {
        fprintf(file, "Bail out! guest: %s: %s\n", reason, cause);
        fclose(file);
    }
    power_off(FAILED);
}

/* ---- file systems ---- */

static void mount_at(const char *type, const char *path)
{
    if (mount("none", path, type, 0, NULL)) {
        fail("cannot mount %s at %s", type, path);
    }
}

static void make_folders(const char *path)
{
    char part[4096];

    for (const char *end = strchr(path + 1, '/');; end = strchr(end + 1, '/')) {
        snprintf(part, sizeof part, "%.*s", end ? (int)(end - path) : (int)strlen(path), path);
        if (mkdir(part, 0755) && errno != EEXIST && errno != EROFS) {
            fail("cannot make %s", part);
        }
        if (!end) {
            return;
        }
    }
}

/* Mounts a directory of the host at the path that it has there, over what lies above it. */
static void mount_host_directory(const char *path, unsigned long flags)
{
    make_folders(path);
    if (mount("none", path, "hostfs", 0, path) ||
        mount("none", path, "hostfs", MS_REMOUNT | flags, path)) {
        fail("cannot mount %s", path);
    }
}

static void make_devices(void)
{
    static const struct {
        const char *path;
        unsigned minor;
    } node[] = {{"/dev/null", 3},
                {"/dev/zero", 5},
                {"/dev/full", 7},
                {"/dev/random", 8},
                {"/dev/urandom", 9}};

    mount_at("tmpfs", "/dev");
    umask(0);
    for (size_t i = 0; i < sizeof node / sizeof *node; i++) {
        if (mknod(node[i].path, S_IFCHR | 0666, makedev(1, node[i].minor))) {
            fail("cannot make %s", node[i].path);
        }
    }
    umask(022);
    if (mkdir("/dev/shm", 0755) || symlink("/proc/self/fd", "/dev/fd")) {
        fail("cannot fill /dev");
    }
}

/* ---- CAN ---- */

static void load_module(const char *name)
{
    struct utsname system;
    char path[512];
    int file;

    uname(&system);
    snprintf(path, sizeof path, "/usr/lib/uml/modules/%s/kernel/%s.ko", system.release, name);
    file = open(path, O_RDONLY | O_CLOEXEC);
    if (file < 0 || syscall(SYS_finit_module, file, "", 0)) {
        fail("cannot load %s", path);
    }
    close(file);
}

static void raise_loopback(void)
{
    struct ifreq request = {.ifr_name = "lo", .ifr_flags = IFF_UP | IFF_RUNNING};
    int any = socket(AF_INET, SOCK_DGRAM, 0);

    if (any < 0 || ioctl(any, SIOCSIFFLAGS, &request)) {
        fail("cannot set lo up");
    }
    close(any);
}

/* Adds an attribute to a message of netlink; returns it. */
static struct rtattr *put_attribute(struct nlmsghdr *head, unsigned short type, const char *text)
{
    struct rtattr *attribute = (struct rtattr *)((char *)head + NLMSG_ALIGN(head->nlmsg_len));

    attribute->rta_type = type;
    attribute->rta_len = (unsigned short)RTA_LENGTH(strlen(text));
    memcpy(RTA_DATA(attribute), text, strlen(text));
    head->nlmsg_len = NLMSG_ALIGN(head->nlmsg_len) + RTA_ALIGN(attribute->rta_len);
    return attribute;
}

/* Creates a virtual CAN interface, which is up. */
static void create_interface(int netlink, const char *name)
{
    struct {
        struct nlmsghdr head;
        struct ifinfomsg link;
        char attributes[128];
    } request = {.head = {.nlmsg_len = NLMSG_LENGTH(sizeof(struct ifinfomsg)),
                          .nlmsg_type = RTM_NEWLINK,
                          .nlmsg_flags = NLM_F_REQUEST | NLM_F_CREATE | NLM_F_EXCL | NLM_F_ACK},
                 .link = {.ifi_flags = IFF_UP, .ifi_change = IFF_UP}};
    struct {
        struct nlmsghdr head;
        struct nlmsgerr error;
        char rest[1024];
    } answer;
    struct rtattr *info;

    put_attribute(&request.head, IFLA_IFNAME, name);
    info = put_attribute(&request.head, IFLA_LINKINFO, "");
    put_attribute(&request.head, IFLA_INFO_KIND, "vcan");
    info->rta_len = (unsigned short)((char *)&request + request.head.nlmsg_len - (char *)info);
    if (send(netlink, &request, request.head.nlmsg_len, 0) < 0 ||
        recv(netlink, &answer, sizeof answer, 0) < 0) {
        fail("cannot speak to the kernel of %s", name);
    }
    errno = -answer.error.error;
    if (answer.head.nlmsg_type != NLMSG_ERROR || errno) {
        fail("cannot create %s", name);
    }
}

static void prepare_can(void)
{
    static const char *const module[] = {"net/can/can",
                                         "net/can/can-raw",
                                         "net/can/can-bcm",
                                         "net/can/can-gw",
                                         "drivers/net/can/dev/can-dev",
                                         "drivers/net/can/vcan",
                                         "drivers/net/can/vxcan"};
    int netlink = socket(AF_NETLINK, SOCK_RAW, NETLINK_ROUTE);
    char name[IF_NAMESIZE];

    for (size_t i = 0; i < sizeof module / sizeof *module; i++) {
        load_module(module[i]);
    }
    raise_loopback();
    for (int number = 0; number < INTERFACES; number++) {
        snprintf(name, sizeof name, "can%d", number);
        create_interface(netlink, name);
    }
    close(netlink);
}

/* ---- the command ---- */

/* Reads the strings of a file of HIL_WORK, with NULL behind them. */
static void read_words(const char *name, char *word[WORDS_MAX])
{
    size_t size, count = 0;
    char path[4096], *text = malloc(TEXT_MAX);
    FILE *file;

    snprintf(path, sizeof path, "%s/%s", work, name);
    file = fopen(path, "r");
    if (!file || !text) {
        fail("cannot read %s", path);
    }
    size = fread(text, 1, TEXT_MAX, file);
    fclose(file);
    for (size_t at = 0; at < size && count + 1 < WORDS_MAX; at += strlen(text + at) + 1) {
        word[count++] = text + at;
    }
    word[count] = NULL;
}

/* Becomes the command, which writes to a file of HIL_WORK. */
__attribute__((noreturn)) static void become(char **command, const char *output)
{
    char path[4096];
    int in = open("/dev/null", O_RDONLY), out;

    snprintf(path, sizeof path, "%s/%s", work, output);
    out = open(path, O_WRONLY | O_APPEND | O_CREAT, 0644);
    if (in < 0 || out < 0) {
        fail("cannot open %s", path);
    }
    dup2(in, STDIN_FILENO);
    dup2(out, STDOUT_FILENO);
    dup2(out, STDERR_FILENO);
    close(in);
    close(out);
    execvp(*command, command);
    printf("guest: cannot run %s: %s\n", *command, strerror(errno));
    fflush(stdout);
    _exit(127);
}

/* Runs the command to its end; its status as a shell has it. Orphans are ours to wait for. */
static int run(char **command)
{
    pid_t pid = fork(), ended;
    int status = 0;

    if (pid < 0) {
        fail("cannot fork");
    }
    if (pid == 0) {
        become(command, "output");
    }
    do {
        ended = wait(&status);
    } while (ended != pid && (ended > 0 || errno == EINTR));
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

int main(void)
{
    static char *variable[WORDS_MAX], *command[WORDS_MAX];

    work = getenv("HIL_WORK"); /* from the kernel's command line */
    mount_at("proc", "/proc");
    mount_at("sysfs", "/sys");
    make_devices();
    mount_at("tmpfs", "/run");
    mount_at("tmpfs", "/tmp");
    mount_host_directory(work, 0);

    read_words("environment", variable);
    for (size_t i = 0; variable[i]; i++) {
        putenv(variable[i]);
    }
    setenv("PATH", "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin", 1);
    setenv("HOME", "/root", 1);
    setenv("LC_ALL", "C.UTF-8", 1);
    mount_host_directory(getenv("HIL_SOURCE_DIR"), MS_RDONLY);
    mount_host_directory(getenv("HIL_BINARY_DIR"), 0);
    prepare_can();

    if (chdir(getenv("HIL_BINARY_DIR"))) {
        fail("no %s", getenv("HIL_BINARY_DIR"));
    }
    read_words("command", command);
    if (!**command) {
        become(command + 1, "console");
    }
    power_off(run(command));
}
