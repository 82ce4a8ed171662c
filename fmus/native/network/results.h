/* Results as values of the frames that state them: of the ECU, and of the bridge on a computer. */

#ifndef RESULTS_H
#define RESULTS_H

#include "../bus/bus.h"

/* A frame that is composed, and its signals in tables of all frames. */
typedef struct {
    uint32_t identifier;
    int32_t is_extended, is_fd, length, kind, modulus, first, n_signals;
    SbSlot protection;
} SentFrame;

enum { MOST_SIGNALS = 512, MOST_BYTES = 64 }; /* a bit each */

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

/* What the estimator made of a result. */
typedef struct {
    const double *loads;                          /* (N_REAL_LOADS,); NULL without a step */
    double chi_square, score, pressure;           /* NaN where not known */
    int health, n_gauges, configuration;          /* health: -1 without a step */
} SbEstimate;

/* What the status says of the results so far. */
typedef struct {
    double loads[N_LOADS_SENT], ready, age;       /* of the last one that is VALID or UNPROTECTED; [s] */
    double score, detail[N_DETAILS];              /* of the last one */
    uint64_t results;
    int32_t has_last, has_valid;
} SbLast;

int has_coefficients(int quality);
void keep_last(SbLast *last, const SbResult *r, const SbEstimate *estimate);

/* Values of the status, but for those of the controller and of the sending. */
void status_values(const SbLast *last, const SbAccount *account, double time, int configuration, double *value);

/* Values of the details of the last result, if there is any. */
void last_details(const SbLast *last, double *value);

void result_values(const SbResult *r, const SbEstimate *estimate, double *value);
void detail_values(const SbResult *r, double *value);

/* What is sent of a load, in steps rounded up, 0 for none: a standard deviation is never stated smaller than it is. */
double sent_value(double estimate, double step);

#endif
