#include "strainbus.h"

int64_t sb_bucket_take(SbBucket *bucket, int n_data, int is_fd, const double *time) {
    SbBucket *b = bucket;
    if ((is_fd != 0) != (b->is_fd != 0) || n_data != b->length) {
        return SB_WRONG_FORMAT;
    }
    double tokens = b->tokens;
    if (*time > b->time) {
        tokens += (*time - b->time) * b->rate;
        tokens = tokens > b->capacity ? b->capacity : tokens;
    }
    b->time = *time;
    b->tokens = tokens >= 1.0 ? tokens - 1.0 : tokens;
    return tokens >= 1.0 ? SB_ACCEPTED : SB_SHED;
}

/* What becomes of the values of a frame whose check has succeeded. */
static int64_t take_flow(const SbPort *p, const uint8_t *data, const double *time) {
    if (p->slot->trusted_by->state != SB_VALID) {
        return SB_EVENT_NOT_TRUSTED;
    }
    return p->flow != NULL && sb_flow_take(p->flow, data, time) ? SB_EVENT_USED : SB_EVENT_NOT_USABLE;
}

int64_t sb_receive(SbPort *port, const double *time, const uint8_t *data, int n_data, int is_fd) {
    const SbPort *p = port;
    if (*time >= *p->next_status || *time >= p->assembler->deadline) {
        return SB_EVENT_DUE;
    }
    const int64_t accepted = sb_bucket_take(p->bucket, n_data, is_fd, time);
    if (accepted != SB_ACCEPTED) {
        return accepted == SB_SHED ? SB_EVENT_SHED : SB_EVENT_WRONG_FORMAT;
    }
    const int64_t found = sb_slot_receive(p->slot, time, data, n_data);
    if (found != SB_OK && found != SB_SOME_LOST) {
        return SB_EVENT_CHECK + found;
    }
    if (!p->is_strain) {
        return take_flow(p, data, time);
    }
    return SB_EVENT_CYCLE + sb_offer(p->assembler, (int)p->index, data, p->slot->number, time);
}
