/* The linear update: matrices for a set of gauges and for their errors, and a sample that is conditioned by them. */

#ifndef UPDATE_H
#define UPDATE_H

#include "../sample/sample.h"

/* What follows from the covariance of the gauges, in addition to the file's errors by those that do not scale with the
   dynamic pressure: of zeros, and what temperature sensors leave of thermal strain. */

typedef struct {
    int wide;        /* wide_of_processor() */
    Map file;        /* with the arrays of the file alone */
    double *added;   /* (n_gauges, n_gauges) covariance of the other errors [1] */
    const double *own, *whole; /* (n_gauges, n_gauges) covariance of the gauges instead of the file's, and with the
                                  errors that scale; NULL for the file's */
    const OtherLoads *other_loads; /* in addition to the five, which follow too */
    NoiseMatrices set[2], *made; /* the map's, and the ones that are made */
    int stage;       /* of the functions in added_noise.c */
    int refused;     /* whether own and added were no covariance: they are the file's then */
    Turned turned;   /* of the directions, */
    size_t taken;    /* and the directions that it has taken */
    double *large;   /* scratch: see added_noise.c */
    double *head;
    double *square;    /* (n_gauges, n_gauges) */
    double *rows;      /* of gain and loads of form "absolute" */
} AddedNoise;

/* The row of largest S, or of its square, that is not taken yet; `size` of a taken row is -1. */
static inline size_t next_row(size_t count, const double *size) {
    size_t best = 0;
    for (size_t k = 1; k < count; k++) {
        best = size[k] > size[best] ? k : best;
    }
    return best;
}

/* Hand out the arrays for the map of a file; other_loads is set. */
void added_noise_arrays(const Map *map, AddedNoise *noise, Room *room);

/* Make the matrices for the errors noise->own, instead of the file's if set, and noise->added besides, part by part; those
   that the map has stay until they are handed out. A part takes about as many multiplications as the first one, or `work`
   of those whose number is not known before. 1, and nothing is done, after the last part. Where the sum is no covariance, the file's is in its
   place, from the first part on. */
void added_noise_begin(AddedNoise *noise);
int added_noise_part(AddedNoise *noise, size_t work);

/* After the last part: the map has them. 0 if the sum was no covariance, and with the file's the map stays as it is if
   that is none. */
int added_noise_hand_out(AddedNoise *noise, Map *map);

/* The matrices of a map for sets of gauges in use, each prepared once and kept; and for the errors that gauges have now. */

/* All that a step needs of a map for the gauges in use, computed once per set. Entries are by gauge in use, ascending. */
typedef struct {
    unsigned char *mask; /* (n_gauges) 1 for the gauges in use */
    unsigned long number;    /* no other set of gauges, and none before in these arrays, has it */
    size_t n_used;
    int identified;          /* whether they identify the state; if not, what follows is not set */
    size_t *used;            /* (n_used) their indices among all gauges */
    double chi_square_limit, outlier_threshold;
} MaskedMap;

/* Sets of missing gauges whose matrices are kept; the least recently used gives way. */
#define CACHED_MASKS 4

typedef struct {
    Map *map;
    AddedNoise noise;  /* errors of the zeros, */
    size_t n_strains;
    double *noise_std; /* (n_strains + 1) the standard deviations that map holds for, */
    double *next_std;  /* and those that matrices are made for */
    struct Scaled *scaled; /* of a map with many gauges */
    MaskedMap *masked; /* for the gauges in use; NULL before any are known */
    MaskedMap cache[CACHED_MASKS];
    unsigned long last_use[CACHED_MASKS], uses; /* 0 for an empty entry */
    unsigned char *mask; /* (n_gauges) gauges in use in this step */
    size_t *group;         /* (n_used) the first of the gauges from which each cannot be distinguished, itself outside the */
    size_t worst;          /* group of the gauge of this place among those in use, */
    unsigned long grouped; /* in the set of this number; 0 for none */
    /* Scratch of one set after another. */
    double *first, *second, *third; /* (n_gauges, n_gauges) */
    size_t *order;                  /* (n_gauges) gauges, the missing first */
} Prepared;

