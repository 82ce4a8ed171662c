/* What the bridge does with every frame and every cycle of strains, compiled.

   The caller owns all memory: each state machine is a record of numbers and pointers to arrays, which live as long as
   it is used. Nothing is allocated, records share nothing, and a record serves one thread at a time. sb_sizes guards
   against a caller whose records are of another shape.

   n_d is the number of gauges. Masks are bytes, 1 for true. Times are by the local monotonic clock [s]. */

#ifndef STRAINBUS_H
#define STRAINBUS_H

#include <stddef.h>
#include <stdint.h>

#ifdef _WIN32
#define SB_API __declspec(dllexport)
#elif defined(__GNUC__)
#define SB_API __attribute__((visibility("default")))
#else
#define SB_API
#endif

/* Changes when a function or the meaning of a field does. */
#define SB_VERSION 5

SB_API int64_t sb_version(void);

/* Bytes of each record in the order of this file; returns their number. */
SB_API int64_t sb_sizes(int64_t *size);

/* --- decoder of the signals of a cycle ------------------------------------------------------------------------- */

enum { SB_UNSIGNED, SB_SIGNED, SB_FLOAT };

/* Signals (n) in the bytes of a cycle's frames, one frame behind the other. A signal lies in `count` bytes from `byte`
   on; read as one number, first byte lowest unless `is_big`, it begins `shift` bits above the lowest. */
typedef struct {
    int64_t n;
    const int64_t *byte, *count, *shift, *length, *is_big, *kind;
    const double *scale, *offset, *to_strain; /* value = raw scale + offset in the signal's unit, to m/m */
    const double *low, *high;                 /* values outside are refused */
    const int64_t *has_ends, *first, *last;   /* a converter's ends, which are refused too */
    const int64_t *first_code, *code;         /* raw numbers for "no value"; first_code (n + 1) says whose they are */
    const int64_t *frame;                     /* of each signal */
} SbDecoder;

/* What a cycle holds of each gauge. */
typedef struct {
    double *strain;            /* [m/m], NaN where not present */
    int64_t *raw;              /* raw number, of a float its bit pattern */
    uint8_t *present;          /* its frame has arrived */
    uint8_t *refused;          /* no value, or outside its signal's limits */
} SbCycle;

/* Raw numbers (n) in `data`, sign extended. */
SB_API void sb_raw(const SbDecoder *decoder, const uint8_t *data, int64_t *raw);

/* Values (n) of raw numbers in the signals' units; NaN of a float that is NaN. */
SB_API void sb_physical(const SbDecoder *decoder, const int64_t *raw, double *value);

/* Decode a cycle. `here` says which frames have arrived; data of others are zero. With `refuse_all` no gauge has a
   value that may be used. */
SB_API void sb_decode(const SbDecoder *decoder, const uint8_t *data, const uint8_t *here, int refuse_all,
                      SbCycle *cycle);

/* --- encoder of the signals of a frame ---------------------------------------------------------------------------- */

/* Signals (n) of a frame of `n_bytes`, each in its place as in SbDecoder, and the frame's protection. */
typedef struct {
    int64_t n, n_bytes;
    const int64_t *byte, *count, *shift, *length, *is_big, *kind;
    const double *scale, *offset;             /* value = raw scale + offset in the signal's unit */
    const double *low, *high;                 /* values outside are "not available" */
    const int64_t *has_none, *none;           /* whether there is a raw number for that, and it; a float has NaN */
    int64_t profile, data_id, end;            /* 0 without protection; bytes under the CRC, itself included, -1: all */
} SbEncoder;

/* Write a frame with the nearest raw numbers of the values (n), with this counter and the CRC unless it is below 0:
   -1. Else the index of a signal that cannot hold its value and has nothing for "not available". */
SB_API int64_t sb_encode(const SbEncoder *encoder, const double *value, int counter, uint8_t *data);

/* --- end-to-end protection of a frame ------------------------------------------------------------------------------- */

