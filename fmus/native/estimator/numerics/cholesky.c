/* A Cholesky decomposition and triangular solutions for the flight state's problem, in registers and in one order on
   every processor.

   A (n, n) = L L', n a multiple of LANES = 4, columns n apart. L is computed by blocks of four columns, each from
   the columns before it (left-looking: Golub and Van Loan, Matrix Computations, section 4.2):

       A_kk.. -= L_k,0..k-1 L_0..k-1'      one product of matrices
       four columns of L                   L D L' within the block, then times the roots of D

   x = L^-1 b goes forward by blocks: the inverse (4, 4) of the diagonal block gives four elements, which are
   subtracted from all below; x = L'^-1 b goes back alike with sums over what is below. L^-1 by rows is needed for
   the diagonal of S^-1 = L'^-1 L^-1: (S^-1)_gg = sum over i of (L^-1)_ig^2, and L'^-1 of five vectors comes from the
   same pass (turn_back).

   Each sum has four parts, one for each lane, which are added as (0 + 1) + (2 + 3): what SSE2 does in two registers
   and AVX2 in one has the same bits. A matrix that is not positive definite gives NaN, which the tests of health
   report. Small matrices, of at most five rows, are inverted by plain loops: A^-1 = L'^-1 L^-1.
   docs/developers/native.md, "Conventions" and "Cost". */

#include "numerics.h"

#include <math.h>
#include <string.h>

/* Blocks of a product of matrices by rows, whose sums stay in registers. Every sum runs over its terms in order.

   A matrix by rows, by columns, or a part of either: its element (i, k) is value[i * row + k * column]. */
typedef struct {
    const double *value;
    size_t row, column;
} Strided;

#define MOST_ROWS 5
#define BLOCK_COLUMNS 8
#define WIDE_COLUMNS 24 /* with AVX-512, for which loading a number of the left factor into all lanes takes longest */
#define NARROW_COLUMNS (HAS_AVX2 ? LANES : BLOCK_COLUMNS) /* without AVX2, of which x86-64 has half the registers */

/* some(count) from row i on, for all rows. One that is left over joins the last block, which a single one would cost as
   much as. */
#define BY_ROWS(i, rows, some) \
    for (; i + 4 <= rows && i + MOST_ROWS != rows; i += 4) { \
        some(4); \
    } \
    if (i + MOST_ROWS == rows) { \
        some(MOST_ROWS); \
        i = rows; \
    } \
    if (i + 2 <= rows) { \
        some(2); \
        i += 2; \
    } \
    if (i < rows) { \
        some(1); \
    }

/* some(count) from column j on, for all columns, in blocks of `width`, a constant, at most: of BLOCK_COLUMNS at most
   unless wide. */
#define BY_COLUMNS(j, columns, width, wide, some) \
    for (; width > BLOCK_COLUMNS && (wide) && j + width <= columns; j += width) { \
        some(width); \
    } \
    for (; width >= BLOCK_COLUMNS && j + BLOCK_COLUMNS <= columns; j += BLOCK_COLUMNS) { \
        some(BLOCK_COLUMNS); \
    } \
    for (; j < columns; j += LANES) { \
        some(LANES); \
    }

/* What a product becomes: itself, or what was there before without it. */
typedef enum { SET, SUBTRACT } Change;

/* Rows and columns are constants where it is called, as the change is. `before` lies as the product does. */
EVERYWHERE void block(Change change, size_t rows, size_t columns, size_t inner, const double *restrict left, size_t row,
                      size_t column, const double *restrict right, size_t right_row, const double *before,
                      double *product, size_t product_row) {
    double sum[MOST_ROWS][WIDE_COLUMNS];
    for (size_t i = 0; i < rows; i++) {
        for (size_t j = 0; j < columns; j++) {
            sum[i][j] = change == SET ? 0.0 : before[i * product_row + j];
        }
    }
    for (size_t k = 0; k < inner; k++) {
        const double *restrict b = right + k * right_row;
        for (size_t i = 0; i < rows; i++) {
            const double a = left[i * row + k * column];
            for (size_t j = 0; j < columns; j++) {
                sum[i][j] = change == SUBTRACT ? sum[i][j] - a * b[j] : sum[i][j] + a * b[j];
            }
        }
    }
    for (size_t i = 0; i < rows; i++) {
        for (size_t j = 0; j < columns; j++) {
            product[i * product_row + j] = sum[i][j];
        }
    }
}