/* Set prepared->group for a gauge, by its place among those in use. */
void prepared_group(Prepared *prepared, size_t worst);

/* Hand out the arrays of a map with n_strains strain gauges; noise.other_loads is set. */
void prepared_arrays(Map *map, size_t n_strains, Prepared *prepared, Room *room);

/* Give the map its matrices, for the errors of its file. 0 if those are no covariance. */
int prepared_begin(Prepared *prepared);

/* Set prepared->masked for the gauges in use. */
void prepared_follow(Prepared *prepared, const Inputs *inputs);

/* Whether the map holds for standard deviations of the zeros, and the common one (n_strains + 1). */
int prepared_holds(const Prepared *prepared, const double *std);

/* Begin to make the matrices for other sigmas, and for noise.own and noise.whole, part by part: added_noise_part. */
void prepared_renew(Prepared *prepared, const double *std);

/* After the last part: the map has them, and no set of gauges is prepared. */
void prepared_renewed(Prepared *prepared);

/* Gauges that are lost: the others predict them, so that the directions of all gauges stay. */

#define N_VALUES 16 /* the 15 entries of a covariance row by row, and a zero or the trace of P D */
#define TRACE 15

/* Intervals of the pressure ratio that are kept: a factor 2 of dynamic pressure; and the points in each. */
#define CACHED_INTERVALS 16
#define N_NODES 6

/* Numbers of one interval of the pressure ratio, with all gauges. They depend on nothing else, so that keeping them changes
   no result. */
typedef struct {
    double below, above;     /* its ends; NaN before it is known */
    double *factor;          /* of errors in proportion to strain: current_errors.c, (16 and other loads, 21 by node) in
                                panels of numerics.h */
    double *least_precision; /* (n_gauges) P_ii at the upper end, where it is smallest */
    double *margin;          /* (n_gauges) the largest sqrt(P_ii), over |V_i| */
    double *bound;           /* (n_gauges) upper bounds of |V_i|^2 / P_ii, 0 where no other gauge checks one; */
    int bounded;             /* 0 if that is open for some */
} Interval;

/* Errors in proportion to strain: current_errors.c. */
typedef struct {
    Interval interval[CACHED_INTERVALS];
    size_t next;              /* the one to give way */
    double *of_gauge;         /* (21, n) of the map, in panels */
    double *common;           /* (n_terms, 6, whole) V E */
    double *rows;             /* (6 n_terms, n) E, in panels */
    /* Of the step. */
    double *products;         /* (24) c_a c_b less its mean, */
    double *parts;            /* (6, 21) and times Lagrange's polynomials of the ratio in its interval */
    double *value;            /* (16) G D G' and the trace of P D, with all gauges */
    double *own;              /* (n) D_ii of the gauges' own errors */
    double *load_along;       /* (5 and other loads, 6 n_terms) E G' where gauges are lost, of G below, */
    double *lost_along;       /* (n_lost, 6 n_terms) and E Y */
    double *sized;            /* (6 n_terms) scratch of a product with D */
    /* Of an interval, or of the lost gauges of the step. */
    double *weighted, *gain;  /* (5 and other loads, whole) by direction; G */
    double *unresolved, *precision, *product; /* (whole) u, P_ii, and products of them */
    double *common_load;      /* (6, 5 and other loads) */
    double *node;             /* (16 and other loads, 21) at a point */
    double *at_nodes;         /* (16 and other loads, 126) at all of them */
    double *sum;              /* (24) */
} CurrentErrors;

/* What lost gauges hold of the directions at u = 1 / D. */
typedef struct {
    double *root;   /* (dense_rows(n_gauges)) D^-1/2 */
    double *matrix; /* (n_gauges, n_lost + 1) by columns: D^-1/2 of V_R and of V (m - d_0), after QR */
    double *head;   /* (2 n_gauges) of householder_columns */
} LostRows;

/* Numbers of the last step. w etc. hold one entry per direction. Those down to `interval` follow from the gauges in use and
   the ratio, and are kept while both are the same. */
