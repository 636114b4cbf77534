/* SPDX-License-Identifier: Apache-2.0 */
/* One RTM_GETLINK request and its answer. */
#include "canbus/link.h"

#include <errno.h>
#include <linux/netlink.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <stddef.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

struct request {
    struct nlmsghdr header;
    struct ifinfomsg link;
    struct rtattr name_header;
    char name[IFNAMSIZ];
};

int link_open(void)
{
    return socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, NETLINK_ROUTE);
}

/* The interface in an answer; the kernel's, but checked like anything that comes from outside. */
static int parse_answer(const struct nlmsghdr *header, int size, struct link_info *info)
{
    struct ifinfomsg link;
    int rest;

    if (!NLMSG_OK(header, size)) {
        return EPROTO;
    }
    if (header->nlmsg_type == NLMSG_ERROR) {
        struct nlmsgerr failure;

        if (header->nlmsg_len < NLMSG_LENGTH(sizeof failure)) {
            return EPROTO;
        }
        memcpy(&failure, NLMSG_DATA(header), sizeof failure);
        return failure.error ? -failure.error : EPROTO;
    }
    if (header->nlmsg_type != RTM_NEWLINK || header->nlmsg_len < NLMSG_LENGTH(sizeof link)) {
        return EPROTO;
    }
    memcpy(&link, NLMSG_DATA(header), sizeof link);
    *info = (struct link_info){
        .index = link.ifi_index,
        .up = link.ifi_flags & IFF_UP,
        .type = link.ifi_type,
    };
    rest = (int)IFLA_PAYLOAD(header);
    for (const struct rtattr *attribute = IFLA_RTA((const char *)NLMSG_DATA(header));
         RTA_OK(attribute, rest); attribute = RTA_NEXT(attribute, rest)) {
        if (attribute->rta_type == IFLA_MTU && RTA_PAYLOAD(attribute) >= sizeof info->mtu) {
            memcpy(&info->mtu, RTA_DATA(attribute), sizeof info->mtu);
        }
    }
    return 0;
}

int link_query(int descriptor, const char *name, struct link_info *info)
{
    _Alignas(struct nlmsghdr) char answer[8192];
    struct request request = {
        .header = {.nlmsg_type = RTM_GETLINK, .nlmsg_flags = NLM_F_REQUEST},
        .link = {.ifi_family = AF_UNSPEC},
        .name_header = {.rta_type = IFLA_IFNAME},
    };
    const size_t length = strnlen(name, IFNAMSIZ);
    ssize_t size;

    if (!length || length == IFNAMSIZ) {
        return ENODEV;
    }
    memcpy(request.name, name, length);
    request.name_header.rta_len = (uint16_t)RTA_LENGTH(length + 1);
    request.header.nlmsg_len =
        (uint32_t)(offsetof(struct request, name_header) + RTA_LENGTH(length + 1));

    /* an answer that an earlier call did not fetch must not pass for this one */
    while (recv(descriptor, answer, sizeof answer, MSG_DONTWAIT) > 0) {
    }
    if (send(descriptor, &request, request.header.nlmsg_len, MSG_DONTWAIT) < 0) {
        return errno;
    }
    size = recv(descriptor, answer, sizeof answer, MSG_DONTWAIT);
    if (size < 0) {
        return errno;
    }
    return parse_answer((const struct nlmsghdr *)answer, (int)size, info);
}
