/* The estimator without FMI: open a map, give it samples, read loads with their uncertainty.

       char text[SL_TEXT_SIZE];
       StrainLoad *handle = sl_open(bytes, length, text);      bytes of resources/map.bin
       double *input = malloc(sl_size(handle, SL_INPUTS) * sizeof *input);
       double *output = malloc(sl_size(handle, SL_OUTPUTS) * sizeof *output);
       ... fill input, NaN for what is not known ...
       sl_step(handle, time, input, NULL, output);             one sample after another
       sl_close(handle);

   A sample is a record of float64 values, and so is its result; sl_field gives name, position and length of each field
   of a record. Nothing is allocated but by sl_open. Handles share nothing: a handle serves one thread at a time, and
   pieces of a recording that are independent run on as many threads as there are handles. */

#ifndef STRAINLOAD_H
#define STRAINLOAD_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#ifdef _WIN32
#define SL_API __declspec(dllexport)
#elif defined(__GNUC__)
#define SL_API __attribute__((visibility("default")))
#else
#define SL_API
#endif

/* Changes when a function or the meaning of a field does. */
#define SL_VERSION 5

#define SL_TEXT_SIZE 256
#define SL_NAME_SIZE 64

typedef struct StrainLoad StrainLoad;

/* The records of a handle, for sl_size and sl_field; and numbers for sl_size alone. */
enum {
    SL_INPUTS,      /* of a sample: readings, air data, temperatures, flow parameters */
    SL_SETTINGS,    /* what holds for all samples: limits, references, zero offsets, time constant of the filter */
    SL_OUTPUTS,     /* loads, coefficients, their standard deviations, health, air data, other loads */
    SL_FIT,         /* covariances, residuals and gauges of the sample, which come behind the outputs on request */
    SL_TARE_LIMITS, /* what a tare accepts, and the strain of the loads that act meanwhile */
    SL_TARE,        /* outcome of a tare: zero offsets, their standard deviations, and what speaks against them */
    SL_ROWS,        /* sensors of the map: strain gauges, then the others */
    SL_STATE,       /* bytes of what a sample leaves to the next one */
    SL_TARE_STATE,  /* bytes of a tare by steps */
    SL_ITERATIONS,  /* most iterations of a sample: the field "iterations" of SL_OUTPUTS never exceeds it; 0 without tables */
    SL_STACK,       /* bytes of stack that no function needs more of */
    SL_MEMORY       /* bytes of a handle: the size of a buffer of sl_open_in; sl_open takes the map's copy besides */
};

/* How the samples of a series follow one another. */
enum {
    SL_EACH, /* each by itself, without memory */
    SL_TRACK /* each from what the one before it left; the filter runs if its time constant is positive */
};

typedef struct {
    char name[SL_NAME_SIZE]; /* of the signal in FMUs, without its index */
    size_t first, count;     /* position in its record, and number of values */
} SlField;

SL_API int sl_version(void);

/* The estimator of a map, at its start values. bytes are copied. NULL, after a message of one line. */
SL_API StrainLoad *sl_open(const void *bytes, size_t length, char text[SL_TEXT_SIZE]);

/* The same without a heap: in a buffer of `size` bytes, at any address, which the handle uses until sl_close, as it does
   bytes, which are not copied and lie at a multiple of 8. */
SL_API StrainLoad *sl_open_in(const void *bytes, size_t length, void *buffer, size_t size, char text[SL_TEXT_SIZE]);
SL_API void sl_close(StrainLoad *handle);

/* Number of values of a record, of rows, of iterations, or of bytes. */
SL_API size_t sl_size(const StrainLoad *handle, int record);

/* Field `index` of a record. 1; 0 if there is none. */
SL_API int sl_field(const StrainLoad *handle, int record, size_t index, SlField *field);

/* Settings from position `first` on. 1; 0, after a message, if one is refused: those before it are set then. */
SL_API int sl_set(StrainLoad *handle, size_t first, size_t count, const double *value, char text[SL_TEXT_SIZE]);
SL_API void sl_get(const StrainLoad *handle, size_t first, size_t count, double *value);

