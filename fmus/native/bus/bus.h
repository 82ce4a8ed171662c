/* The input of a bridge as one state machine: frames and times in, results out.

   A caller has the plan of an input: three tables of frames (slots), signals and numbers that stand for "no value". It
   gives a block of sb_size bytes, which sb_begin makes the state. Nothing is allocated and no clock is read here; the
   state holds no pointer, so that a copy of the block is a copy of the machine. The tables must outlive it.

       sb_take(plan, state, slot, time, data, n, flags)   a frame: SB_TAKEN, or a result is ready
       sb_due(plan, state, now)                           the time: a cycle at its deadline, silence
       sb_answer(plan, state, ...)                        what the estimator made of the result's strains

   A result that is ready is answered, or skipped, before the next call. All times are seconds of one monotonic clock.

   Every frame received ends in exactly one class of the account. */

#ifndef BUS_H
#define BUS_H

#include <stddef.h>
#include <stdint.h>

#if defined _WIN32
#define SB_API __declspec(dllexport)
#elif defined __GNUC__
#define SB_API __attribute__((visibility("default")))
#else
#define SB_API
#endif

/* --- the plan ------------------------------------------------------------------------------------------------------ */

enum { SB_UNSIGNED, SB_SIGNED, SB_FLOAT }; /* kinds of a signal */

/* A signal: value = raw * scale + offset in its unit; in SI it is value * factor + added. `byte` is the first of `count`
   bytes that hold it, `shift` its lowest bit in the number that they make. */
typedef struct {
    int32_t byte, count, shift, length, is_big, kind;
    int32_t target, has_ends, first_code, n_codes; /* target: its gauge or quantity, -1 for none */
    int32_t has_none;
    uint32_t lost;                                /* cause of a quantity that was known and is not any more */
    int64_t first, last, none;                    /* ends of the converter; what is sent for "not available" */
    double scale, offset, low, high;              /* and the values that its frame allows */
    double factor, added, smallest, largest;      /* and the SI values that may be used */
    double max_age;                               /* of a quantity [s] */
} SbSignal;

/* Kinds of a frame: strains of a cycle, strains that come more slowly and are held, the end of a cycle, the state of the
   sender, quantities of the flow, a command. */
enum { SB_STRAIN, SB_HELD, SB_TRAILER, SB_SENDER_STATE, SB_OF_FLOW, SB_COMMAND };

typedef struct {
    int32_t length, is_fd, kind, next;            /* `next` slot of the same identifier, -1 for none */
    int32_t profile, data_id, crc_end, is_secured; /* E2E profile 1, 5 or 0; bytes under its CRC, -1 for all */
    int32_t selector, value;                      /* signal of the multiplexer, -1 for none; its raw number */
    int32_t sample_time, status, configuration, request; /* signals, -1 for none */
    int32_t session, heard_counter, heard_time, heard_delay;
    int32_t first, n_signals;                     /* of gauges or quantities, one after the other */
    int32_t data, shares_clock;                   /* where its bytes are kept; its sample time is the strains' */
    int64_t expected;                             /* configuration */
    double period, hold, tick, rate;              /* [s], [s], [s], frames per second that are taken for long */
} SbSlot;