typedef struct {
    const MaskedMap *masked;           /* for the gauges in use; NULL where nothing is kept, */
    unsigned long number;              /* and its number */
    double ratio;                      /* s */
    double *unresolved;                /* u */
    double *weight;                    /* of the loads that w stands for */
    double *spread;                    /* of the squares of the loads of a direction, in their covariance */
    const double *of_mean;             /* (n_gauges) V (m - d_0), lost gauges' predicted from the others */
    size_t n_lost;
    size_t *lost;                      /* (n_lost) */
    LostRows qr_of_truth, qr_of_gain;  /* the same arrays where the gain is the prior's */
    double *y;                         /* (n_lost, dense_rows(n_gauges)) Y, P = P_all - Y Y' */
    double *growth;                    /* (n_loads, n_lost) B: what the lost gauges add to the covariance is B B' */
    double per_pressure[N_LOADS];      /* about the map's moment point, as all loads */
    double base[N_LOADS * N_LOADS];    /* covariance without errors at the current strain */
    double *bound;                     /* (narrow_rows(n_gauges)) as Interval has them, with lost gauges */
    int bounded;
    const Interval *interval;          /* that the ratio is in */
    double pressure;                   /* q_inf [Pa] */
    double *w;                         /* V r, lost gauges' predicted from the others */
    double *x;                         /* u w */
    double *scratch[2];                /* (dense_rows(n_gauges)) */
    float *narrow, *narrow_z;          /* (narrow_rows(n_gauges)) */
    double *z;                         /* (n_gauges) left as it is where the screen in float decides */
    double chi_square;                 /* [1] */
    double limit_ratio;                /* of the limits of chi-square and z^2 over those at the mean strain [1] */
    double loads[N_LOADS], covariance[N_LOADS * N_LOADS];
} ScaledStep;

/* Many gauges with few columns of errors, low_rank_columns.c: their `order` columns H are the first of rows [H, X_t, m], which are
   `width` apart. */
#define LOW_NODES 12
#define LOW_INTERVALS 4                     /* of the ratio, each for a set of gauges, that are kept */
#define LOW_HALF_WIDTH 0x1.62e42fefa39efp-3 /* of an interval of its logarithm: ln 2 / 4 */
#define N_BASE 20                           /* cov f row by row, F' C g_m + s^2 X_t' W m */
#define N_LOW_VALUES (N_BASE + 16 * N_PAIRS) /* then G D G' and tr(P D) by products c_a c_b */

typedef struct {
    double number;         /* of the interval; NaN before it is known */
    unsigned long gauges;  /* number of the set of gauges, 0 of all */
    double *covariance;    /* (LOW_NODES, order (order + 1) / 2) C at each point, packed by rows from the diagonal on */
    double *column;        /* (LOW_NODES, 6, order) g and g_m */
    double *precision;     /* (LOW_NODES, n_gauges) P_ii */
    double *value;         /* (LOW_NODES, N_LOW_VALUES) */
    /* What a set with further gauges lost follows from: */
    double *left, *gain;   /* (LOW_NODES, 5, 6) X_t' W [X_t, m]; (LOW_NODES, 5, n_gauges) G */
    double *term_square;   /* (LOW_NODES, 6 n_terms, 6) E' P E */
} LowInterval;

