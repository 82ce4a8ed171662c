/* Small dense algebra of the linear map: sums, Householder decompositions, triangular solutions.

   A (rows, columns) = Q R by Householder reflections H_k = 1 - f v v' (Golub and Van Loan, Matrix Computations,
   section 5.2). Column k below row k - 1, of norm a and first element x, is reflected to -sign(x) a in row k:

       v = column - (-sign(x) a) e_1,      f = 1 / (a (a + |x|)) = 2 / v' v,

   without cancellation, as v_1 has the sign of x. v stays below the diagonal, f and v_1 in `head`, so that Q' x =
   H_last .. H_0 x and Q x = H_0 .. H_last x can be formed later. A column of zeros is not reflected, its R has a
   zero on the diagonal.

   Lost gauges (update/lost_rows.c), the complement of the states (update/added_noise.c) and the gauges in use
   (update/prepared.c) are all such decompositions. Columns are taken in pairs, which share the loads of v; each
   sum has the order of dot. docs/explanation/theory.md, "Missing and suspect gauges". */

#include "numerics.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

double dot(size_t n, const double *restrict x, const double *restrict y) {
    return sum_of_products(n, x, y);
}

/* The same for two at once, each in the order of dot. */
EVERYWHERE void dot_two(size_t n, const double *restrict x, const double *restrict y, const double *restrict z,
                        double *with_y, double *with_z) {
    double first[LANES] = {0.0}, second[LANES] = {0.0};
    size_t i = 0;
    for (; i + LANES <= n; i += LANES) {
        for (size_t r = 0; r < LANES; r++) {
            first[r] += x[i + r] * y[i + r];
            second[r] += x[i + r] * z[i + r];
        }
    }
    *with_y = (first[0] + first[1]) + (first[2] + first[3]);
    *with_z = (second[0] + second[1]) + (second[2] + second[3]);
    for (; i < n; i++) {
        *with_y += x[i] * y[i];
        *with_z += x[i] * z[i];
    }
}

/* Reflect column k so that it ends in row k, and all columns after it. Return the factor of the reflection, 0 for none;
   *head takes the first element of its vector, the others stay below the diagonal. */
EVERYWHERE double reflect(size_t rows, size_t k, size_t columns, double *a, double *head) {
    double *restrict v = a + k * rows + k;
    const size_t length = rows - k;
    const double norm = sqrt(dot(length, v, v));
    *head = 0.0;
    if (!(norm > 0.0)) {
        return 0.0;
    }
    const double first = v[0];
    const double diagonal = first > 0.0 ? -norm : norm;
    const double factor = 1.0 / (norm * (norm + fabs(first)));
    size_t j = k + 1;
    v[0] = first - diagonal;
    for (; j + 2 <= columns; j += 2) {
        double *one = a + j * rows + k, *other = one + rows, along_one, along_other;
        dot_two(length, v, one, other, &along_one, &along_other);
        add_times(length, -factor * along_one, v, one);
        add_times(length, -factor * along_other, v, other);
    }
    if (j < columns) {
        double *last = a + j * rows + k;
        add_times(length, -factor * dot(length, v, last), v, last);
    }
    *head = v[0];
    v[0] = diagonal;
    return factor;
}

/* Reflect columns up to, not including, `pivots`; head (2 pivots) takes what householder_back needs besides a. */
EVERYWHERE void reflections(size_t rows, size_t pivots, size_t columns, double *a, double *head) {
    for (size_t k = 0; k < pivots; k++) {
        double first;
        const double factor = reflect(rows, k, columns, a, &first);
        if (head != NULL) {
            head[2 * k] = factor;
            head[2 * k + 1] = first;
        }
    }
}

FOR_AVX2(reflections, (size_t rows, size_t pivots, size_t columns, double *a, double *head),
         (rows, pivots, columns, a, head))

void householder_columns(int wide, size_t rows, size_t pivots, size_t columns, double *a, double *head) {
    CHOSEN(wide, reflections)(rows, pivots, columns, a, head);
}