/* Result of one check, as E2EStatus of strainfmu/can/e2e/check.py. */
enum { SB_OK, SB_SOME_LOST, SB_REPEATED, SB_WRONG_SEQUENCE, SB_ERROR, SB_NO_NEW_DATA };

/* CRC and counter of successive receptions of one frame; profiles 1 and 5 of AUTOSAR. */
typedef struct {
    int64_t profile, data_id, end;              /* bytes under the CRC, itself included; -1 for all */
    int64_t counter_byte, counter_bits, modulus, max_delta;
    int64_t capacity;                           /* of each content */
    double period;                              /* from one counter to the next [s] */
    double *heard;                              /* (modulus) state: when each counter has come [s] */
    uint8_t *content, *content_before;          /* data and covered bytes of the last two counters */
    int64_t n_content, n_content_before;        /* state; -1 for none */
    int64_t counter, before;
    int64_t conflicts, alternates;              /* what the last check found, see ReceptionCheck */
} SbCheck;

/* Check a frame that came at `time` with `covered`, bytes of other frames under the same CRC. */
SB_API int64_t sb_check(SbCheck *check, const double *time, const uint8_t *data, int n_data, const uint8_t *covered,
                        int n_covered);

/* State of the communication, as E2EState of strainfmu/can/e2e/state_machine.py. */
enum { SB_NO_DATA, SB_INIT, SB_VALID, SB_INVALID };

typedef struct {
    int64_t window_size, min_ok_init, max_error_init, min_ok_valid, max_error_valid, min_ok_invalid, max_error_invalid;
    uint8_t *window;                            /* (window_size) the last checks, a ring */
    int64_t state, next, count, ok, errors;
} SbMachine;

/* Take in the status of a check; the state. */
SB_API int64_t sb_machine_add(SbMachine *machine, int status);

enum { SB_CONFIGURATION_OF = 8 }; /* next to the status: the frame is of another configuration */

enum { SB_NUMBER_STATUS, SB_NUMBER_SAMPLE_TIME, SB_NUMBER_CONFIGURATION, SB_NUMBER_COUNTER, SB_N_NUMBERS };

/* What reads and checks one frame of an input. */
typedef struct {
    const SbDecoder *signals;                   /* of the frame */
    int64_t length;
    int64_t place[SB_NUMBER_COUNTER];           /* of the signals of the first numbers, -1 without */
    int64_t expected;                           /* configuration */
    SbCheck *check;                             /* NULL without protection */
    SbMachine *machine;
    const SbMachine *trusted_by;                /* the same, or the trailer's, which covers frames of strains */
    int64_t *number;                            /* (SB_N_NUMBERS) of the last frame, 0 of what it does not hold; its
                                                   counter is -1 without protection */
} SbSlot;

/* Read the numbers about a frame; 0 if its length is another. */
SB_API int64_t sb_slot_read(SbSlot *slot, const uint8_t *data, int n_data);

/* Check a frame whose numbers have been read, and take the result into its state: the status, and
   SB_CONFIGURATION_OF. */
SB_API int64_t sb_slot_check(SbSlot *slot, const double *time, const uint8_t *data, int n_data);

/* Both at once; -1 if its length is another. */
SB_API int64_t sb_slot_receive(SbSlot *slot, const double *time, const uint8_t *data, int n_data);

/* Forget all checks, as after a restart of the sender or of the bus. */
SB_API void sb_machine_reset(SbMachine *machine);

/* --- assembly of cycles --------------------------------------------------------------------------------------------- */

/* The frames of a cycle by slot, strains first. */
typedef struct {
    int64_t n;                                  /* frames that have arrived */
    double first_time, last_time;               /* of their arrival [s] */
    uint8_t *data;                              /* one frame behind the other; zero where none has arrived */
    uint8_t *here;                              /* (n_slots) has arrived, or is held for the cycle */
    int64_t *order;                             /* (n_slots) slots in the order of arrival */
    double *time;                               /* (n_slots) of arrival [s] */
    int64_t *number;                            /* (n_slots, SB_N_NUMBERS) */
} SbParts;

