/* SPDX-License-Identifier: Apache-2.0 */
/* Sends one RTM_GETLINK request to the kernel and parses its answer. */
#include "canbus/link.h"

#include <errno.h>
#include <linux/netlink.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

struct link_request {
    struct nlmsghdr header;
    struct ifinfomsg link;
    struct rtattr name_header;
    char name[IFNAMSIZ];
};

int link_open(void)
{
    return socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, NETLINK_ROUTE);
}

/* Returns the payload of an attribute, as RTA_DATA, which casts constness away. */
static const void *link_attribute_data(const struct rtattr *attribute)
{
    return (const char *)attribute + RTA_LENGTH(0);
}

/* Returns the next attribute and shortens the rest, as RTA_NEXT, which casts constness away. */
static const struct rtattr *link_next_attribute(const struct rtattr *attribute, int *rest)
{
    const int length = RTA_ALIGN(attribute->rta_len);

    *rest -= length;
    return (const void *)((const char *)attribute + length);
}

/* Copies an attribute of a fixed size. Returns false, without copying, when it is shorter. */
static bool link_copy_attribute(const struct rtattr *attribute, void *to, size_t size)
{
    if (RTA_PAYLOAD(attribute) < size) {
        return false;
    }
    memcpy(to, link_attribute_data(attribute), size);
    return true;
}

/* Returns the type of an attribute. Removes the flag that newer kernels set on nested
 * attributes. */
static int link_attribute_type(const struct rtattr *attribute)
{
    return attribute->rta_type & NLA_TYPE_MASK;
}

/* Parses the attributes of a CAN controller; unknown ones are skipped. */
static void link_parse_controller(const struct rtattr *data, struct link_controller *controller)
{
    int rest = (int)RTA_PAYLOAD(data);
    uint32_t state;

    for (const struct rtattr *a = link_attribute_data(data); RTA_OK(a, rest);
         a = link_next_attribute(a, &rest)) {
        /* A driver reports only the values that it supports */
        switch (link_attribute_type(a)) {
        case IFLA_CAN_STATE:
            if (link_copy_attribute(a, &state, sizeof state) && state < CAN_STATE_MAX) {
                controller->state = (enum can_state)state;
            }
            break;
        case IFLA_CAN_BITTIMING:
            link_copy_attribute(a, &controller->timing, sizeof controller->timing);
            break;
        case IFLA_CAN_DATA_BITTIMING:
            link_copy_attribute(a, &controller->data_timing, sizeof controller->data_timing);
            break;
        case IFLA_CAN_CLOCK:
            link_copy_attribute(a, &controller->clock, sizeof controller->clock);
            break;
        case IFLA_CAN_CTRLMODE:
            link_copy_attribute(a, &controller->mode, sizeof controller->mode);
            break;
        case IFLA_CAN_RESTART_MS:
            link_copy_attribute(a, &controller->restart_ms, sizeof controller->restart_ms);
            break;
        case IFLA_CAN_BERR_COUNTER:
            controller->counts =
                link_copy_attribute(a, &controller->errors, sizeof controller->errors);
            break;
        default:
            break;
        }
    }
}

/* Parses the kind of the interface, which is the first attribute. For a CAN controller, also parses
 * its data and statistics. */
static void link_parse_kind(const struct rtattr *info, struct link_info *link)
{
    int rest = (int)RTA_PAYLOAD(info);

    for (const struct rtattr *a = link_attribute_data(info); RTA_OK(a, rest);
         a = link_next_attribute(a, &rest)) {
        bool controller = strcmp(link->kind, "can") == 0;

        if (link_attribute_type(a) == IFLA_INFO_KIND && RTA_PAYLOAD(a) > 0) {
            const size_t size = RTA_PAYLOAD(a) < LINK_KIND_MAX ? RTA_PAYLOAD(a) : LINK_KIND_MAX;

            memcpy(link->kind, link_attribute_data(a), size - 1);
        } else if (link_attribute_type(a) == IFLA_INFO_DATA && controller) {
            link_parse_controller(a, &link->controller);
        } else if (link_attribute_type(a) == IFLA_INFO_XSTATS && controller) {
            link_copy_attribute(a, &link->controller.stats, sizeof link->controller.stats);
        }
    }
}

int link_parse(const void *answer, size_t size, struct link_info *info)
{
    const struct nlmsghdr *header = answer;
    const char *payload = (const char *)answer + NLMSG_HDRLEN;
    struct ifinfomsg link;
    int rest;

    /* The message must lie within the answer */
    if (size < sizeof *header || header->nlmsg_len < sizeof *header || header->nlmsg_len > size) {
        return EPROTO;
    }

    /* The kernel may answer with an error code */
    if (header->nlmsg_type == NLMSG_ERROR) {
        struct nlmsgerr failure;

        if (header->nlmsg_len < NLMSG_LENGTH(sizeof failure)) {
            return EPROTO;
        }
        memcpy(&failure, payload, sizeof failure);
        return failure.error < 0 && failure.error >= -INT16_MAX ? -failure.error : EPROTO;
    }

    /* Parse the interface, then its attributes, which can have any order */
    if (header->nlmsg_type != RTM_NEWLINK || header->nlmsg_len < NLMSG_LENGTH(sizeof link)) {
        return EPROTO;
    }
    memcpy(&link, payload, sizeof link);
    *info = (struct link_info){
        .index = link.ifi_index,
        .up = link.ifi_flags & IFF_UP,
        .type = link.ifi_type,
    };
    rest = (int)IFLA_PAYLOAD(header);
    for (const struct rtattr *attribute = (const void *)(payload + NLMSG_ALIGN(sizeof link));
         RTA_OK(attribute, rest); attribute = link_next_attribute(attribute, &rest)) {
        switch (link_attribute_type(attribute)) {
        case IFLA_MTU:
            link_copy_attribute(attribute, &info->mtu, sizeof info->mtu);
            break;
        case IFLA_TXQLEN:
            link_copy_attribute(attribute, &info->tx_queue, sizeof info->tx_queue);
            break;
        case IFLA_LINKINFO:
            link_parse_kind(attribute, info);
            break;
        default:
            break;
        }
    }
    return 0;
}

int link_query(int descriptor, const char *name, struct link_info *info)
{
    _Alignas(struct nlmsghdr) char answer[8192];
    struct link_request request = {
        .header = {.nlmsg_type = RTM_GETLINK, .nlmsg_flags = NLM_F_REQUEST},
        .link = {.ifi_family = AF_UNSPEC},
        .name_header = {.rta_type = IFLA_IFNAME},
    };
    const size_t length = strnlen(name, IFNAMSIZ);
    ssize_t size;

    if (!length || length == IFNAMSIZ) {
        return ENODEV;
    }
    /* A request with one attribute, the name */
    memcpy(request.name, name, length);
    request.name_header.rta_len = (uint16_t)RTA_LENGTH(length + 1);
    request.header.nlmsg_len =
        (uint32_t)(offsetof(struct link_request, name_header) + RTA_LENGTH(length + 1));

    /* Discard the unread answer of an earlier call */
    while (recv(descriptor, answer, sizeof answer, MSG_DONTWAIT) > 0) {
    }
    if (send(descriptor, &request, request.header.nlmsg_len, MSG_DONTWAIT) < 0) {
        return errno;
    }
    size = recv(descriptor, answer, sizeof answer, MSG_DONTWAIT);
    if (size < 0) {
        return errno;
    }
    return link_parse(answer, (size_t)size, info);
}