/* x = H x for the reflection of column k. */
EVERYWHERE void apply_reflection(size_t rows, size_t k, const double *a, const double *head, double *x) {
    const double *v = a + k * rows + k;
    const size_t rest = rows - k - 1;
    const double projection = head[2 * k] * (head[2 * k + 1] * x[k] + dot(rest, v + 1, x + k + 1));
    x[k] -= projection * head[2 * k + 1];
    for (size_t i = 0; i < rest; i++) {
        x[k + 1 + i] -= projection * v[1 + i];
    }
}

void householder_forward(size_t rows, size_t pivots, const double *a, const double *head, double *x) {
    for (size_t k = 0; k < pivots; k++) {
        apply_reflection(rows, k, a, head, x);
    }
}

EVERYWHERE void back(size_t rows, size_t pivots, const double *a, const double *head, double *x) {
    size_t last = rows; /* reflections below it change nothing */
    while (last > 0 && x[last - 1] == 0.0) {
        last--;
    }
    for (size_t k = pivots < last ? pivots : last; k-- > 0;) {
        apply_reflection(rows, k, a, head, x);
    }
}

FOR_AVX2(back, (size_t rows, size_t pivots, const double *a, const double *head, double *x), (rows, pivots, a, head, x))

void householder_back(int wide, size_t rows, size_t pivots, const double *a, const double *head, double *x) {
    CHOSEN(wide, back)(rows, pivots, a, head, x);
}

void solve_triangle(size_t rows, size_t n, const double *a, double *x) {
    for (size_t j = n; j-- > 0;) {
        const double *column = a + j * rows;
        x[j] /= column[j];
        for (size_t i = 0; i < j; i++) {
            x[i] -= column[i] * x[j];
        }
    }
}

void solve_transposed(size_t rows, size_t n, const double *a, double *x) {
    for (size_t j = 0; j < n; j++) {
        const double *column = a + j * rows;
        for (size_t i = 0; i < j; i++) {
            x[j] -= column[i] * x[i];
        }
        x[j] /= column[j];
    }
}

/* The root of a covariance and its inverse: C (n, n) = L L', both triangles packed by rows.

   C is scaled to correlations first, C = D c D with the standard deviations D, so that rows of unlike units (gauges,
   auxiliary sensors) cost no digits, and a negative rest is seen relative to 1. By rows (Golub and Van Loan, Matrix
   Computations, section 4.2)

       l_ij = (c_ij - sum over k < j of l_ik l_jk) / l_jj,      l_ii = sqrt(c_ii - sum over k < i of l_ik^2),

   then L = D l and L^-1 = l^-1 D^-1, where row i of l^-1 is the unit row less the rows above times l_ik, over l_ii.
   A rest that is not positive means that C is no covariance: the result is 0. docs/explanation/dynamic_pressure.md,
   "Weights at any dynamic pressure", has L. */

/* Where the diagonal of a triangle lies in row i. */
static size_t diagonal(size_t i) {
    return triangle_column(i) + i;
}

/* Row i of the root of the covariance scaled to unit variance, with the standard deviations on the diagonal of `size`. */
static int set_row(size_t n, size_t i, const double *covariance, const double *size, double *root) {
    double *row = root + triangle_column(i);
    for (size_t j = 0; j <= i; j++) {
        const double correlation = covariance[i * n + j] / (size[diagonal(i)] * size[diagonal(j)]);
        const double rest = correlation - dot(j, row, root + triangle_column(j));
        if (j < i) {
            row[j] = rest / root[diagonal(j)];
        } else if (rest > 0.0) {
            row[i] = sqrt(rest);
        } else {
            return 0;
        }
    }
    return 1;
}

/* Row i of the inverse, from those above it: the sums run over these, in order. */
static void invert_row(size_t i, const double *row, double *inverse) {
    double *restrict solved = inverse + triangle_column(i);
    memset(solved, 0, i * sizeof *solved);
    for (size_t k = 0; k < i; k++) {
        const double *restrict above = inverse + triangle_column(k);
        for (size_t j = 0; j <= k; j++) {
            solved[j] += row[k] * above[j];
        }
    }
    for (size_t j = 0; j < i; j++) {
        solved[j] = -solved[j] / row[i];
    }
    solved[i] = 1.0 / row[i];
}