/* See strainfmu/can/cycle/frames/assembler.py. */
typedef struct {
    int64_t n_slots, n_whole, trailer;          /* frames; of a complete cycle; slot of the trailer, -1 without */
    int64_t is_timed, bits, late_limit;
    double wait;                                /* from the first frame to the deadline [s] */
    const int64_t *start;                       /* (n_slots + 1) where the bytes of each frame begin */
    SbParts *const *parts;                      /* (2) */
    int64_t open;                               /* state: index of the open cycle, -1 for none */
    int64_t has_newest, newest, late;
    double deadline;                            /* of the open cycle, infinite without [s] */
    int64_t *closed;                            /* (2) indices of the cycles that the last frame has closed */
} SbAssembler;

enum { SB_IN_CYCLE, SB_TWICE, SB_LATE, SB_RESTARTED_CYCLES };
#define SB_CLOSED 4 /* times the number of cycles that the frame closes, added to what became of it */

/* Put a frame that arrived at `time` into its cycle. What it closes must be done with before the next frame comes. */
SB_API int64_t sb_offer(SbAssembler *assembler, int slot, const uint8_t *data, const int64_t *number,
                        const double *time);

/* Close the open cycle: its index, -1 if there is none. */
SB_API int64_t sb_close(SbAssembler *assembler);

/* --- watch for gauges that are frozen together ------------------------------------------------------------------- */

#define SB_LONGEST_RUN 63 /* repetitions in the tables; longer runs count as so many */

/* See strainfmu/can/cycle/gauges/freeze_watch.py for what is tested. Groups are the frames, then all gauges. */
typedef struct {
    int64_t n, n_groups, shortest_run, block, alive, is_known;
    double limit, scatter_limit;                /* logarithm of the false-alarm probability; evidence beyond which */
    double log_ratio, slope, margin, smallest_scatter, largest_learned, memory_length;
    double held_evidence, largest_evidence;
    const int64_t *order, *group_first;         /* gauges by group; group_first (n_groups + 1) */
    const int64_t *frame;                       /* group of each gauge's frame */
    const double *choices;                      /* log of the choices of 1 .. k gauges of each group, as `order` lies */
    const double *step, *weight, *largest;      /* of each gauge */
    const double *steps_squared;                /* of each group */
    const double *log_repeated, *log_repeated_zero; /* (rows, SB_LONGEST_RUN + 1) */
    const int64_t *row;                         /* of each gauge */
    const double *least;                        /* (SB_LONGEST_RUN + 1) smallest logarithm of any gauge */
    double *difference, *squares, *counts;      /* state of each gauge */
    uint8_t *has_moved, *too_little, *found;
    uint8_t *repeating;                         /* gauges of `found` that repeat their reading together */
    double *level, *learned, *memory, *evidence; /* state of each group */
    double *log_probability, *ranked;           /* scratch (n) */
    double *mean;                               /* scratch (2, n_groups) */
    int64_t blocked, any_too_little;
} SbWatch;

/* Take in the readings' second differences; 1 if the usual scatter has changed so much that `row` and `least` are to
   be derived again before sb_watch_find. */
SB_API int64_t sb_watch_scatter(SbWatch *watch, const double *difference, const int64_t *run);

/* Find which of the gauges `present` are frozen: 1 and the mask `found`; 0 if none is. */
SB_API int64_t sb_watch_find(SbWatch *watch, const double *strain, const int64_t *run, const uint8_t *present);

/* --- strains that repeat an earlier cycle's ----------------------------------------------------------------------- */

#define SB_REPEATS_PLACES (1 << 18)

/* Hashes of the readings of frames and of whole cycles, each in the place that its low bits state; a later one takes the
   place. */
typedef struct {
    uint64_t *hash;                             /* (SB_REPEATS_PLACES), 0 for none */
    uint64_t *last;                             /* (n_groups) of the last cycle: of each frame, then of all */
    const uint8_t *is_kept;                     /* (n_groups) whether noise lets repetitions be found */
    int64_t n_groups, n;                        /* hashes in it, at most */
    int64_t counts, alarm;                      /* cycles for which a repetition counts, and for how many */
    double limit;                               /* logarithm of the largest probability of a repetition that is none */
} SbRepeats;