/* All rows over a block of columns. */
EVERYWHERE void strip(Change change, size_t rows, size_t columns, size_t inner, Strided left, const double *right,
                      size_t right_row, const double *before, double *product, size_t product_row) {
    size_t i = 0;
#define SOME_ROWS(count) \
    block(change, count, columns, inner, left.value + i * left.row, left.row, left.column, right, right_row, \
          before + i * product_row, product + i * product_row, product_row)
    BY_ROWS(i, rows, SOME_ROWS)
#undef SOME_ROWS
}

/* Products of matrices by rows: P = A B and P -= A B, sums in registers.

   The columns of P are taken in blocks whose sums stay in registers: 24 columns with AVX-512, 4 with
   SSE2, 8 with AVX2 and elsewhere. A sum runs over the inner index in order, in one part, so that no width of a
   block changes a bit. A lower triangular B has zeros above its diagonal: a block of columns from j on begins with
   row j. Both are the bulk of a nonlinear step. docs/developers/native.md, "Cost". */

/* Whether the right factor, square then, is zero above its diagonal. */
typedef enum { FULL, LOWER } Shape;

/* All columns, in blocks of so many: of A B, or of P - A B. A lower triangular B begins at the row of its column; wide blocks
   would multiply the zeros of a triangle. */
EVERYWHERE void product_of(size_t width, Change change, Shape shape, size_t rows, size_t inner, size_t columns, Strided left,
                           const double *right, size_t right_row, double *product, size_t product_row) {
    size_t j = 0;
#define SOME_COLUMNS(count) \
    do { \
        const size_t first = shape == LOWER ? j : 0; \
        const Strided part = {left.value + first * left.column, left.row, left.column}; \
        strip(change, rows, count, inner - first, part, right + first * right_row + j, right_row, product + j, product + j, \
              product_row); \
    } while (0)
    BY_COLUMNS(j, columns, width, shape == FULL, SOME_COLUMNS)
#undef SOME_COLUMNS
}

/* product (rows, columns) = left (rows, inner) right (inner, columns), or that is subtracted from it, for an instruction set, in
   blocks of so many columns. Columns are a multiple of LANES, rows of right and product lie right_row and product_row apart.
   Change and shape are constants where it is called. */
#define PRODUCTS(instructions, name, width) \
    instructions static void name(Change change, Shape shape, size_t rows, size_t inner, size_t columns, Strided left, \
                                  const double *right, size_t right_row, double *product, size_t product_row) { \
        if (change == SUBTRACT) { \
            product_of(width, SUBTRACT, FULL, rows, inner, columns, left, right, right_row, product, product_row); \
        } else { \
            product_of(width, SET, shape, rows, inner, columns, left, right, right_row, product, product_row); \
        } \
    }

PRODUCTS(, multiply, NARROW_COLUMNS)
#if HAS_AVX2
PRODUCTS(AVX2, multiply_avx2, BLOCK_COLUMNS)
PRODUCTS(AVX512, multiply_avx512, WIDE_COLUMNS)
#endif

#define MAX_SMALL 5

/* Rows of one vector or of two, n apart: x -= sum over LANES columns, `stride` apart, each times its factor. A block is read
   before it is written, so that its lanes are computed at once. Two vectors take fewer loads than one after the other; their
   number is a constant, and factors are numbers of their own, which stay in registers. */
EVERYWHERE void subtract_columns(size_t vectors, size_t first, size_t n, const double *restrict columns, size_t stride,
                                 double factor[][LANES], double *restrict x) {
    const double *restrict c0 = columns, *restrict c1 = c0 + stride, *restrict c2 = c1 + stride,
                           *restrict c3 = c2 + stride;
    const double *f = factor[0], *g = factor[vectors - 1];
    const double f0 = f[0], f1 = f[1], f2 = f[2], f3 = f[3], g0 = g[0], g1 = g[1], g2 = g[2], g3 = g[3];
    for (size_t i = first; i < n; i += LANES) {
        double one[LANES], other[LANES];
        for (size_t r = 0; r < LANES; r++) {
            one[r] = x[i + r] - ((f0 * c0[i + r] + f1 * c1[i + r]) + (f2 * c2[i + r] + f3 * c3[i + r]));
        }
        for (size_t r = 0; vectors == 2 && r < LANES; r++) {
            other[r] = x[n + i + r] - ((g0 * c0[i + r] + g1 * c1[i + r]) + (g2 * c2[i + r] + g3 * c3[i + r]));
        }
        memcpy(x + i, one, sizeof one);
        if (vectors == 2) {
            memcpy(x + n + i, other, sizeof other);
        }
    }
}

