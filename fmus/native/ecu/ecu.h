/* The set-up of an ECU, as strainfmu/can/ecu.py writes it: resources/bus.bin, a header of 32 bytes, then this
   record, then arrays at the places that it states, in bytes from the start of the file. */

#ifndef ECU_H
#define ECU_H

#include "../network/link.h"

#define ECU_VERSION 1

enum { OF_RESULT, OF_STATUS, OF_DETAIL }; /* kinds of a frame that is sent */

typedef struct {
    uint32_t key;
    int32_t slot; /* the first of the identifier; -1 of a frame that bridges send */
} EcuKey;

/* A quantity of the flow, or a constant: the variable that takes it, and what stands for a value that is not above 0. */
typedef struct {
    int32_t variable, is_whole;
    double value, fallback; /* of a constant; NaN for none */
} EcuQuantity;

typedef struct {
    int32_t variable, padding;
    double step; /* in which its value is rounded up, 0 for none */
} EcuOther;

typedef struct {
    char guid[96];
    double response_time, status_period, bridge_alarm; /* [s] */
    int32_t is_triggered, can_rate, fd_rate; /* bit/s; 0 without CAN FD */
    int32_t needs_pressure, configuration, strain, first_result;
    int32_t n_keys, n_constants, n_others, n_frames, n_sent; /* n_sent: signals of all frames that are sent */
    int32_t n_signals, n_codes;                              /* of the input */
    int64_t plan, slot, signal, code, change, key, quantity, constant, other, frame, sent, source;
} EcuSetup;

#endif