typedef struct {
    double cycle, max_age, tolerance, deadline, timeout, invalid_after; /* [s], rate of the clocks [s/s] */
    double alarm;                                 /* of a second sender, the shortest [s] */
    double tick;                                  /* unit of a cycle's sample time [s] */
    double synchronised, shift;                   /* accuracy of synchronised clocks, < 0 for none; their difference [s] */
    double sensor_range, rate_limit, zero_jump;   /* [m/m] */
    double fixed_pressure, pressure_max_age;      /* [Pa] or NaN; [s] */
    double period_tolerance, burst;               /* part of the period; frames at once */
    int32_t n_slots, n_gauges, n_flow, n_cycle;   /* n_cycle: frames of a complete cycle without the sender's state */
    int32_t trailer, state, pressure, n_data;     /* slots and quantity, -1 for none; bytes of all frames */
    int32_t covered, n_covered;                   /* bytes of the strains, which a trailer covers; the state's lie ahead */
    int32_t is_timed, bits;                       /* every frame of a cycle has a sample time, of so many bits */
    int32_t modulus;                              /* values of the counter of a cycle, 0 for none */
    int32_t is_answered, accepts, is_protected;   /* results go out; restarts need no proof; every byte has a CRC */
    int32_t is_authentic, first_result, n_counters; /* authenticators prove restarts; counter of results: first, values */
    int32_t heal, late_limit, recovery, stuck;    /* cycles; stuck: 0 never, -1 by the noise */
    const SbSlot *slot;
    const SbSignal *signal;
    const int64_t *code;
    const double *change;                         /* (n_gauges,) stated probability that a reading differs from the last */
} SbPlan;

/* --- results --------------------------------------------------------------------------------------------------------- */

/* Causes, bit by bit, as in strainfmu/can/quality.py. */
enum {
    SB_PARTIAL = 1 << 0,
    SB_GAUGE = 1 << 1,
    SB_NOT_TRUSTED = 1 << 2,
    SB_CYCLE_CRC = 1 << 3,
    SB_OLD = 1 << 4,
    SB_FROZEN = 1 << 5,
    SB_SILENT = 1 << 6,
    SB_PRESSURE = 1 << 7,
    SB_JUMP = 1 << 8,
    SB_STATUS = 1 << 9,
    SB_HEALTH = 1 << 10,
    SB_STEP_FAILED = 1 << 11,
    SB_OVERLOAD = 1 << 12,
    SB_BUS = 1 << 13,
    SB_AGE_UNKNOWN = 1 << 16,
    SB_RESTART = 1 << 17,
    SB_SECOND_SENDER = 1 << 18,
    SB_SECOND_BRIDGE = 1 << 19,
    SB_NOT_AUTHENTIC = 1 << 24,
    SB_PERIOD = 1 << 26
};

enum { SB_NO_DATA, SB_VALID, SB_UNPROTECTED, SB_DEGRADED, SB_SUSPECT, SB_STALE, SB_INVALID, SB_UNCONFIRMED };

/* Health of the estimator, as HealthState numbers it. */
enum { HEALTH_OK, HEALTH_INCONSISTENT, HEALTH_NO_COEFFICIENTS, HEALTH_INVALID, HEALTH_DEGRADED, HEALTH_UNIDENTIFIED };

/* Why a gauge is not used. */
enum {
    SB_IS_USED,
    SB_NO_FRAME,
    SB_FRAME_NOT_TRUSTED,
    SB_NO_VALUE,
    SB_OUT_OF_RANGE,
    SB_JUMPS,
    SB_IS_FROZEN,
    SB_ZERO,
    SB_HEALING,
    SB_CYCLE_UNVERIFIED,
    SB_CYCLE_REPEATED,
    SB_CYCLE_SEQUENCE,
    SB_CYCLE_OLD
};

typedef struct {
    double time, arrival, age, uncertainty, held; /* [s]; held: by how much the oldest held strains are older */
    double stated_pressure;                       /* [Pa], 0 of air at rest; NaN if it is not known */
    int64_t sample_time;                          /* [ticks], -1 for none */
    int32_t counter, is_silent, n_used;           /* counter: -1 for none */
    uint32_t causes;
    int32_t quality, usable, request;             /* request: of the last command, -1 for none */
} SbResult;

/* Classes of frames, in the order of strainfmu/can/quality.py. */
enum {
    SB_USED,
    SB_OWN,
    SB_OF_SECOND_BRIDGE,
    SB_UNKNOWN,
    SB_ERROR_FRAME,
    SB_REMOTE_FRAME,
    SB_WRONG_FORMAT,
    SB_SHED,
    SB_CORRUPT,
    SB_FORGED,
    SB_NOT_FRESH,
    SB_WRONG_CONFIGURATION,
    SB_OLD_SESSION,
    SB_REPEATED,
    SB_WRONG_SEQUENCE,
    SB_LATE,
    SB_UNTRUSTED,
    SB_UNVERIFIED,
    SB_TOO_OLD,
    SB_NOT_USABLE,
    SB_OVERRUN,
    SB_SKIPPED,
    SB_UNFINISHED,
    SB_N_CLASSES
};

