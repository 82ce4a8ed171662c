/* Numerics: memory in pieces, instruction sets, products and decompositions of dense matrices. */

#ifndef NUMERICS_H
#define NUMERICS_H

#include <stddef.h>

/* Memory of an estimator: blocks of the heap, or pieces of a buffer of the caller. A block holds zeros, and starts at a
   multiple of 64 bytes, as vector loads like it. Blocks are freed together. */

#define MEMORY_ALIGNMENT 64

typedef struct {
    void *last;          /* block of the heap, which begins with a pointer to the one before it */
    unsigned char *next; /* of a buffer; NULL for the heap */
    size_t left;         /* bytes of it */
    size_t taken;        /* bytes of all blocks */
} Memory;

/* Memory in a buffer of `size` bytes. */
Memory memory_in(void *buffer, size_t size);

/* A block of `size` bytes; NULL where there is no more. */
void *memory_take(Memory *memory, size_t size);

/* Free all blocks; a buffer stays the caller's. */
void memory_free(const Memory *memory);

/* A block in pieces: one list of them, gone through twice, counts what they take and hands them out. */
typedef struct {
    unsigned char *next; /* NULL while pieces are counted alone: they are NULL then */
    size_t size;         /* bytes of all pieces so far */
} Room;

/* The next piece, of `count` elements of a size; in multiples of 8 bytes, so that any type follows. */
static inline void *piece(Room *room, size_t count, size_t size) {
    const size_t bytes = (count * size + 7) / 8 * 8;
    void *start = room->next;
    room->size += bytes;
    if (room->next != NULL) {
        room->next += bytes;
    }
    return start;
}

static inline double *taken(Room *room, size_t count) {
    return piece(room, count, sizeof(double));
}

/* The next pieces, of `count` doubles each. */
#define TAKE(room, count, ...) take_each(room, count, (double **[]){__VA_ARGS__, NULL})
static inline void take_each(Room *room, size_t count, double **const array[]) {
    for (; *array != NULL; array++) {
        **array = taken(room, count);
    }
}

/* Give a part of an estimator a block for all its pieces, by the function that lists them; what lies in it is filled in where
   room->next is not NULL. 1; 0 where there is no memory. */
typedef void ListPieces(void *part, Room *room);
int memory_hand_out(Memory *memory, ListPieces *list, void *part);

/* One source, several instruction sets: on x86-64 the products of every step are compiled for SSE2 and for AVX2, products of
   matrices for AVX-512 too. Which one runs changes no bit. */

#if defined(__x86_64__) && defined(__GNUC__)
#define HAS_AVX2 1
#define AVX2 __attribute__((target("avx2")))
#define EVERYWHERE static inline __attribute__((always_inline))
#define AVX512 __attribute__((target("avx512f,avx512dq,avx512bw,avx512vl")))
/* The function of that name, or the one for AVX2, or for the most that there is; the one for AVX2 of a function of EVERYWHERE
   that returns a type, or nothing. */
#define CHOSEN(wide, name) ((wide) ? name##_avx2 : (name))
#define WIDEST(wide, name) ((wide) > 1 ? name##_avx512 : (wide) ? name##_avx2 : (name))
#define FOR_AVX2_AS(type, name, parameters, arguments) \
    AVX2 static type name##_avx2 parameters { \
        return name arguments; \
    }
#define FOR_AVX2(name, parameters, arguments) \
    AVX2 static void name##_avx2 parameters { \
        name arguments; \
    }
#else
#define HAS_AVX2 0
#define EVERYWHERE static inline
#define CHOSEN(wide, name) ((void)(wide), (name))
#define WIDEST(wide, name) CHOSEN(wide, name)
#define FOR_AVX2_AS(type, name, parameters, arguments)
#define FOR_AVX2(name, parameters, arguments)
#endif

#define LANES 4

/* The smallest multiple of LANES that holds n. */
static inline size_t in_lanes(size_t n) {
    return (n + LANES - 1) / LANES * LANES;
}