/* Rows and columns scaled to unit variance, so that gauges of unlike noise cost no digits. */
int lower_root(size_t n, const double *covariance, double *root, double *inverse) {
    for (size_t i = 0; i < n; i++) {
        const double own = covariance[i * n + i];
        inverse[diagonal(i)] = own > 0.0 ? sqrt(own) : 0.0;
    }
    for (size_t i = 0; i < n; i++) {
        if (!(inverse[diagonal(i)] > 0.0) || !set_row(n, i, covariance, inverse, root)) {
            return 0;
        }
    }
    for (size_t i = 0; i < n; i++) {
        invert_row(i, root + triangle_column(i), inverse);
    }
    for (size_t i = 0; i < n; i++) {
        const double size = sqrt(covariance[i * n + i]);
        for (size_t j = 0; j <= i; j++) {
            root[triangle_column(i) + j] *= size;
        }
    }
    for (size_t j = 0; j < n; j++) {
        const double size = sqrt(covariance[j * n + j]);
        for (size_t i = j; i < n; i++) {
            inverse[triangle_column(i) + j] /= size;
        }
    }
    return 1;
}

/* Rows are turned until they are orthogonal: the left singular vectors U of a matrix, applied to it and to what
   stands behind it.

   Rows X (count, width) with X = [K, rest], K the first n columns. Any orthogonal U keeps K' K; wanted is the U for
   which the rows of U K are orthogonal: their lengths are then the singular values of K, and U rest goes with them.
   Two stages:

       1. eigenvectors of the products K K': Householder reflections to a tridiagonal matrix (PRODUCTS, REFLECTIONS),
          then QL steps with implicit shifts until its off-diagonal elements vanish (QL). Every reflection and rotation
          acts on the rows of X at once, so that U is never formed. Rows are then orthogonal to rounding of the largest
          one, since K K' squares K.
       2. one-sided Jacobi rotations of pairs of rows (SQUARES, SWEEP) make them orthogonal relative to their own
          lengths. Two or three sweeps suffice after stage 1, and small singular values come out to full relative
          accuracy (Demmel and Veselic, SIAM J. Matrix Anal. Appl. 13, 1992).

   A rotation of rows a and b with squares alpha, beta and the product gamma makes a' b = 0 for t = sign(tau) /
   (|tau| + sqrt(1 + tau^2)), tau = (beta - alpha) / (2 gamma), c = 1 / sqrt(1 + t^2), s = t c.

   The work can stop after every row, QL step or row of a sweep, and goes on from *turned: a step of the estimator
   makes a part of new matrices in bounded time (renewal.c). The result does not depend on where it stopped.
   docs/explanation/dynamic_pressure.md, eq:scaled-decomposition; Golub and Van Loan, Matrix Computations, sections
   8.3.1, 8.3.3 and 8.6.3. */

#define SWEEPS 40
#define ORTHOGONAL 4e-16 /* |cosine| of two rows that counts as 0 */
#define QL_STEPS 30      /* for an eigenvalue; two are usual, and what is left of it is left to the rotations */
#define SMALL 0x1p-53    /* of an element next to the diagonal, over the ones on it, that counts as 0 */
#define ROOTS 40         /* multiplications that take the time of the roots and divisions of a rotation */

/* Stages in their order. */
enum { PRODUCTS, REFLECTIONS, QL, SQUARES, SWEEP, ORTHOGONAL_ROWS };

size_t orthogonal_rows_doubles(size_t count, size_t width) {
    return count * count + 3 * count + width;
}

/* a = c a - s b, b = s a + c b. */
EVERYWHERE void rotate(size_t width, double c, double s, double *restrict a, double *restrict b) {
    for (size_t i = 0; i < width; i++) {
        const double kept = a[i];
        a[i] = c * kept - s * b[i];
        b[i] = s * kept + c * b[i];
    }
}

/* What stands right of the diagonal in row k of the products becomes its first element, by a reflection of the rows below:
   of products and rows. */