/* Four columns of L from column k on, of a matrix from which the columns before them have been subtracted. Divisions
   of d_1, d_2, d_3 wait for each other, roots do not: so L D L' first, then the columns times the roots of D. */
EVERYWHERE void decompose(size_t n, size_t k, double *restrict a) {
    double *restrict c0 = a + k * n, *restrict c1 = c0 + n, *restrict c2 = c1 + n, *restrict c3 = c2 + n;
    const double d0 = 1.0 / c0[k], f01 = c0[k + 1] * d0, f02 = c0[k + 2] * d0, f03 = c0[k + 3] * d0;
    const double d1 = 1.0 / (c1[k + 1] - f01 * c0[k + 1]);
    const double u12 = c1[k + 2] - f01 * c0[k + 2], u13 = c1[k + 3] - f01 * c0[k + 3], f12 = u12 * d1, f13 = u13 * d1;
    const double d2 = 1.0 / (c2[k + 2] - f02 * c0[k + 2] - f12 * u12);
    const double u23 = c2[k + 3] - f02 * c0[k + 3] - f12 * u13, f23 = u23 * d2;
    const double d3 = 1.0 / (c3[k + 3] - f03 * c0[k + 3] - f13 * u13 - f23 * u23);
    const double s0 = sqrt(d0), s1 = sqrt(d1), s2 = sqrt(d2), s3 = sqrt(d3);
    for (size_t i = k; i < n; i += LANES) {
        for (size_t r = i; r < i + LANES; r++) {
            const double x0 = c0[r], x1 = c1[r] - f01 * x0, x2 = c2[r] - f02 * x0 - f12 * x1;
            const double x3 = c3[r] - f03 * x0 - f13 * x1 - f23 * x2;
            c0[r] = x0 * s0;
            c1[r] = x1 * s1;
            c2[r] = x2 * s2;
            c3[r] = x3 * s3;
        }
    }
}

/* L^-1 (LANES, LANES) of the diagonal's LANES from k on, by columns. */
EVERYWHERE void invert_block(size_t n, const double *restrict lower, size_t k, double inverse[LANES][LANES]) {
    const double *c0 = lower + k * n + k, *c1 = c0 + n, *c2 = c1 + n, *c3 = c2 + n;
    const double d0 = 1.0 / c0[0], d1 = 1.0 / c1[1], d2 = 1.0 / c2[2], d3 = 1.0 / c3[3];
    const double a10 = -(c0[1] * d0) * d1, a21 = -(c1[2] * d1) * d2, a32 = -(c2[3] * d2) * d3;
    const double a20 = -(c0[2] * d0 + c1[2] * a10) * d2, a31 = -(c1[3] * d1 + c2[3] * a21) * d3;
    const double a30 = -(c0[3] * d0 + c1[3] * a10 + c2[3] * a20) * d3;
    const double columns[LANES][LANES] = {{d0, a10, a20, a30}, {0.0, d1, a21, a31}, {0.0, 0.0, d2, a32}, {0.0, 0.0, 0.0, d3}};
    memcpy(inverse, columns, sizeof columns);
}

/* Elements k to k + LANES of L^-1 x, where the rows above have been subtracted. */
EVERYWHERE void solve_block(double inverse[LANES][LANES], size_t k, double *restrict x) {
    const double x0 = x[k], x1 = x[k + 1], x2 = x[k + 2], x3 = x[k + 3];
    double solved[LANES];
    for (size_t r = 0; r < LANES; r++) {
        solved[r] = (inverse[0][r] * x0 + inverse[1][r] * x1) + (inverse[2][r] * x2 + inverse[3][r] * x3);
    }
    memcpy(x + k, solved, sizeof solved);
}