typedef struct {
    size_t order, width, n_scaled;  /* n_scaled: the first columns, which have an S */
    double *row;                    /* (n_gauges, width) [H, X_t, m] */
    double *size, *prior;           /* (order) S; 1, or 0 for a free state */
    double *load;                   /* (5, order) F */
    double rest[N_LOADS * N_LOADS]; /* F_t */
    double *noise, common;          /* (n_gauges) a; the variance of what the zeros have in common */
    LowInterval interval[LOW_INTERVALS];
    size_t next;                    /* the one to give way */
    /* Of the step, by its gauges in use and its ratio: */
    const LowInterval *at;
    double part[LOW_NODES];         /* polynomials of Lagrange */
    double *covariance, *column, value[N_LOW_VALUES]; /* as an interval has them */
    double *precision;
    int has_precision;              /* whether precision is set */
    double *weight;                 /* (n_gauges) w */
    /* and by its strain: */
    double *error, *weighted;       /* (n_gauges) e, w e */
    double *of_residual, *x;        /* (width) [H, X_t, m]' W r; x */
    /* Of a point of an interval, or at a ratio of 1: */
    double *gram;                   /* (width, width) K, right on and above its diagonal */
    double *product, *scale;        /* (order) t, D */
    double *triangle;               /* (order, order) L by columns */
    double *inverse, *square, *rows, *ones; /* scratch of C */
    double *load_left;              /* (5, order) F' */
    double *along;                  /* (n_gauges, order) B */
    double *of_term;                /* (6 n_terms, order) of common errors */
    double *sized, *vector;         /* (n_gauges) scratch */
    /* At a ratio of 1, of sets of gauges: */
    double *nominal_weight, *nominal_along, *nominal_precision;
    unsigned long grouped;          /* number of the set that the last two are for; 0 for none */
    double *of_all, *of_set;        /* C of all gauges, and of a set, packed */
    int all_identify;               /* whether of_all is set */
    double *free, *ratio;           /* (n_free, n_free) in whole lanes, roots of the covariance of free states */
    unsigned char *all_gauges;      /* (n_gauges) 1 */
    double *whole, *head, *turned, *kept, *scratch, *of_free, *of_column; /* scratch of low_rank_prepare */
} LowRank;

typedef struct Scaled {
    const Map *map;
    const OtherLoads *other_loads; /* in addition to the five */
    size_t n_loads;    /* the five and these */
    int wide;          /* wide_of_processor() */
    LowRank low;       /* of a map with many gauges, in the place of all but the step */
    double *rows;      /* V in panels: w = V r */
    double *columns;   /* V' in panels */
    double *square;    /* the squares of V' in panels: P_ii = sum of u V_ai^2 */
    double *squares;   /* (16, n) products of the loads of each direction, in panels */
    double *loads;     /* (8, n) loads of each direction, in panels */
    float *screen;     /* V' with columns of length 1, in panels of float */
    double *size;      /* (n) |V_i| */
    double *of_gain;   /* (n) u of the gain, in which the prior of the states is another than in truth; NULL where it is u */
    double *shift;     /* (5, n) scratch of lost_rows.c */
    double *of_lost;   /* (n_lost, dense_rows(n)) the same: D^-1/2 Q_head */
    double *mean;      /* (dense_rows(n)) V (m - d_0) of all gauges, */
    double *mean_left; /* the same where some are lost */
    double *own_mean;  /* (dense_rows(n)) scratch: m - d_0, 0 for lost gauges */
    double *residual;  /* (dense_rows(n)) */
    CurrentErrors errors;
    ScaledStep step;
} Scaled;

/* Of step->lost at step->unresolved, and at the u of the gain: step->qr_of_truth, step->qr_of_gain, Y and growth; of_mean is
   predicted. */
void lost_rows_prepare(Scaled *scaled);

/* B_k Y' taken off the gain (n_gauges) of load k. */
void lost_rows_take(const Scaled *scaled, size_t k, double *gain);

/* Then, of a sample: chi-square and x; w of the lost gauges is predicted. */
void lost_rows_condition(Scaled *scaled);

/* The products of set_products, summed over the directions, by the gain that the lost gauges leave. */
void lost_rows_products(Scaled *scaled, double products[N_VALUES]);

/* Add the products of pairs of five loads and of five others (row by row, 15). */
void add_products(const double *first, const double *second, double products[N_VALUES]);

/* Errors in proportion to strain, at the current one (eq:proportional): what they add to the covariance of the loads and to
   the expected chi-square, G D G' and the trace of P D. */

/* Hand out the arrays. */
void current_errors_arrays(Scaled *scaled, Room *room);

/* Fill in the tables of a map, and forget all intervals. */
void current_errors_prepare(Scaled *scaled);

/* The interval of a ratio > 0, from those that are kept if it is there. */
const Interval *current_interval(Scaled *scaled, double ratio);