EVERYWHERE void reflect_both(size_t count, size_t width, size_t k, double *gram, double *rows, double *scratch) {
    const size_t first = k + 1, length = count - first;
    double *restrict v = gram + k * count + first, *restrict w = scratch, *restrict sum = scratch + count;
    const double norm = sqrt(sum_of_products(length, v, v));
    if (!(norm > 0.0)) {
        return;
    }
    const double head = v[0], end = head > 0.0 ? -norm : norm, factor = 1.0 / (norm * (norm + fabs(head)));
    /* The reflection is 1 - factor v v', from both sides of the products (rank-two update with w) and from the left
       of the rows. */
    v[0] = head - end;
    for (size_t i = 0; i < length; i++) {
        w[i] = factor * sum_of_products(length, gram + (first + i) * count + first, v);
    }
    add_times(length, -0.5 * factor * sum_of_products(length, v, w), v, w);
    for (size_t i = 0; i < length; i++) {
        double *restrict row = gram + (first + i) * count + first;
        add_times(length, -v[i], w, row);
        add_times(length, -w[i], v, row);
    }
    memset(sum, 0, width * sizeof *sum);
    for (size_t i = 0; i < length; i++) {
        add_times(width, v[i], rows + (first + i) * width, sum);
    }
    for (size_t i = 0; i < length; i++) {
        add_times(width, -factor * v[i], sum, rows + (first + i) * width);
    }
    v[0] = end;
}

/* A QL step of the tridiagonal block from row l to row m: Wilkinson's shift from the upper end, then rotations that
   chase the element outside the band upwards; rows are rotated alike. */
EVERYWHERE void ql_step(size_t l, size_t m, size_t width, double *diagonal, double *off_diagonal, double *rows) {
    const double slope = (diagonal[l + 1] - diagonal[l]) / (2.0 * off_diagonal[l]), size = sqrt(slope * slope + 1.0);
    double g = diagonal[m] - diagonal[l] + off_diagonal[l] / (slope + (slope < 0.0 ? -size : size));
    double s = 1.0, c = 1.0, shift = 0.0;
    for (size_t i = m; i-- > l;) {
        const double f = s * off_diagonal[i], b = c * off_diagonal[i], r = sqrt(f * f + g * g);
        off_diagonal[i + 1] = r;
        /* The block falls apart: the caller looks for its new end. */
        if (!(r > 0.0)) {
            diagonal[i + 1] -= shift;
            off_diagonal[m] = 0.0;
            return;
        }
        s = f / r;
        c = g / r;
        g = diagonal[i + 1] - shift;
        const double turned = (diagonal[i] - g) * s + 2.0 * c * b;
        shift = s * turned;
        diagonal[i + 1] = g + shift;
        g = c * turned - b;
        rotate(width, c, s, rows + i * width, rows + (i + 1) * width);
    }
    diagonal[l] -= shift;
    off_diagonal[l] = g;
    off_diagonal[m] = 0.0;
}

/* One rotation of rows a and b, of squares alpha and beta and a product. */
EVERYWHERE void rotate_pair(size_t width, double alpha, double beta, double gamma, double *a, double *b) {
    const double tau = (beta - alpha) / (2.0 * gamma);
    const double size = 1.0 / (fabs(tau) + sqrt(1.0 + tau * tau)), t = tau < 0.0 ? -size : size;
    const double c = 1.0 / sqrt(1.0 + t * t);
    rotate(width, c, t * c, a, b);
}

/* Row k of the products. */
EVERYWHERE size_t set_products(size_t count, size_t n, size_t width, size_t k, const double *rows, double *gram) {
    for (size_t j = 0; j <= k; j++) {
        gram[k * count + j] = gram[j * count + k] = sum_of_products(n, rows + k * width, rows + j * width);
    }
    return (k + 1) * n;
}

/* The diagonal and the elements next to it, of products and rows that are reflected. */
static void set_diagonal(size_t count, const double *gram, double *diagonal, double *off_diagonal) {
    for (size_t i = 0; i < count; i++) {
        diagonal[i] = gram[i * count + i];
        off_diagonal[i] = i + 1 < count ? gram[i * count + i + 1] : 0.0;
    }
}

/* A QL step for eigenvalue `row`, or on to the next one. */
EVERYWHERE size_t approach(size_t count, size_t width, double *diagonal, double *off_diagonal, double *rows, Turned *turned) {
    const size_t l = turned->row;
    size_t m = l;
    while (m + 1 < count && fabs(off_diagonal[m]) > SMALL * (fabs(diagonal[m]) + fabs(diagonal[m + 1]))) {
        m++;
    }
    if (m == l || turned->round == QL_STEPS) {
        turned->row++;
        turned->round = 0;
        return 0;
    }
    ql_step(l, m, width, diagonal, off_diagonal, rows);
    turned->round++;
    return (m - l) * (2 * width + ROOTS);
}

