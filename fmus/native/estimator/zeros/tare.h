/* A tare by the edges of the input `tare`, or of a whole window of readings at once. Limits and the strain of flights and of
   known loads are part "tare" of resources/map.bin. */

#ifndef TARE_H
#define TARE_H

#include "tare_judge.h"

/* Read the part, if there is one, and allocate. 1; 0 after a message. */
int tare_create(MapFile *file, size_t n_gauges, double largest_zero, Tare *tare);

/* Another tare of the same map, which has not begun; that must live as long. 1; 0 without memory. */
int tare_like(const Tare *other, Memory *memory, Tare *tare);
void tare_reset(Tare *tare);

/* Take in the input at a step or an event; whether there are other zeros now. */
int tare_follow(Tare *tare);

/* Take in tare->reading (n_gauges), NaN for gauges not in use, and the dynamic pressure [Pa], NaN if it is not known. */
void tare_take(Tare *tare, double dynamic_pressure);

/* Whether tare_take is to be called. */
static inline int tare_is_averaging(const Tare *tare) {
    return tare->flags.state == (double)TARE_AVERAGING;
}

/* Judge a window of `count` samples at once: strain (count, n_gauges), dynamic_pressure (count) [Pa], NaN where there
   is none. The outcome is in judged and verdict; the state of a tare by edges stays, its window does not. */
void tare_whole(Tare *tare, size_t count, const double *strain, const double *dynamic_pressure);

/* Set tare->reading; what is not finite, or so large that its square might not be, is none. */
void tare_set_reading(Tare *tare, const double *strain);

/* Forget the zeros: others are given. */
void tare_drop(Tare *tare);

/* The state in bytes; whether bytes may be read. */
size_t tare_state_size(const Tare *tare);
void tare_write_state(const Tare *tare, unsigned char *bytes);
int tare_state_fits(const Tare *tare, const unsigned char *bytes);
void tare_read_state(Tare *tare, const unsigned char *bytes);

/* The records of a tare: what it is given, and what it found.

   Limits: dynamic_pressure [Pa], zero, drift; then (n_gauges) known_strain and known_strain_std. The outcome:
   (n_gauges) zero, zero_std, one zero_common_std, (n_gauges) whether a gauge reads, scatter; then the flags and the
   verdict, in the order of TareFlags and TareVerdict. */

enum { N_TARE_LIMITS = 3, N_TARE_VERDICT = sizeof(TareVerdict) / sizeof(double) };

/* Names of the fields of one value each. */
extern const char *const TARE_LIMIT_NAMES[N_TARE_LIMITS];
extern const char *const TARE_VERDICT_NAMES[N_TARE_VERDICT];

/* Judge by `limits` from now on, which must live as long as that; by the limits of `of_map` if they are NULL. */
void use_limits(Tare *tare, const TareLimits *of_map, const double *limits);

/* Write the outcome of which the zeros (2 n_gauges + 1) are `zero`. */
void write_tare(const Tare *tare, const double *zero, double *outcome);

#endif
