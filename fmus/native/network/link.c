/* Operations of FMI-LS-BUS as bytes: code, length of all, arguments. What is heard is taken one by one, and what is none
   answered with its start as a Format Error; what goes is appended to the bytes of the tick. link.h states the functions. */

#include "link.h"

/* Append an operation to *n bytes of at most `most`; 0 without a place for it. */
static int append_operation(uint8_t *to, size_t *n, size_t most, uint32_t code, const uint8_t *arguments,
                                   size_t length) {
    if (length + OPERATION_HEAD > most - *n) {
        return 0;
    }
    put_number(to + *n, code, 4);
    put_number(to + *n + 4, OPERATION_HEAD + length, 4);
    memcpy(to + *n + OPERATION_HEAD, arguments, length);
    *n += OPERATION_HEAD + length;
    return 1;
}

/* The operation at *at of n bytes: 1, and *at is behind it; 0 at the end, or where the rest is none. */
static int next_operation(const uint8_t *bytes, size_t n, size_t *at, uint32_t *code, const uint8_t **arguments,
                                 size_t *length) {
    if (n - *at < OPERATION_HEAD) {
        return 0;
    }
    const uint64_t whole = get_number(bytes + *at + 4, 4);
    if (whole < OPERATION_HEAD || whole > n - *at) {
        return 0;
    }
    *code = (uint32_t)get_number(bytes + *at, 4);
    *arguments = bytes + *at + OPERATION_HEAD;
    *length = (size_t)whole - OPERATION_HEAD;
    *at += (size_t)whole;
    return 1;
}

/* Answer what is no operation with a copy of its start. */
static void refuse(Link *link, const uint8_t *bytes, size_t n) {
    uint8_t echo[2 + LONGEST_ECHO];
    const size_t shown = n < LONGEST_ECHO ? n : LONGEST_ECHO;
    size_t used = 0;
    put_number(echo, shown, 2);
    memcpy(echo + 2, bytes, shown);
    link->counter[PORT_ERRORS]++;
    if (link->n_reply == 0 && append_operation(link->reply, &used, sizeof link->reply, FORMAT_ERROR, echo, 2 + shown)) {
        link->n_reply = (uint32_t)used;
    }
}

/* Whether an operation has a length that it can have; of a frame its parts are set. */
static int is_whole(Heard *h) {
    const size_t head = h->code == CAN_FD_TRANSMIT ? CAN_FD_HEAD : CAN_HEAD, n = h->length;
    h->is_fd = h->code == CAN_FD_TRANSMIT;
    h->is_frame = h->is_fd || h->code == CAN_TRANSMIT;
    switch (h->code) {
    case CAN_TRANSMIT:
    case CAN_FD_TRANSMIT:
        if (n < head || n - head != get_number(h->arguments + head - 2, 2) || n - head > (h->is_fd ? 64u : 8u)) {
            return 0;
        }
        h->key = (uint32_t)get_number(h->arguments, 4) | (h->arguments[4] ? EXTENDED_FLAG : 0);
        h->is_remote = !h->is_fd && h->arguments[5];
        h->data = h->arguments + head;
        h->n = n - head;
        return 1;
    case CONFIRM:
    case ARBITRATION_LOST: return n == 4;
    case BUS_ERROR: return n == 7;
    case CONFIGURATION_OF_BUS: return n == 5 || n == 2;
    case STATUS_OF_NODE: return n == 1;
    case WAKE_UP: return n == 0;
    case FORMAT_ERROR: return n >= 2;
    case CAN_XL_TRANSMIT: return n >= 14;
    default: return 0;
    }
}

int link_next(Link *link, size_t *at, Heard *heard) {
    while (next_operation(link->heard, link->n_heard, at, &heard->code, &heard->arguments, &heard->length)) {
        if (is_whole(heard)) {
            link->counter[PORT_RECEIVED] += (uint64_t)heard->is_frame;
            link->counter[PORT_CONFIRMED] += heard->code == CONFIRM;
            return 1;
        }
        refuse(link, heard->arguments - OPERATION_HEAD, heard->length + OPERATION_HEAD);
    }
    if (*at < link->n_heard) {
        refuse(link, link->heard + *at, link->n_heard - *at);
    }
    link->n_heard = 0;
    return 0;
}

void link_send(Link *link, uint32_t code, const uint8_t *arguments, size_t n) {
    size_t used = link->n_out;
    if (append_operation(link->out, &used, sizeof link->out, code, arguments, n)) {
        link->n_out = (uint32_t)used;
    } else {
        link->counter[PORT_LOST]++;
    }
}

/* A node states its rates before it transmits. */
static void send_configuration(Link *link, const NodeSetup *setup) {
    const int32_t rate[] = {setup->can_rate, setup->fd_rate};
    uint8_t arguments[5];
    for (int k = 0; k < 2; k++) {
        if (rate[k] > 0) {
            arguments[0] = k == 0 ? CAN_RATE : CAN_FD_RATE;
            put_number(arguments + 1, (uint64_t)rate[k], 4);
            link_send(link, CONFIGURATION_OF_BUS, arguments, 5);
        }
    }
    arguments[0] = ARBITRATION;
    arguments[1] = BUFFER_AND_RETRANSMIT;
    link_send(link, CONFIGURATION_OF_BUS, arguments, 2);
}

int link_tick(Link *link, const NodeSetup *setup) {
    if (link->is_ticking) {
        return 0;
    }
    link->is_ticking = 1;
    if (!link->has_begun) {
        send_configuration(link, setup);
        link->has_begun = 1;
    }
    if (link->n_reply <= sizeof link->out - link->n_out) {
        memcpy(link->out + link->n_out, link->reply, link->n_reply);
        link->n_out += link->n_reply;
    }
    link->n_reply = 0;
    return 1;
}

void link_end_tick(Link *link) {
    if (link->is_ticking) {
        link->is_ticking = 0;
        link->n_out = 0;
    }
}

void link_send_frame(Link *link, const SentFrame *frame, const uint8_t *data) {
    uint8_t arguments[CAN_FD_HEAD + MOST_BYTES] = {0};
    const size_t head = frame->is_fd ? CAN_FD_HEAD : CAN_HEAD;
    put_number(arguments, frame->identifier, 4);
    arguments[4] = (uint8_t)frame->is_extended;
    arguments[5] = (uint8_t)frame->is_fd; /* the bit rate switch; not remote */
    put_number(arguments + head - 2, (uint64_t)frame->length, 2);
    memcpy(arguments + head, data, (size_t)frame->length);
    link_send(link, frame->is_fd ? CAN_FD_TRANSMIT : CAN_TRANSMIT, arguments, head + (size_t)frame->length);
    link->counter[PORT_SENT]++;
}