typedef struct {
    int64_t received, pending, count[SB_N_CLASSES];
    double first[SB_N_CLASSES], last[SB_N_CLASSES]; /* times of a class, NaN without a frame */
} SbAccount;

/* --- the state ------------------------------------------------------------------------------------------------------- */

enum { SB_ANSWERS = 256 };

/* A result that went out: the sample time that it answers and its own counter, which a sender names, the counter of the cycle
   that it states, when it was ready, and the `unseen` of the state then. */
typedef struct {
    int64_t ticks;
    int32_t counter, cycle;
    double ready, unseen;
} SbAnswer;

/* Bounds of a clock, clock.c: of the sender's, or of a frame of the flow that does not share it. */
typedef struct {
    int32_t is_set, has_lower, n_odd, n_returned;
    int32_t is_assumed, counter;                  /* the lower bound is: no result that was heard shows it */
    int64_t ticks;                                /* and counter, of the last reading that counts */
    double source, at, upper, lower, doubt; /* [s] */
} SbClock;

typedef struct {
    double tokens, token_time, came, came_before; /* [s]; of the last two frames in sequence */
    double wrong[3];                              /* of the last frames that alternate with others */
    double recent_time[8];                        /* of the last counters in sequence */
    uint64_t content, content_before;             /* hashes of the same two */
    double held_since, heard;                     /* of strains that are held; the last cycle that was read of it [s] */
    int64_t heard_ticks;                          /* and its sample time, -1 between a jump of the clock and a young one */
    int64_t ticks;                                /* sample time of the frame that is kept */
    int32_t counter, counter_before;              /* -1 for none */
    int32_t ok, errors, state;                    /* E2E state machine: the last ten checks, a bit each */
    int32_t recent[8], n_recent;
    int32_t here, present, fresh, status;         /* in the open cycle; read, and new; the sender's own status */
    SbClock clock;
} SbSlotState;

typedef struct {
    int64_t last_raw;
    double last, last_good, good_time, pace;      /* [m/m], [s]; largest recent change of a cycle [m/m] */
    double changes, readings, log_repeat;         /* counts that fade; ln of the probability that a reading repeats */
    double stuck_limit, zero_limit;               /* readings in a row */
    int32_t run, zeros, good, is_seen;            /* run: repetitions in a row */
    int32_t reason, padding;
} SbGauge;

typedef struct {
    double value, arrived, delay;                 /* SI, NaN where not usable; [s]; of a clock that is not the strains' */
    double stated, stated_at;                     /* also of air at rest */
    int64_t ticks;
    int32_t was_known, shares_clock;
} SbQuantity;

typedef struct {
    double deadline, next_status;                 /* of the open cycle, of the next result of silence [s] */
    double measured_period;                       /* [s], NaN before the second measurement */
    int32_t period_is_wrong, skips;               /* skips: cycles that end are settled and not answered */
    SbResult result;
    SbAccount account;
    int32_t slots_at, gauges_at, quantities_at, flow_at, strain_at, valid_at, reason_at, data_at; /* in this block */
    /* the open cycle */
    double first, arrival;
    int64_t newest;
    int32_t n_open, has_newest, open_counter, n_late_frames;
    /* the sender */
    int32_t expects_state, session, has_session, is_unproven;
    int32_t has_proven, is_confirmed, n_late, has_seen, seen_counter, ever;
    int64_t seen_ticks;
    double session_heard, alarm_length, alarm_heard, alarm_until, bridge_until, seen_at;
    SbClock clock, proven;
    int32_t n_answers, request, n_results, hears_old; /* the last state that came is of an older session */
    uint32_t noted, padding;
    SbAnswer answer[SB_ANSWERS];
    /* arrival and readings */
    double last_cycle, last_first, refusals, refilled, step_time, interval_sum, interval_longest;
    int32_t n_held_back, n_intervals, n_wrong, n_steps, step_count, goes_on;
    double cycles, learn_at, changed_at, unheard; /* unheard: time lost ahead of the last change [s] */
    double unseen;                                /* time of the sender's clock that no cycle in a row shows, in all [s] */
    double usual_off;                             /* by how much its steps are off by its counter, about [s] */
    int64_t changed_ticks;
    double changed_oldest, young_oldest;          /* before which the strains that changed last, and the last young ones,
                                                     were not sampled [s] */
    int32_t all_frozen, all_repeat;               /* all_repeat: so often that noise hardly allows it */
} SbState;