/* Products with matrices in every step, laid out for registers.

   A panel is ROWS rows: ROWS elements lie together for each column, the ROWS sums stay in registers, and columns of zeros
   make their number a multiple of DEPTH. Each row is summed in DEPTH parts, column k in part k % DEPTH, which are added at
   the end: the same order on every processor. */

#define ROWS 8
#define DEPTH 4
#define NARROW_ROWS 16 /* of the panels in float */

static inline size_t dense_rows(size_t rows) {
    return (rows + ROWS - 1) / ROWS * ROWS;
}

static inline size_t dense_columns(size_t columns) {
    return (columns + DEPTH - 1) / DEPTH * DEPTH;
}

static inline size_t narrow_rows(size_t rows) {
    return (rows + NARROW_ROWS - 1) / NARROW_ROWS * NARROW_ROWS;
}

/* Lay out a matrix whose element (r, k) is source[r * row_stride + k * column_stride]; panels has dense_rows(rows) *
   dense_columns(columns) elements. */
void dense_panels(size_t rows, size_t columns, const double *source, size_t row_stride, size_t column_stride,
                  double *panels);

/* The same in float, each row times its scale: narrow_rows(rows) * dense_columns(columns) elements. */
void narrow_panels(size_t rows, size_t columns, const double *source, size_t row_stride, size_t column_stride,
                   const double *scale, float *panels);

/* y = M x; y has dense_rows(rows) elements, x dense_columns(columns), those beyond `columns` being 0. wide as for
   CHOSEN. */
void dense_times(int wide, size_t rows, size_t columns, const double *panels, const double *x, double *y);

/* y_j = M x_j for `count` vectors, x_j and y_j each `x_apart` and `y_apart` after the one before: a panel stays in the cache
   while it meets all of them. */
void dense_times_many(int wide, size_t rows, size_t columns, const double *panels, size_t count, const double *x,
                      size_t x_apart, double *y, size_t y_apart);

/* The same of one in float; y has narrow_rows(rows) elements. */
void narrow_times(int wide, size_t rows, size_t columns, const float *panels, const float *x, float *y);

/* Whether the processor and the system have AVX2: 1, or 2 with AVX-512, too; for CHOSEN. */
int wide_of_processor(void);

/* Small dense linear algebra, in an order of operations that is the same on every platform.

   A packed upper triangle of order n holds its columns one after another, rows 0 .. j of column j: element (i, j) is
   at j (j + 1) / 2 + i. Other matrices are stored by columns. No function allocates. */

/* Index of the first element of column j. */
static inline size_t triangle_column(size_t j) {
    return j * (j + 1) / 2;
}

/* Sum of x[i] y[i] over n elements, in LANES parts, so that additions need not wait for each other, added as (0 + 1) +
   (2 + 3); then the rest in order. */
EVERYWHERE double sum_of_products(size_t n, const double *restrict x, const double *restrict y) {
    double part[LANES] = {0.0};
    size_t i = 0;
    for (; i + LANES <= n; i += LANES) {
        for (size_t r = 0; r < LANES; r++) {
            part[r] += x[i + r] * y[i + r];
        }
    }
    double sum = (part[0] + part[1]) + (part[2] + part[3]);
    for (; i < n; i++) {
        sum += x[i] * y[i];
    }
    return sum;
}

/* y += factor x. */
EVERYWHERE void add_times(size_t n, double factor, const double *restrict x, double *restrict y) {
    for (size_t i = 0; i < n; i++) {
        y[i] += factor * x[i];
    }
}

/* The sum by a call. */
double dot(size_t n, const double *x, const double *y);

/* Replace the upper triangle of the first `pivots` columns of a (rows x columns, by columns), pivots <= rows, by the R of Q R, and
   the other columns by Q' times them; what lies below is scratch. head (2 pivots) takes what householder_back needs besides a,
   NULL for nothing. Householder reflections: Golub & Van Loan, Matrix Computations, section 5.2. wide as for CHOSEN. */
void householder_columns(int wide, size_t rows, size_t pivots, size_t columns, double *a, double *head);