/* Forget all cycles. */
SB_API void sb_repeats_forget(SbRepeats *repeats);

/* --- frames that have been received before ------------------------------------------------------------------------ */

#define SB_SEEN_WORDS (1 << 20) /* of 64 bits */

/* Remember `count` bytes; 1 if they are new. See strainfmu/can/cycle/frames/restart_proof.py. */
SB_API int64_t sb_seen_add(uint64_t *words, const uint8_t *data, int count);

/* --- clock of the sender -------------------------------------------------------------------------------------------- */

enum { SB_JUMPED = 1, SB_RESTARTED = 2, SB_HIDES_DELAY = 4, SB_RESUMED = 8 };

#define SB_MINIMA 60 /* windows whose smallest delays are kept */

/* The smallest delays of successive windows. */
typedef struct {
    double length;                     /* of a window [s]; 0: none is kept */
    double start, at, least;           /* state: of the present window, and when its smallest delay was [s] */
    int64_t n;                         /* windows so far; the last SB_MINIMA of them are kept */
    double minimum[2 * SB_MINIMA];     /* time and smallest delay of each, in turn */
} SbMinima;

/* Time by the counter of cycles: a second clock of the sender, which steps of the first do not touch. */
typedef struct {
    int64_t modulus;                   /* of the counter, 0 without */
    double period;                     /* of its steps by the sender's clock: stated, then measured [s] */
    int64_t is_set, last;              /* state */
    int64_t is_measured, is_irregular; /* the sender has a period: 0 no, 1 in doubt, 2 yes; it has been found to have none */
    double source, local;              /* last sample time, its arrival [s] */
    double earliest, latest;           /* when the last strains were sampled, by our clock [s] */
    int64_t n, n_odd, steps, regular_steps, early_steps, late_steps;
    double begin, regular;             /* sample time at the start of the measurement; sum of regular intervals [s] */
    double kept;                       /* doubt from before the counter last showed no time [s] */
    double doubt;                      /* by how much the age may differ from that by the clock [s] */
} SbCount;

/* One clock that the readings may be of. */
typedef struct {
    int64_t is_set, ticks, readings;
    double source, local; /* of the last reading, by that clock and by ours [s] */
    double floor;         /* smallest delay, raised with time [s] */
    double lowest;        /* smallest value of the floor, less what was hidden before a restart [s] */
    double start;         /* our time of the first reading [s] */
    double fastest;       /* delay at the start of the fastest clock that no reading contradicts [s] */
    double doubt;         /* delay that may have been there when the clock was first read [s] */
    double either;        /* age of readings that may be of another clock, without age [s] */
    double begin;         /* first sample time [s] */
    int64_t counter;      /* of the first reading, of a clock before a restart of the last one; -1 without */
    int64_t is_new, new_counter; /* the last reading was of new frames; counter of the first of them in a row */
    double least_age, new_begin; /* of these: smallest age; first sample time [s] */
} SbModel;

/* See strainfmu/can/e2e/sample_clock.py and synchronised_clock.py. */
typedef struct {
    int64_t bits, confirmations, is_synchronised;
    double tick, range, pace, tolerance, hidden, jump_tolerance, steady, round_off;
    double stated, wander, straight;   /* pace; change of a rate that was measured; how far minima are from a line [s] */
    double shift, accuracy;            /* of a synchronised clock */
    SbModel known, jumped, before;     /* state */
    SbMinima drift, rate;              /* for what is shown; for what is corrected */
    SbCount count, count_before;       /* of the known clock, and of that before a restart */
    int64_t is_learned;                /* the pace has been measured */
    double age, uncertainty;           /* of the last reading [s] */
} SbClock;

/* Take in a sample time that arrived at `local` with a counter, -1 without; the flags above. */
SB_API int64_t sb_clock_read(SbClock *clock, const double *local, const int64_t *ticks, const int64_t *counter);
SB_API void sb_clock_reset(SbClock *clock);

