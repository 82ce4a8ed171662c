/* The matrices of the map follow the standard deviations of zero offsets: in a step a part of those for other ones, at once
   where nothing has a deadline. */

#ifndef RENEWAL_H
#define RENEWAL_H

#include "policies/flight.h"
#include "temperature/thermal.h"

typedef struct {
    Linear *linear;
    Flight *flight;
    Thermal *thermal;
    size_t n_strains;
    double under_way; /* whether a step has been taken; these three float64, as they are serialised */
    double parts;     /* of the matrices for `target` that are made, */
    double waited;    /* and steps in a row that made none */
    int made;         /* whether those are all: the next step uses the matrices */
    double *held;     /* (number_of_zeros) in use in the last step; the map holds for their standard deviations */
    double *target;   /* (number_of_zeros) those that matrices are made for */
} Renewal;

/* Hand out the arrays. */
void renewal_arrays(size_t n_strains, Renewal *renewal, Room *room);

/* No step has been taken. */
void renewal_reset(Renewal *renewal);

/* Let the map hold for zeros that are given (number_of_zeros), and, if they are others, for the known temperature sensors. */
void renewal_at_once(Renewal *renewal, const double *given, int other_sensors);

/* A step begins, of zeros that are given: the first one follows them at once, others use matrices that are made. Whether
   the map has other matrices. */
int renewal_begin_step(Renewal *renewal, const double *given);

/* The estimate of the step is made; whether that took long. */
void renewal_end_step(Renewal *renewal, const double *given, int long_step);

/* Whether steps have yet to follow zeros that are given; and which are in use. */
int renewal_pending(const Renewal *renewal, const double *given);
const double *renewal_zeros(const Renewal *renewal, const double *given);

/* The state in bytes; whether bytes may be read, with zeros up to the largest one. */
size_t renewal_state_size(const Renewal *renewal);
void renewal_write_state(const Renewal *renewal, unsigned char *bytes);
int renewal_state_fits(const Renewal *renewal, double largest_zero, const unsigned char *bytes);
void renewal_read_state(Renewal *renewal, const unsigned char *bytes);

#endif