/* --- the machine ------------------------------------------------------------------------------------------------------ */

/* Bytes of the state for a plan. */
SB_API int64_t sb_size(const SbPlan *plan);
SB_API void sb_begin(const SbPlan *plan, SbState *state, double start);

/* What a frame or the time brings: the frame is taken; it is, and a result is ready; a result is ready, and the frame is
   to be offered again; its authenticator is to be checked, and the frame to be offered again with the verdict. */
enum { SB_TAKEN, SB_READY, SB_AGAIN, SB_AUTHENTICATE };
enum { SB_FLAG_FD = 1, SB_FLAG_AUTHENTIC = 2, SB_FLAG_FORGED = 4, SB_FLAG_STALE = 8 };

/* Take in the frame of a slot (the first of its identifier) that came at `time`. */
SB_API int sb_take(const SbPlan *plan, SbState *state, int slot, const double *time, const uint8_t *data, int n,
                   int flags);

/* SB_READY if a result is due by `now`. */
SB_API int sb_due(const SbPlan *plan, SbState *state, const double *now);

/* Give the ready result its quality by what the estimator made of its strains, at the time of sending: `health` is the
   number of HealthState, -1 without a step; `is_estimated`: its loads are finite. 0 if the result is not to be sent. */
SB_API int sb_answer(const SbPlan *plan, SbState *state, const double *now, int health, int is_estimated);

SB_API void sb_note(SbState *state, uint32_t causes);                       /* for the next result */
SB_API void sb_note_bridge(SbState *state, double until);                   /* another bridge answers */
SB_API void sb_count(SbState *state, int kind, double time);                /* a frame that is not offered */
SB_API void sb_confirm(const SbPlan *plan, SbState *state);                 /* somebody has checked the sender */
SB_API void sb_restart(const SbPlan *plan, SbState *state, double now);     /* the bus was opened again */
SB_API void sb_finish(const SbPlan *plan, SbState *state, double now);      /* the end */

/* The rule of trust, trust.c: quality, and whether loads may be used. */
SB_API int sb_quality(uint32_t causes, int is_long, int ever, int n_used, int is_estimated, int health, int is_protected);
SB_API int sb_usable(int quality, int health);
int has_coefficients(int quality);

/* --- signals ---------------------------------------------------------------------------------------------------------- */

/* Raw numbers of signals in the bytes of their frame, sign extended; of a float its bit pattern. And their values. */
SB_API void sb_raw(const SbSignal *signal, int count, const uint8_t *data, int64_t *raw);
SB_API void sb_physical(const SbSignal *signal, int count, const int64_t *raw, double *value);

/* Write values into a frame of `n_bytes`, with CRC and counter of an E2E profile unless `counter` is below 0. A value that
   its signal cannot hold is "not available"; -1, or the signal that has no such number. */
SB_API int sb_encode(const SbSignal *signal, int count, const double *value, int counter, const SbSlot *protection,
                     uint8_t *data, int n_bytes);

/* A frame that is composed, and its signals in tables of all frames. */
typedef struct {
    uint32_t identifier;
    int32_t is_extended, is_fd, length, kind, modulus, first, n_signals;
    SbSlot protection;
} SentFrame;