/* x = Q' x, or x = Q x, for the Q of householder_columns; x has `rows` elements. */
void householder_forward(size_t rows, size_t pivots, const double *a, const double *head, double *x);
void householder_back(int wide, size_t rows, size_t pivots, const double *a, const double *head, double *x);

/* x = R^-1 x, or R'^-1 x, for the R (n x n) at the top of a (rows x n, by columns). */
void solve_triangle(size_t rows, size_t n, const double *a, double *x);
void solve_transposed(size_t rows, size_t n, const double *a, double *x);

/* L and L^-1 of a covariance (n, n) = L L'. 0 if it is none. */
int lower_root(size_t n, const double *covariance, double *root, double *inverse);

/* Rows turned until they are orthogonal: the left singular vectors of a matrix, applied to it and to what stands behind it. */

/* How far rows are turned; all 0 before the first part. */
typedef struct {
    int stage;      /* of the functions in triangles.c, */
    size_t row;     /* the next row in it, */
    int round;      /* QL steps for that row, or sweeps before this one, */
    double largest; /* and the largest |cosine| of the sweep so far */
} Turned;

/* Number of doubles of its scratch. */
size_t orthogonal_rows_doubles(size_t count, size_t width);

/* Turn rows (count, width) until their first n elements are orthogonal, row to row: a part of it, which ends with the
   first row, QL step or row of a sweep that brings its multiplications to `work`. 1 if they are orthogonal. Rows, scratch
   and *turned are the same from part to part, and what comes out does not depend on their number. wide as for CHOSEN. */
int orthogonal_rows(int wide, size_t count, size_t n, size_t width, double *rows, double *scratch, Turned *turned,
                    size_t work);

/* The smallest singular value of rows (n, n), which are turned; square (n) is scratch. One-sided Jacobi rotations alone, which
   find small singular values to full relative accuracy. */
double smallest_singular_value(size_t n, double *rows, double *square);

/* Dense algebra of the flight state's solution: one Cholesky decomposition, and what is solved with it.

   Matrices of order n, a multiple of LANES; L lies by columns, n apart, and is right on and below its diagonal. Sums
   take LANES terms at once, in one order on every processor. wide as for CHOSEN. */

/* Replace the lower triangle of a positive definite matrix (n, n) by L, matrix = L L'. */
void cholesky(int wide, size_t n, double *matrix);

/* x = L^-1 x for `count` vectors, n apart. */
void solve_lower(int wide, size_t n, const double *lower, size_t count, double *x);

/* x = L'^-1 x for `count` vectors, n apart. */
void solve_upper(int wide, size_t n, const double *lower, size_t count, double *x);

/* L^-1 (n, n) by rows; of what lies right of the diagonal's LANES, the next LANES are 0, others are not set. scratch
   takes (LANES, n). */
void invert_lower(int wide, size_t n, const double *lower, double *scratch, double *inverse);

/* y = L'^-1 x for N_TURNED vectors, n apart, and the sums of squares (n) of the columns of L^-1. */
#define N_TURNED 5
void turn_back(int wide, size_t n, const double *inverse, const double *x, double *y, double *squares);

/* Sums of x[i] y[i] over n elements, in LANES parts, of every pair of N_TURNED vectors, n apart. */
void lane_products(int wide, size_t n, const double *x, double products[N_TURNED][N_TURNED]);

/* The inverse (order, order) of a symmetric positive definite matrix of at most 5 rows, and its product with a vector. */
void invert_small(size_t order, const double *matrix, double *inverse);

/* M x of a matrix by rows; x' M x of a symmetric matrix, and x' M y. */
void small_times(size_t order, const double *matrix, const double *x, double *out);
double quadratic(size_t order, const double *x, const double *matrix, const double *y);

static inline double larger(double a, double b) {
    return b > a ? b : a;
}

/* value, or the end of the range that it leaves. */
static inline double clipped(double value, double low, double high) {
    return value < low ? low : value > high ? high : value;
}

#endif
