/* What a bridge does in every cycle around the machine of the bus, on a computer and as an ECU: frames in, a step of the
   estimator, its answer, frames out. */

#ifndef BRIDGE_H
#define BRIDGE_H

#include "../bus/bus.h"

enum { OF_RESULT, OF_STATUS, OF_DETAIL }; /* kinds of a frame that is sent */

/* Values of the frames of a result, of the details and of the status, as strainfmu/can/result_frames.py lists them. */
enum {
    R_COEFFICIENTS = 2, R_SIGMA = 7, R_QUALITY = 12, R_HEALTH, R_USABLE, R_SAMPLE_TIME, R_CHI_SQUARE, R_AGE, R_CAUSES,
    R_GAUGES, R_ANSWERED, R_CONFIGURATION, R_PRESSURE, R_SCORE, R_OTHERS
};
enum { D_QUALITY = 2, D_CAUSES, D_USABLE, D_UNCERTAINTY, D_ANSWERED, N_DETAILS };
enum { S_LAST = 2, S_COUNTS = 7, S_COUNTS_16 = 12, S_AGE = 17, S_AGE_16, S_QUALITY, S_BUS, S_FAILURES, S_REOPENED, S_DRIFT,
       S_SCORE, S_CONFIGURATION, N_STATUS };
enum { N_LOADS_SENT = 5, N_REAL_LOADS = 10 }; /* coefficients; with their standard deviations */

/* What the status says of the results so far. */
typedef struct {
    double loads[N_LOADS_SENT], ready, age;       /* of the last one that is VALID or UNPROTECTED; [s] */
    double score, detail[N_DETAILS];              /* of the last one */
    uint64_t results;
    int32_t has_last, has_valid;
} SbLast;

/* Variables of an FMU (FMI 2.0) that one call moves, from the inputs or to the outputs. */
typedef struct {
    int (*move)(void *component, const uint32_t *reference, size_t n, void *value);
    const uint32_t *reference;
    void *value;                                  /* of doubles or, whole, of int32_t */
    const int32_t *place;                         /* of each in the inputs or outputs; NULL where `value` lies there */
    int32_t n, is_whole, is_output, is_given;     /* whole numbers are given when they change */
} SbExchange;

typedef struct {
    void *component;
    int (*step)(void *component, double time, double size, int no_going_back);
    SbExchange *exchange;
    double *input, *output;
    const int32_t *angle;                         /* inputs that are angle_error where they are not above 0 */
    double angle_error, time;                     /* time: at which the next step begins [s] */
    int32_t n_exchanges, n_angles;
} SbEstimator;

/* A frame that came or went, as a recorder has it. */
typedef struct {
    double time;                                  /* [s] */
    uint32_t key;
    uint8_t n, flags, is_received, verdict;       /* verdict: on its authenticator, SB_FLAG_* */
    uint8_t data[MOST_BYTES];
} SbLogged;

enum { SB_IS_FD = 1, SB_IS_FAST = 2, SB_IS_ERROR = 4, SB_IS_REMOTE = 8 };

/* Frames that wait for the recorder's thread, which alone changes `taken`. */
typedef struct {
    SbLogged *frame;                              /* (size,) */
    int64_t size, room, put, taken, lost;         /* room: most that may wait */
} SbQueue;

typedef struct {
    const SbPlan *plan;
    SbState *state;
    SbEstimator *estimator;                       /* NULL of one in Python */
    const int32_t *place;                         /* (n_flow,) of a quantity in the inputs, -1 for none */
    double *output;                               /* loads, chi-square, others, health */
    const SentFrame *frame;
    const SbSignal *signal;                       /* of all frames */
    const int32_t *source;                        /* place of each signal's value */
    uint8_t *counter, *data;                      /* (n_frames,), (n_frames, MOST_BYTES) */
    const int32_t *other;                         /* (n_others,) loads behind the five: place in the outputs */
    const double *step;                           /* and in which each is rounded up */
    double *value;                                /* of the frames */
    const uint32_t *key;                          /* (n_keys,) of the input, and of the frames that bridges send */
    const int32_t *slot;                          /* and the first slot of each, -1 of those */
    uint8_t *has_come;                            /* (n_keys,) */
    SbLogged *heard;                              /* the frame that is offered, without its data */
    SbQueue *queue;                               /* NULL without a recorder */
    SbLast last;
    double last_step, pressure, alarm;            /* [s], NaN before the first; used [Pa]; of a second bridge [s] */
    int32_t n_outputs, n_frames, n_others, mask, score, configuration; /* places: of the first mask, 0 for none; -1 for none */
    int32_t needs_pressure, health, n_gauges, is_stepped, n_keys;
    int32_t bus_state, send_failures, reconnects; /* what the status says of the bus */
} SbBridge;

/* One step of `size` [s]: 0, or 8 times the number of the call that failed (the step is the last) plus its status. */
SB_API int sb_step(SbEstimator *estimator, const double *size);

/* Take in the frame of which `heard` holds all but the data: as sb_take, and SB_OTHER of one that is no data frame of the
   input, which sb_refuse puts into the class that it returns. It waits for the recorder then. */
enum { SB_OTHER = SB_AUTHENTICATE + 1 };
SB_API int sb_hear(SbBridge *bridge, const uint8_t *data);
SB_API int sb_refuse(SbBridge *bridge, const uint8_t *data);

/* Have a frame wait for the recorder. */
SB_API void sb_log(SbQueue *queue, const SbLogged *frame, const uint8_t *data);

/* Have the estimator make what it can of the result that is ready; as sb_step. */
SB_API int sb_estimate(SbBridge *bridge);

/* As sb_answer, of what the outputs hold, which a step made. */
SB_API int sb_conclude(SbBridge *bridge, const double *now);

/* Compose the frames of a result: -1, or the frame that cannot hold a value. Those of details are composed where a cause
   above bit 15 needs them. */
SB_API int sb_compose(SbBridge *bridge);

/* Compose the frames of the status at `now`, and those of the details of the last result. */
SB_API int sb_compose_status(SbBridge *bridge, const double *now);

/* Bytes of the records, for the caller to compare with its own, and places of the state's parts. */
SB_API void sb_sizes(int64_t size[14]);

/* --- for frames that are sent later --------------------------------------------------------------------------------- */

/* Values of the frames of a result; those of its details are behind them, which go where a cause above bit 15 needs them. */
void result_of(SbBridge *bridge, double *value);
double *details_in(const SbBridge *bridge, double *value);
int has_details(uint32_t causes);

/* Compose the frames of a kind of their values, each with the next counter: -1, or the frame that cannot hold a value. */
int compose_frames(const SbBridge *bridge, int kind, const double *value);

#endif