/* --- proof of a sender whose time has jumped ------------------------------------------------------------------------ */

/* See strainfmu/can/cycle/frames/restart_proof.py. */
typedef struct {
    int64_t new_frames, max_delta, modulus;     /* modulus of the counter, 0 without */
    int64_t accepts;                            /* a confirmed jump is a restart, without more proof */
    double period, startup_time, pause;
    int64_t is_proven, n_new, begins, has_begun, has_last, last_counter; /* state; a counter of -1 is none */
    double last_local, heard;                   /* [s]; never heard: NaN */
} SbProof;

/* Which time it is by the clock of the strains. */
typedef struct {
    double local, seconds;                      /* of the last reading, by our clock and by that; NaN without [s] */
    const SbProof *proof;                       /* NULL without */
} SbStrainTime;

/* The time at `now` by the clock of a proven sender of strains [s]; NaN if it is not known. */
SB_API void sb_strain_time(const SbStrainTime *strain_time, const double *now, double *found);

/* --- flow and navigation between their frames ---------------------------------------------------------------------- */

/* One quantity. See strainfmu/can/cycle/estimate/held_flow.py. */
typedef struct {
    int64_t index;                                      /* of its signal in the frame */
    double to_si, si_offset, smallest, largest, tolerance;
    double max_age;                                     /* for which it is held [s] */
    SbClock *clock;                                     /* NULL without sample time */
    int64_t new_frames;                                 /* in a row, which prove a sender; 0: it needs no proof */
    double value, sampled, stated, stated_at;           /* state [SI] and [s] */
    int64_t to_be_proven, n_new, shares_clock, hides_delay, was_known;
} SbValue;

typedef struct {
    const SbDecoder *signals;
    int64_t sample_time, status;                        /* indices of signals, -1 without */
    int64_t worst_status;                               /* with which values are used */
    const uint8_t *prefix;                              /* (4) what distinguishes its data from the data of others */
    int64_t length;
    uint64_t *seen;
    int64_t n_values;
    SbValue *const *value;
    const SbStrainTime *strain_time;
} SbFlow;

/* Take in a frame received at `time`. 1 if any value of it may be used. */
SB_API int64_t sb_flow_take(SbFlow *flow, const uint8_t *data, const double *time);

enum { SB_DELAY_HIDDEN = 1, SB_LOST = 2 };

/* What is known of `count` quantities at `now`: known (count) [SI], NaN of what may not be used. The flags say whether
   more delay may hide than is allowed in any, and whether any was known before and is not any more. */
SB_API int64_t sb_flow_known(SbValue *const *value, int count, const double *now, double *known);

/* --- checks of each gauge by its values --------------------------------------------------------------------------- */

enum {
    SB_ALL_VALID = 1,  /* every gauge may be used */
    SB_HAS_FROZEN = 2, /* gauges are frozen together */
    SB_ALL_ZERO = 4,   /* all present gauges read exactly zero */
    SB_LEARNED = 8     /* stopped half way: derive what follows from the usual scatter, then call sb_checks_end */
};

enum { SB_OUT_OF_RANGE, SB_JUMPS, SB_FROZEN, SB_ZERO, SB_N_FAULTS };

/* See strainfmu/can/cycle/gauges/plausibility.py. */
typedef struct {
    int64_t n, heal_cycles, looks_for_frozen;
    int64_t is_dated;                           /* cycles have a sample time, which shows that they were held back */
    double cycle_time, sensor_range, rate_limit, zero_jump, round_off, pace_factor, fading;
    const double *period, *cycles_apart, *stuck_cycles;
    const int64_t *zero_cycles;
    const uint8_t *is_fast;                     /* comes in every cycle, where others come more slowly */
    double *difference, *last_strain, *last_good, *good_time, *pace, *changed, *heard, *unheard; /* state */
    int64_t *last_raw, *repeats, *zeros, *good;
    uint8_t *seen, *stuck;
    uint8_t *fault;                             /* (SB_N_FAULTS, n) */
    uint8_t *valid;                             /* (n) */
    double *frozen_for;                         /* (3) result of sb_checks_frozen [s] */
    int64_t may_be_chance;                      /* so many repetitions are no sign that anything is frozen */
    double rare;                                /* square of the probability of what is none */
    double unchanged, memory, memory_length;    /* part of the cycles in which no gauge changed, and their number */
    int64_t last_run;                           /* repetitions of all gauges up to the last cycle */
    SbWatch *watch;
} SbChecks;