/* Upper bounds of |V_i|^2 / P_ii of gauges that others check, 0 of others, whose z is 0: the ends of the interval bound
   P_ii of all gauges, from which the lost ones take their part. 0 where these leave it open whether others check a gauge. */
int current_errors_set_bound(const Scaled *scaled, const Interval *interval, size_t n_lost, double *bound);

/* Intervals of ln s, each from -1 to 1: the number of the one that holds a ratio, and where; the ratio at a place in one. */
double ratio_interval(double ratio, double half_width, double *t);
double ratio_at(double number, double half_width, double t);

/* Lagrange's polynomials of n points at t; a weight is 1 over the product of a point's distances from the others. */
EVERYWHERE void lagrange(size_t n, const double *point, const double *weight, double t, double *part) {
    for (size_t k = 0; k < n; k++) {
        part[k] = weight[k];
        for (size_t j = 0; j < n; j++) {
            part[k] *= j == k ? 1.0 : t - point[j];
        }
    }
}

/* The gain of the gauges in use, and what errors in common make of it and of Y: where the lost gauges or the ratio change,
   after lost_rows_prepare. */
void current_errors_take_lost(Scaled *scaled);

/* k_vp of one common error from its loads (6, loads) by the gain, E_a' G', and E_a' P E_b (6, 6): G E_a (E_b' G') symmetrised
   for the covariance, each twice for a < b; added to `value` (16 and other loads, 21). */
void add_common_error(size_t loads, const double *load, const double *square, double *value);

/* G D G' of the five loads (15) and the trace of P D, by the gauges in use. */
const double *current_errors_values(Scaled *scaled);

/* What they add to the variance of other load j. */
double current_errors_of_other(const Scaled *scaled, size_t j);

/* Hand out the arrays. map, other_loads and wide are set. */
void scaled_arrays(Scaled *scaled, Room *room);

/* Fill in the tables: once, and again where the matrices of the map are others. */
void scaled_prepare(Scaled *scaled);

/* Of a map with many gauges, as the functions of the same names: arrays; H once; K again where the standard deviations of
   zeros (n_strains, then the common one) are others. */
void low_rank_arrays(Scaled *scaled, Room *room);
void low_rank_prepare(Scaled *scaled);
void low_rank_renew(Scaled *scaled, size_t n_strains, const double *zero_std);
void low_rank_condition(Scaled *scaled, const MaskedMap *masked, const double *strain);
void low_rank_residuals(Scaled *scaled, double *z);
double low_rank_gain(Scaled *scaled, size_t k, double *gain);

/* The information of a set of gauges on the free states over the one of all, in the worst state; their precisions, and
   whether leave-one-out residuals of two of them are correlated beyond the limit. */
double low_rank_information(Scaled *scaled, const MaskedMap *masked);
void low_rank_set_precisions(Scaled *scaled, const MaskedMap *masked);
int low_rank_correlated(const Scaled *scaled, size_t i, size_t j);

/* Products c_a c_b (21) of the coefficients of the step less their mean; the covariance and the limits of the step, by
   current_errors_values, NULL without errors in proportion to strain. */
void set_products_of_coefficients(const Scaled *scaled, double *products);
void set_current_errors(Scaled *scaled, const double *value);

/* Condition the loads on the strains (n_gauges) of the gauges in use, which identify the state, at a dynamic pressure [Pa]:
   scaled->step. */
void scaled_condition(Scaled *scaled, const MaskedMap *masked, double pressure, const double *strain);

/* z (n_gauges) of the last step; 0 where no other gauge in use checks it, and left as it is of gauges not in use. */
void scaled_standardised_residuals(Scaled *scaled, double *z);

/* Of the last step: load k, one in addition to the five, its variance and derivative by q_inf. */
void scaled_other_load(const Scaled *scaled, size_t k, double *value, double *variance, double *per_pressure);

/* The gain (dense_rows(n_gauges)) by strain in the last step of load k, of the five and those in addition; its derivative by
   q_inf. */
double scaled_gain(Scaled *scaled, size_t k, double *gain);

#endif
