/* Nodes of a network other than the estimator's: the sender of a vehicle's strains, and the bus. */

#ifndef NODES_H
#define NODES_H

#include "../network/link.h"

#define CAN_BUS_VERSION 1
#define SENDER_VERSION 1

/* Where the value of a signal comes from: a variable of the model, by its number, or one of these. */
enum { CONSTANT = -1, SAMPLE_TIME = -2, HEARD_COUNTER = -3, HEARD_TIME = -4, HEARD_DELAY = -5 };

/* `value`: of a constant in its signal's unit; of times the unit of the raw number [s]. */
typedef struct {
    int32_t from, padding;
    double value;
} SenderSource;

/* The set-up of a sender, as strainfmu/can/ecu.py writes it: resources/sender.bin, a header of 32 bytes, then this
   record, then arrays at the places that it states, in bytes from the start of the file. The answer: counter of the
   cycle that a result answers, its own counter, and its sample time, where it has one. */
typedef struct {
    char guid[96];
    double period; /* [s] */
    int32_t is_triggered, can_rate, fd_rate; /* bit/s; 0 without CAN FD */
    int32_t n_frames, n_sent, n_answer, answer_length;
    uint32_t answer_key;
    int64_t frame, sent, source, answer;
} SenderSetup;

extern const Ports SENDER, CAN_BUS;

#endif