/* Rotate all pairs of row p with the rows below it that are not orthogonal yet. square (count) has the squares of
   rows. */
EVERYWHERE size_t sweep(size_t count, size_t n, size_t width, size_t p, double *rows, double *square, double *largest) {
    size_t work = 0;
    for (size_t q = p + 1; q < count; q++) {
        double *a = rows + p * width, *b = rows + q * width;
        const double gamma = sum_of_products(n, a, b), scale = sqrt(square[p]) * sqrt(square[q]);
        work += n;
        if (!(fabs(gamma) > ORTHOGONAL * scale)) {
            continue;
        }
        *largest = fabs(gamma) / scale > *largest ? fabs(gamma) / scale : *largest;
        rotate_pair(width, square[p], square[q], gamma, a, b);
        square[p] = sum_of_products(n, a, a);
        square[q] = sum_of_products(n, b, b);
        work += 2 * width + 2 * n + ROOTS;
    }
    return work;
}

/* Whether a sweep that has ended is followed by another one. */
static int sweeps_on(Turned *turned) {
    const int more = turned->round + 1 < SWEEPS && turned->largest > 8.0 * ORTHOGONAL;
    turned->round++;
    turned->row = 0;
    turned->largest = 0.0;
    return more;
}

static void next_stage(Turned *turned) {
    turned->stage++;
    turned->row = 0;
    turned->round = 0;
}

/* The next row, QL step, or row of a sweep; its multiplications. */
EVERYWHERE size_t turn_row(size_t count, size_t n, size_t width, double *rows, double *scratch, Turned *turned) {
    double *gram = scratch, *diagonal = gram + count * count, *off_diagonal = diagonal + count, *square = scratch;
    const size_t row = turned->row, left = count - row;
    size_t work = 0;
    switch (turned->stage) {
    case PRODUCTS:
        if (row < count) {
            work = set_products(count, n, width, row, rows, gram);
            turned->row++;
        } else {
            next_stage(turned);
        }
        break;
    case REFLECTIONS:
        if (row + 2 < count) {
            reflect_both(count, width, row, gram, rows, diagonal);
            work = left * (3 * left + 2 * width);
            turned->row++;
        } else {
            set_diagonal(count, gram, diagonal, off_diagonal);
            next_stage(turned);
        }
        break;
    case QL:
        if (row < count) {
            work = approach(count, width, diagonal, off_diagonal, rows, turned);
        } else {
            next_stage(turned);
        }
        break;
    case SQUARES:
        for (size_t i = 0; i < count; i++) {
            square[i] = sum_of_products(n, rows + i * width, rows + i * width);
        }
        work = count * n;
        next_stage(turned);
        break;
    default:
        if (row + 1 < count) {
            work = sweep(count, n, width, row, rows, square, &turned->largest);
            turned->row++;
        } else if (!sweeps_on(turned)) {
            turned->stage = ORTHOGONAL_ROWS;
        }
    }
    return work;
}

EVERYWHERE int turn(size_t count, size_t n, size_t width, double *rows, double *scratch, Turned *turned, size_t work) {
    size_t done = 0;
    while (turned->stage < ORTHOGONAL_ROWS && done < work) {
        done += turn_row(count, n, width, rows, scratch, turned);
    }
    return turned->stage == ORTHOGONAL_ROWS;
}

FOR_AVX2_AS(int, turn, (size_t count, size_t n, size_t width, double *rows, double *scratch, Turned *turned,
             size_t work),
            (count, n, width, rows, scratch, turned, work))

int orthogonal_rows(int wide, size_t count, size_t n, size_t width, double *rows, double *scratch, Turned *turned,
                    size_t work) {
    return CHOSEN(wide, turn)(count, n, width, rows, scratch, turned, work);
}

double smallest_singular_value(size_t n, double *rows, double *square) {
    Turned turned = {.stage = SQUARES};
    turn(n, n, n, rows, square, &turned, SIZE_MAX);
    double smallest = INFINITY;
    for (size_t i = 0; i < n; i++) {
        const double size = sqrt(sum_of_products(n, rows + i * n, rows + i * n));
        smallest = size < smallest ? size : smallest;
    }
    return smallest;
}