EVERYWHERE void forward(size_t n, const double *restrict lower, size_t count, double *restrict x) {
    for (size_t k = 0; k < n; k += LANES) {
        double inverse[LANES][LANES];
        invert_block(n, lower, k, inverse);
        for (size_t v = 0; v < count; v++) {
            solve_block(inverse, k, x + v * n);
        }
        double factor[2][LANES];
        size_t v = 0;
        for (; v + 2 <= count; v += 2) {
            memcpy(factor[0], x + v * n + k, sizeof factor[0]);
            memcpy(factor[1], x + (v + 1) * n + k, sizeof factor[1]);
            subtract_columns(2, k + LANES, n, lower + k * n, n, factor, x + v * n);
        }
        for (; v < count; v++) {
            memcpy(factor[0], x + v * n + k, sizeof factor[0]);
            subtract_columns(1, k + LANES, n, lower + k * n, n, factor, x + v * n);
        }
    }
}

/* Elements k to k + LANES of L'^-1 x, where all below are solved. */
EVERYWHERE void solve_block_back(size_t n, const double *restrict lower, size_t k, double *restrict x) {
    for (size_t c = k + LANES; c-- > k;) {
        const double *restrict column = lower + c * n;
        double sum[LANES] = {0.0}, rest = x[c];
        for (size_t i = k + LANES; i < n; i += LANES) {
            for (size_t r = 0; r < LANES; r++) {
                sum[r] += column[i + r] * x[i + r];
            }
        }
        for (size_t b = c + 1; b < k + LANES; b++) {
            rest -= column[b] * x[b];
        }
        x[c] = (rest - ((sum[0] + sum[1]) + (sum[2] + sum[3]))) / column[c];
    }
}

EVERYWHERE void backward(size_t n, const double *restrict lower, size_t count, double *restrict x) {
    for (size_t k = n; k > 0; k -= LANES) {
        for (size_t v = 0; v < count; v++) {
            solve_block_back(n, lower, k - LANES, x + v * n);
        }
    }
}

/* y = L'^-1 x of N_TURNED vectors and the sums of squares of the columns of L^-1, LANES columns at a time. */
EVERYWHERE void back(size_t n, const double *restrict inverse, const double *restrict x, double *restrict y,
                     double *restrict squares) {
    for (size_t j = 0; j < n; j += LANES) {
        double sum[N_TURNED][LANES] = {{0.0}}, square[LANES] = {0.0};
        for (size_t i = j; i < n; i++) {
            const double *restrict row = inverse + i * n + j;
            for (size_t r = 0; r < LANES; r++) {
                square[r] += row[r] * row[r];
            }
            for (size_t v = 0; v < N_TURNED; v++) {
                for (size_t r = 0; r < LANES; r++) {
                    sum[v][r] += row[r] * x[v * n + i];
                }
            }
        }
        for (size_t r = 0; r < LANES; r++) {
            squares[j + r] = square[r];
            for (size_t v = 0; v < N_TURNED; v++) {
                y[v * n + j + r] = sum[v][r];
            }
        }
    }
}

/* Of vector i with those up to it, LANES parts of each sum. */
EVERYWHERE void products_of(size_t i, size_t n, const double *restrict x, double products[N_TURNED][N_TURNED]) {
    double sum[N_TURNED][LANES] = {{0.0}};
    for (size_t k = 0; k < n; k += LANES) {
        for (size_t j = 0; j <= i; j++) {
            for (size_t r = 0; r < LANES; r++) {
                sum[j][r] += x[i * n + k + r] * x[j * n + k + r];
            }
        }
    }
    for (size_t j = 0; j <= i; j++) {
        products[i][j] = products[j][i] = (sum[j][0] + sum[j][1]) + (sum[j][2] + sum[j][3]);
    }
}

/* Written out, so that the sums of each stay in registers. */
EVERYWHERE void all_products(size_t n, const double *x, double products[N_TURNED][N_TURNED]) {
    products_of(0, n, x, products);
    products_of(1, n, x, products);
    products_of(2, n, x, products);
    products_of(3, n, x, products);
    products_of(4, n, x, products);
}

FOR_AVX2(all_products, (size_t n, const double *x, double products[N_TURNED][N_TURNED]), (n, x, products))
FOR_AVX2(decompose, (size_t n, size_t k, double *matrix), (n, k, matrix))
FOR_AVX2(forward, (size_t n, const double *lower, size_t count, double *x), (n, lower, count, x))
FOR_AVX2(backward, (size_t n, const double *lower, size_t count, double *x), (n, lower, count, x))
FOR_AVX2(back, (size_t n, const double *inverse, const double *x, double *y, double *squares),
         (n, inverse, x, y, squares))