/* Check a cycle that came at `now`; the flags above. */
SB_API int64_t sb_checks_update(SbChecks *checks, const SbCycle *cycle, const double *now);
SB_API int64_t sb_checks_end(SbChecks *checks, const SbCycle *cycle, const double *now);

/* Remember the frames of a cycle that is not judged. */
SB_API void sb_repeats_remember(SbRepeats *repeats, const SbChecks *checks, const SbCycle *cycle);

/* For how long none of the cycle's gauges has changed, and for how much longer or shorter that may be: frozen_for. The noise of
   quiet gauges may give that by chance: may_be_chance. */
SB_API void sb_checks_frozen(SbChecks *checks, const SbCycle *cycle, const double *now);

/* --- one frame, from its acceptance to its cycle ------------------------------------------------------------------ */

enum { SB_ACCEPTED, SB_WRONG_FORMAT, SB_SHED };

/* One identifier of a layout: its format, and a bucket of tokens that fills with time. */
typedef struct {
    int64_t is_fd, length;
    double rate, capacity;                      /* tokens per second, and at most */
    double tokens, time;                        /* that are left, and when they were counted [s] */
} SbBucket;

/* Take a token for a frame received at `time` [s]. */
SB_API int64_t sb_bucket_take(SbBucket *bucket, int n_data, int is_fd, const double *time);

/* Where the frames of one identifier go: into a cycle, or to what holds the flow. */
typedef struct {
    SbBucket *bucket;
    SbSlot *slot;
    int64_t index;                              /* of the slot */
    SbAssembler *assembler;
    SbFlow *flow;                               /* NULL if none of its values is used */
    int64_t is_strain;
    const double *next_status;                  /* when silence is to be answered [s] */
} SbPort;

/* What becomes of a frame; SB_EVENT_CYCLE + the result of sb_offer, or SB_EVENT_CHECK + the result of sb_slot_check. */
enum {
    SB_EVENT_DUE,                               /* nothing yet: another thing is due before it */
    SB_EVENT_WRONG_FORMAT,
    SB_EVENT_SHED,
    SB_EVENT_USED,
    SB_EVENT_NOT_USABLE,
    SB_EVENT_NOT_TRUSTED,
    SB_EVENT_CYCLE = 16,
    SB_EVENT_CHECK = 32
};

SB_API int64_t sb_receive(SbPort *port, const double *time, const uint8_t *data, int n_data, int is_fd);

/* --- judgement of a closed cycle ----------------------------------------------------------------------------------- */

/* Causes of strainfmu/can/cycle/states/quality.py that are found here. */
enum {
    SB_PARTIAL_CYCLE = 1 << 0,
    SB_GAUGE_INVALID = 1 << 1,
    SB_CAUSE_NOT_TRUSTED = 1 << 2,
    SB_CYCLE_CRC = 1 << 3,
    SB_OLD = 1 << 4,
    SB_CAUSE_FROZEN = 1 << 5,
    SB_DYNAMIC_PRESSURE = 1 << 7,
    SB_CLOCK_JUMP = 1 << 8,
    SB_SENDER_STATUS = 1 << 9,
    SB_HIDDEN_DELAY = 1 << 16,
    SB_UNPROVEN_RESTART = 1 << 17,
    SB_CAUSE_REPEATS = 1 << 27
};

/* Why no gauge of a cycle is used. */
enum { SB_REFUSED_NOT, SB_REFUSED_UNVERIFIED, SB_REFUSED_REPEATED, SB_REFUSED_SEQUENCE, SB_REFUSED_UNTRUSTED, SB_REFUSED_OLD };

