/* The variables of the FMU by number, which is the value reference of FMI 2.0: outputs, strains, valid flags, then
   the scalar inputs and settings. FMI 3.0 gathers them into arrays. */

#ifndef VARIABLES_H
#define VARIABLES_H

#include "instance.h"

/* Number of scalar variables. */
static inline size_t n_variables(const Estimator *e) {
    return N_OUTPUTS + 2 * e->map.n_gauges + N_SCALAR_INPUTS;
}

/* Read variables from `first` on, or those listed. 1, or 0 if one is of another type. */
int get_reals(Estimator *e, size_t first, size_t count, double *value);
int get_listed_reals(Estimator *e, const unsigned *variable, size_t count, double *value);
int get_integer(Estimator *e, size_t variable, int *value); /* the health state too */
int get_boolean(const Estimator *e, size_t variable, int *value);

/* Set variables from `first` on, or those listed. 1, or 0 with a text that tells what is allowed and with nothing
   changed of or after the one that is not. */
int set_reals(Estimator *e, size_t first, size_t count, const double *value, char text[MAP_TEXT_SIZE]);
int set_listed_reals(Estimator *e, const unsigned *variable, size_t count, const double *value,
                     char text[MAP_TEXT_SIZE]);
int set_boolean(Estimator *e, size_t variable, int value, char text[MAP_TEXT_SIZE]);

/* Place of a real input or setting in estimator->input; SIZE_MAX for any other variable. */
size_t input_place(const Estimator *e, size_t variable);

/* Whether a variable is a real output. */
int is_real_output(size_t variable);

#endif