void cholesky(int wide, size_t n, double *matrix) {
    for (size_t k = 0; k < n; k += LANES) {
        WIDEST(wide, multiply)(SUBTRACT, FULL, LANES, k, n - k, (Strided){matrix + k, 1, n}, matrix + k, n,
                               matrix + k * n + k, n);
        CHOSEN(wide, decompose)(n, k, matrix);
    }
}

void solve_lower(int wide, size_t n, const double *lower, size_t count, double *x) {
    CHOSEN(wide, forward)(n, lower, count, x);
}

void solve_upper(int wide, size_t n, const double *lower, size_t count, double *x) {
    CHOSEN(wide, backward)(n, lower, count, x);
}

void invert_lower(int wide, size_t n, const double *lower, double *scratch, double *inverse) {
    for (size_t k = 0; k < n; k += LANES) {
        double by_columns[LANES][LANES], turned[LANES * LANES], *rows = inverse + k * n;
        invert_block(n, lower, k, by_columns);
        /* Row block k of L^-1 is -L_kk^-1 (L_k,0..k-1 times the row blocks above): two products of matrices. */
        WIDEST(wide, multiply)(SET, LOWER, LANES, k, k, (Strided){lower + k, 1, n}, inverse, n, scratch, n);
        for (size_t c = 0; c < LANES; c++) { /* and zeros as far as the widest block of a product reads */
            for (size_t j = 0; j < LANES; j++) {
                rows[c * n + k + j] = by_columns[j][c];
                turned[c * LANES + j] = -by_columns[j][c];
            }
            memset(rows + c * n + k + LANES, 0, k + LANES < n ? LANES * sizeof *rows : 0);
        }
        WIDEST(wide, multiply)(SET, FULL, LANES, LANES, k, (Strided){turned, LANES, 1}, scratch, n, rows, n);
    }
}

void turn_back(int wide, size_t n, const double *inverse, const double *x, double *y, double *squares) {
    CHOSEN(wide, back)(n, inverse, x, y, squares);
}

void lane_products(int wide, size_t n, const double *x, double products[N_TURNED][N_TURNED]) {
    CHOSEN(wide, all_products)(n, x, products);
}

void invert_small(size_t order, const double *matrix, double *inverse) {
    /* L, L^-1, then L'^-1 L^-1. */
    double lower[MAX_SMALL][MAX_SMALL] = {{0.0}}, of_unit[MAX_SMALL][MAX_SMALL] = {{0.0}};
    for (size_t i = 0; i < order; i++) {
        for (size_t j = 0; j <= i; j++) {
            double rest = matrix[i * order + j];
            for (size_t k = 0; k < j; k++) {
                rest -= lower[i][k] * lower[j][k];
            }
            lower[i][j] = i == j ? sqrt(rest) : rest / lower[j][j];
        }
    }
    for (size_t j = 0; j < order; j++) {
        for (size_t i = j; i < order; i++) {
            double rest = i == j ? 1.0 : 0.0;
            for (size_t k = j; k < i; k++) {
                rest -= lower[i][k] * of_unit[k][j];
            }
            of_unit[i][j] = rest / lower[i][i];
        }
    }
    for (size_t i = 0; i < order; i++) {
        for (size_t j = 0; j < order; j++) {
            double sum = 0.0;
            for (size_t k = i > j ? i : j; k < order; k++) {
                sum += of_unit[k][i] * of_unit[k][j];
            }
            inverse[i * order + j] = sum;
        }
    }
}

void small_times(size_t order, const double *matrix, const double *x, double *out) {
    for (size_t i = 0; i < order; i++) {
        out[i] = 0.0;
        for (size_t j = 0; j < order; j++) {
            out[i] += matrix[i * order + j] * x[j];
        }
    }
}

double quadratic(size_t order, const double *x, const double *matrix, const double *y) {
    double sum = 0.0;
    for (size_t i = 0; i < order; i++) {
        double row = 0.0;
        for (size_t j = 0; j < order; j++) {
            row += matrix[i * order + j] * y[j];
        }
        sum += x[i] * row;
    }
    return sum;
}