/* What a judgement found. */
enum {
    SB_FOUND_CAUSES,
    SB_FOUND_REFUSED,
    SB_FOUND_N_VALID,                           /* gauges that are used */
    SB_FOUND_LOST,                              /* a quantity of the flow was known and is not any more */
    SB_FOUND_NAMED,                             /* slot of the frame that identifies the cycle */
    SB_FOUND_SAMPLE_TIME,                       /* its numbers */
    SB_FOUND_COUNTER,
    SB_FOUND_STATUS,                            /* worst status of the sender */
    SB_FOUND_CHECKED,                           /* the trailer has been checked */
    SB_N_FOUND
};

/* The parts that a cycle passes, what is known of the flow, and the result. */
typedef struct {
    const SbAssembler *assembler;
    SbSlot *const *slot;                        /* (n_slots) */
    int64_t n_strain;
    const uint8_t *is_held;                     /* (n_slots) need not come in every cycle */
    const SbDecoder *decoder;
    SbCycle *cycle;
    SbChecks *checks;
    uint64_t *seen;
    SbRepeats *repeats;                         /* NULL where strains may repeat themselves */
    SbClock *clock;                             /* NULL where nothing dates a cycle */
    SbProof *proof;                             /* NULL without */
    SbStrainTime *strain_time;
    SbValue *const *value;                      /* (n_values) */
    int64_t n_values, pressure;                 /* place of q_inf, -1 without */
    int64_t is_fixed;                           /* q_inf is the same in the whole run */
    double period, max_age, max_uncertainty, hidden_age;
    int64_t n_late, longest_late;               /* cycles in a row that are too old, and how many need no more words */
    int64_t worst_status, unusable;             /* status of the sender, and causes, with which strains are not used */
    SbCycle *passed;                            /* the last cycle that was passed over */
    int64_t has_passed, may_be_held_back;       /* state; by the pace of cycles without sample time */
    double passed_time;
    double changed_age, changed_doubt;          /* of the last cycle in which a gauge changed, NaN if not known [s] */
    uint64_t trailer_status;                    /* of the cycle, 0 without */
    int64_t has_frozen;                         /* gauges of the cycle are frozen together */
    const uint8_t *nothing;                     /* zeros, as many as a cycle's bytes */
    uint8_t *plausible, *trusted, *valid;       /* (n) */
    double *strain;                             /* (n) that may be used, NaN of others [m/m] */
    double *known;                              /* (n_values) [SI], NaN of what may not be used */
    double *age;                                /* (2) of the strains, and its uncertainty, NaN if nothing dates them [s] */
    int64_t *found;                             /* (SB_N_FOUND) */
} SbJudge;

enum {
    SB_JUDGED,
    SB_TO_LEARN,    /* derive what follows from the usual scatter, then call sb_judge_learned */
    SB_TO_SEE_ZERO  /* all present gauges read exactly zero: none is `plausible` if there is a load; then sb_judge_go_on */
};

/* Take in which frames are missing, and check the trailer. */
SB_API void sb_judge_verify(SbJudge *judge, const SbParts *parts);

/* Verify, decode and judge a cycle that was closed at `now`. */
SB_API int64_t sb_judge_cycle(SbJudge *judge, const SbParts *parts, const double *now);
SB_API int64_t sb_judge_learned(SbJudge *judge, const SbParts *parts, const double *now);

/* Decode a cycle that has been verified. */
SB_API void sb_judge_decode(SbJudge *judge, const SbParts *parts);

/* Judge a cycle that has been verified and decoded, and whose `plausible` gauges are known. */
SB_API void sb_judge_go_on(SbJudge *judge, const SbParts *parts, const double *now);

/* Verify and remember a closed cycle that is not judged: why it is not to be used. */
SB_API int64_t sb_judge_pass_over(SbJudge *judge, const SbParts *parts);

/* Forget the sender of quantities of the flow. */
SB_API void sb_flow_reset(SbValue *const *value, int count);

#endif
