#include "link.h"

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
static void send_configuration(Link *link, const int32_t rate[2]) {
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

int link_tick(Link *link, int32_t can_rate, int32_t fd_rate) {
    if (link->is_ticking) {
        return 0;
    }
    link->is_ticking = 1;
    if (!link->has_begun) {
        send_configuration(link, (const int32_t[]){can_rate, fd_rate});
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

int link_send_frame(Link *link, const SentFrame *frame, const SbSignal *signal, const double *value, int counter) {
    uint8_t arguments[CAN_FD_HEAD + 64] = {0};
    const size_t head = frame->is_fd ? CAN_FD_HEAD : CAN_HEAD;
    put_number(arguments, frame->identifier, 4);
    arguments[4] = (uint8_t)frame->is_extended;
    arguments[5] = (uint8_t)frame->is_fd; /* the bit rate switch; not remote */
    put_number(arguments + head - 2, (uint64_t)frame->length, 2);
    if (sb_encode(signal + frame->first, frame->n_signals, value, counter, &frame->protection, arguments + head,
                  frame->length) >= 0) {
        link->counter[PORT_LOST]++;
        return 0;
    }
    link_send(link, frame->is_fd ? CAN_FD_TRANSMIT : CAN_TRANSMIT, arguments, head + (size_t)frame->length);
    link->counter[PORT_SENT]++;
    return 1;
}

int link_check(const Link *link) {
    return link->n_heard <= sizeof link->heard && link->n_reply <= sizeof link->reply && link->n_out <= sizeof link->out;
}

int array_of(const unsigned char *bytes, size_t length, int64_t place, int64_t count, size_t each, const void **array) {
    const int good = place >= 0 && place % 8 == 0 && count >= 0 && (uint64_t)place <= length
                  && (uint64_t)count <= (length - (size_t)place) / each;
    *array = bytes + (good ? place : 0);
    return good;
}