enum { MOST_SIGNALS = 512, MOST_BYTES = 64 }; /* a bit each */

#define EXTENDED_FLAG 0x80000000u /* of an identifier with 29 bits, in a key */

/* --- between the files ------------------------------------------------------------------------------------------------ */

uint16_t frame_crc(const SbSlot *slot, const uint8_t *data, int n, const uint8_t *covered, int n_covered);

enum { E2E_OK, E2E_SOME_LOST, E2E_REPEATED, E2E_WRONG_SEQUENCE, E2E_ERROR, E2E_NO_NEW_DATA };
enum { E2E_NO_DATA, E2E_INIT, E2E_VALID, E2E_INVALID };

int e2e_count(const SbPlan *plan, SbState *state, int slot, double time, const uint8_t *data, int n,
              const uint8_t *covered, int n_covered);
void e2e_add(SbSlotState *slot, int status);
int e2e_is_trusted(const SbPlan *plan, const SbState *state, int slot);
int session_is_new(const SbPlan *plan, SbState *state, int session, double time);
void settle(SbState *state, int kind, double time);
void settle_open(SbState *state, int kind, double time); /* of the open cycle */

void close_cycle(const SbPlan *plan, SbState *state, double now);
uint32_t causes_of_others(const SbState *state, double now);

/* What the sender has heard: when it was ready here, and for how long it was known when the strains were sampled [s]. */
typedef struct {
    int is_named, is_known;                       /* the state names a result; this bridge has sent it lately */
    double ready, delay, unseen;
    int64_t ticks;                                /* sample time that the result answers */
} Echo;

int64_t ticks_ahead(int64_t ticks, int64_t than, int bits);
double seconds_ahead(int64_t ticks, int64_t than, int bits, double tick, double passed);
uint32_t clock_date(const SbPlan *plan, SbState *state, int64_t ticks, int counter, double tick, const Echo *echo,
                    double now);
int clock_delay(const SbPlan *plan, SbClock *clock, const SbSlot *slot, int64_t ticks, double time, double *delay);

double stated_pressure(const SbPlan *plan, const SbState *state, double now);

uint32_t gauges_check(const SbPlan *plan, SbState *state, int refuse_all, int64_t ticks, double *repeated,
                      double *doubted);
void gauges_begin(const SbPlan *plan, SbState *state);

static inline void *at(const SbState *s, int32_t place) { return (char *)s + place; }
static inline SbSlotState *slots_of(const SbState *s) { return at(s, s->slots_at); }
static inline SbGauge *gauges_of(const SbState *s) { return at(s, s->gauges_at); }
static inline SbQuantity *quantities_of(const SbState *s) { return at(s, s->quantities_at); }
static inline double *flow_of(const SbState *s) { return at(s, s->flow_at); }
static inline double *strain_of(const SbState *s) { return at(s, s->strain_at); }
static inline uint8_t *valid_of(const SbState *s) { return at(s, s->valid_at); }
static inline uint8_t *reason_of(const SbState *s) { return at(s, s->reason_at); }
static inline uint8_t *data_of(const SbState *s) { return at(s, s->data_at); }

/* A signal of strain in its frame; the next one of a plan, from {0} on. */
typedef struct {
    int slot, k;
    const SbSlot *frame;
    const SbSignal *signal;
    SbSlotState *state;                           /* of the frame */
    SbGauge *gauge;
} Reading;

static inline int next_reading(const SbPlan *p, const SbState *s, Reading *r) {
    for (; r->slot < p->n_slots; r->slot++, r->k = 0) {
        r->frame = &p->slot[r->slot];
        if (r->frame->kind <= SB_HELD && r->k < r->frame->n_signals) {
            r->signal = &p->signal[r->frame->first + r->k++];
            r->state = &slots_of(s)[r->slot];
            r->gauge = &gauges_of(s)[r->signal->target];
            return 1;
        }
    }
    return 0;
}

#endif