/* Standard deviations of zero offsets change matrices. After the first sample of SL_TRACK, each of the following ones makes a
   part of the new matrices, in bounded time: until they are made, the zero offsets of before hold, and health is DEGRADED.
   This makes them at once, for a caller without a deadline. */
SL_API void sl_renew(StrainLoad *handle);

/* Forget the samples so far; settings stay. */
SL_API void sl_restart(StrainLoad *handle);

/* One sample at `time` [s], by SL_TRACK. valid (rows) is 1 for sensors that may be used, NULL for all of them. output
   (SL_OUTPUTS) is written. */
SL_API void sl_step(StrainLoad *handle, double time, const double *input, const unsigned char *valid, double *output);

/* `count` samples at once. time (count) [s], NULL for 0; one that is not finite is the time of the sample before. valid
   (count, rows) or NULL. start (count, 4) is the flight state from which each sample of SL_EACH starts, NULL for a search
   of the tables. output (count, SL_OUTPUTS), or with the fit (count, SL_OUTPUTS + SL_FIT). */
SL_API void sl_series(StrainLoad *handle, int how, int with_fit, size_t count, const double *time, const double *input,
                      const unsigned char *valid, const double *start, double *output);

/* What the last sample left, as bytes (SL_STATE); and back. 1; 0, after a message, if it is no state of this map. */
SL_API void sl_state(const StrainLoad *handle, unsigned char *bytes);
SL_API int sl_restore(StrainLoad *handle, const unsigned char *bytes, char text[SL_TEXT_SIZE]);

/* Why zero offsets are not to be used: bits of the field "faults" of SL_TARE. */
enum {
    SL_NO_PRESSURE = 1, /* dynamic pressure of a step is not known */
    SL_PRESSURE = 2,    /* |dynamic_pressure| is above its limit: of a window the largest one, or of the last step */
    SL_SHORT = 4,       /* too few samples; nothing else is judged */
    SL_DRIFTS = 8,      /* drifting_gauge rises by drift over the window */
    SL_MOVES = 16,      /* moving_gauge scatters by moving_scatter */
    SL_TOO_LARGE = 32,  /* largest_gauge reads largest, less known strain */
    SL_LIKE_LOAD = 64,  /* along, the part along the strain of the mean flight, is more than along_limit */
    SL_FEW_GAUGES = 128 /* fewer than half of the gauges have a zero */
};

/* The field "state" of SL_TARE. */
enum { SL_TARE_IDLE, SL_TARE_AVERAGING, SL_TARE_DONE, SL_TARE_REFUSED };

/* Zero offsets from a window of `count` samples at rest: strain (count, strain gauges) [1], dynamic_pressure (count)
   [Pa], NaN where there is none. limits (SL_TARE_LIMITS), NULL for the limits of the map. outcome (SL_TARE) is written:
   zero offsets also where something speaks against them, 0 with the largest standard deviation of gauges that do not read.
   Gauges are counted from 1. The handle goes on with the zero offsets of its settings: sl_set gives it others. */
SL_API void sl_tare(StrainLoad *handle, const double *limits, size_t count, const double *strain,
                    const double *dynamic_pressure, double *outcome);

/* A tare by steps: samples while `is_up` are averaged, then judged in the first step without. strain (strain gauges)
   and dynamic_pressure of the step, which must be known. outcome (SL_TARE) is written, with the zero offsets of the
   last tare that was not refused. 1 if there are other zero offsets; 0 if not. */
SL_API int sl_tare_step(StrainLoad *handle, const double *limits, int is_up, const double *strain,
                        double dynamic_pressure, double *outcome);

/* Forget the zero offsets of tares by steps: others are given. */
SL_API void sl_tare_drop(StrainLoad *handle, double *outcome);

/* A tare by steps as bytes (SL_TARE_STATE); and back. 1; 0, after a message, if it is no state of one. */
SL_API void sl_tare_state(const StrainLoad *handle, unsigned char *bytes);
SL_API int sl_tare_restore(StrainLoad *handle, const unsigned char *bytes, double *outcome, char text[SL_TEXT_SIZE]);

#ifdef __cplusplus
}
#endif

#endif
