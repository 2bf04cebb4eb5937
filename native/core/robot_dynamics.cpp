// The dynamics of a robot in one posture, reduced to its driven joints, and its motion with the least kinetic energy. See
// robots/dynamics.py, which has the mathematics.

#ifndef __wasm__

#include <stdlib.h>
#include <string.h>

#include "robot.hpp"

namespace pretouch {

namespace {

constexpr double RANK = 1e-10;        // relative singular values below it are zero up to rounding
constexpr double FEASIBLE = 1e-7;     // residual of a motion above which the joints cannot hold a direction
constexpr int64_t WITHOUT_MOTION = -1, NOT_DEFINITE = -2, NO_MEMORY = -3;

// Memory for the intermediate results of a call.
struct Memory {
    explicit Memory(int64_t count) : start(static_cast<double *>(malloc(static_cast<size_t>(count) * sizeof(double)))) {
        next = start;
    }
    Memory(const Memory &) = delete;
    Memory &operator=(const Memory &) = delete;
    ~Memory() { free(start); }
    double *take(int64_t count) {
        double *const place = next;
        next += count;
        return place;
    }
    int64_t *take_indices(int64_t count) { return reinterpret_cast<int64_t *>(take(count)); }  // they are as large
    double *start, *next;
};

double dot(const double *a, const double *b, int64_t n) {
    double sum = 0.0;
    for (int64_t i = 0; i < n; i++) sum += a[i] * b[i];
    return sum;
}
double size_of(const double *a, int64_t n) { return sqrt(dot(a, a, n)); }

// Subtracts from a vector its parts along orthonormal rows; twice, so that rounding does not accumulate.
void remove_parts(double *x, const double *rows, int64_t count, int64_t n) {
    for (int pass = 0; pass < 2; pass++)
        for (int64_t i = 0; i < count; i++) {
            const double part = dot(x, rows + i * n, n);
            for (int64_t j = 0; j < n; j++) x[j] -= part * rows[i * n + j];
        }
}

// Writes the singular values of a matrix after orthogonalize, and returns the largest one.
double singular_values(const double *turned, int64_t rows, int64_t columns, double *sizes) {
    double largest = 0.0;
    for (int64_t k = 0; k < columns; k++) {
        double sum = 0.0;
        for (int64_t i = 0; i < rows; i++) sum += turned[i * columns + k] * turned[i * columns + k];
        sizes[k] = sqrt(sum);
        largest = larger(largest, sizes[k]);
    }
    return largest;
}

// The parts of a reduced posture in the memory of the caller.
struct Parts {
    Parts(double *start, int64_t base, int64_t joints, int64_t rows) {
        const int64_t all = base + joints;
        mass = start;
        full = mass + all * all;
        inertia = full + 6 * all;
        own = inertia + joints * joints;
        relative = own + 6 * joints;
        motion = relative + 6 * joints;
        forced = motion + base * joints;
        loose = forced + base * joints;
        coupling = loose + base * base;
        end = coupling + rows * joints;
    }
    double *mass, *full, *inertia, *own, *relative, *motion, *forced, *loose, *coupling, *end;
};

// Adds J_b times the motion of the base to J_q; shape (6, n).
void add_base(const double *full, const double *motion, int64_t m, int64_t n, double *sum) {
    for (int64_t i = 0; i < 6; i++) {
        const double *row = full + i * (m + n);
        double *out = sum + i * n;
        memcpy(out, row + m, static_cast<size_t>(n) * sizeof(double));
        for (int64_t k = 0; k < m; k++)
            for (int64_t j = 0; j < n; j++) out[j] += row[k] * motion[k * n + j];
    }
}

// Computes P, B and C from the rows of the constraints, shape (rows, m + n); see Reduction in robots/dynamics.py.
void follow_constraints(const double *constraints, int64_t rows, int64_t m, int64_t n, const Parts &parts,
                        Memory &memory, int64_t *counts) {
    const int64_t all = m + n;
    double *left = memory.take(rows * m), *right = memory.take(m * m), *sizes = memory.take(m);
    double *moved = memory.take(n);
    for (int64_t i = 0; i < rows; i++)
        memcpy(left + i * m, constraints + i * all, static_cast<size_t>(m) * sizeof(double));
    orthogonalize(left, rows, m, right);
    const double largest = singular_values(left, rows, m, sizes);
    memset(parts.forced, 0, static_cast<size_t>(m * n) * sizeof(double));
    int64_t loose = 0;
    for (int64_t k = 0; k < m; k++) {
        if (sizes[k] > DEPENDENT * largest) {  // P = -A_b^+ A_q
            memset(moved, 0, static_cast<size_t>(n) * sizeof(double));
            for (int64_t i = 0; i < rows; i++)
                for (int64_t j = 0; j < n; j++) moved[j] += left[i * m + k] * constraints[i * all + m + j];
            for (int64_t i = 0; i < m; i++)
                for (int64_t j = 0; j < n; j++)
                    parts.forced[i * n + j] -= right[i * m + k] * moved[j] / (sizes[k] * sizes[k]);
        }
        if (!(sizes[k] > DEPENDENT * larger(1.0, largest))) {
            for (int64_t i = 0; i < m; i++) parts.loose[loose * m + i] = right[i * m + k];
            loose++;
        }
    }
    int64_t couplings = 0;
    for (int64_t i = 0; i < rows; i++) {
        double *row = parts.coupling + couplings * n;
        memcpy(row, constraints + i * all + m, static_cast<size_t>(n) * sizeof(double));
        for (int64_t k = 0; k < m; k++)
            for (int64_t j = 0; j < n; j++) row[j] += constraints[i * all + k] * parts.forced[k * n + j];
        if (size_of(row, n) > DEPENDENT) couplings++;
    }
    counts[0] = loose;
    counts[1] = couplings;
}

// Computes -G = P - B (B^T M_bb B)^-1 B^T (M_bb P + M_bq); loose has the columns of B in its rows. Returns false if the
// inertia of the base is not positive.
bool follow_momentum(const Parts &parts, int64_t m, int64_t n, int64_t loose, Memory &memory) {
    const int64_t all = m + n;
    double *momentum = memory.take(m * n), *inertia = memory.take(loose * loose), *row = memory.take(m);
    double *x = memory.take(loose);
    for (int64_t i = 0; i < m; i++)
        for (int64_t j = 0; j < n; j++) momentum[i * n + j] = parts.mass[i * all + m + j];
    for (int64_t i = 0; i < m; i++)
        for (int64_t k = 0; k < m; k++)
            for (int64_t j = 0; j < n; j++) momentum[i * n + j] += parts.mass[i * all + k] * parts.forced[k * n + j];
    for (int64_t a = 0; a < loose; a++) {
        for (int64_t i = 0; i < m; i++) row[i] = dot(parts.mass + i * all, parts.loose + a * m, m);
        for (int64_t b = 0; b < loose; b++) inertia[a * loose + b] = dot(parts.loose + b * m, row, m);
    }
    if (!factor(inertia, loose)) return false;
    memcpy(parts.motion, parts.forced, static_cast<size_t>(m * n) * sizeof(double));
    for (int64_t j = 0; j < n; j++) {
        for (int64_t a = 0; a < loose; a++) {
            x[a] = 0.0;
            for (int64_t i = 0; i < m; i++) x[a] += parts.loose[a * m + i] * momentum[i * n + j];
        }
        solve_lower(inertia, x, loose);
        solve_upper(inertia, x, loose);
        for (int64_t a = 0; a < loose; a++)
            for (int64_t i = 0; i < m; i++) parts.motion[i * n + j] -= parts.loose[a * m + i] * x[a];
    }
    return true;
}

// Computes T^T M T with T = (motion, 1): the inertia that the drives feel.
void reduce_inertia(const Parts &parts, int64_t m, int64_t n, Memory &memory) {
    const int64_t all = m + n;
    double *pushed = memory.take(m * n);  // M_bb motion + M_bq
    for (int64_t i = 0; i < m; i++) {
        memcpy(pushed + i * n, parts.mass + i * all + m, static_cast<size_t>(n) * sizeof(double));
        for (int64_t k = 0; k < m; k++)
            for (int64_t j = 0; j < n; j++) pushed[i * n + j] += parts.mass[i * all + k] * parts.motion[k * n + j];
    }
    for (int64_t i = 0; i < n; i++) {
        double *row = parts.inertia + i * n;
        memcpy(row, parts.mass + (m + i) * all + m, static_cast<size_t>(n) * sizeof(double));
        for (int64_t k = 0; k < m; k++) {
            const double first = parts.motion[k * n + i], second = parts.mass[(m + i) * all + k];
            for (int64_t j = 0; j < n; j++) row[j] += first * pushed[k * n + j] + second * parts.motion[k * n + j];
        }
    }
}

int64_t numbers_of_motion(int64_t n, int64_t k) { return 2 * n * n + 3 * n * k + 2 * k * k + 4 * (n + k) + 16; }

// Finds the motions of n joints with the least kinetic energy along m of k rows; see least_energy in robots/dynamics.py.
// Returns the number of motions that move no row, which are written to the columns of `others` unless it is null.
int64_t find_motions(const double *rows, int64_t k, const int64_t *driven, int64_t m, const double *inertia, int64_t n,
                     double *motions, double *others, Memory &memory) {
    double *lower = memory.take(n * n), *whitened = memory.take(k * n), *sizes = memory.take(k);
    memcpy(lower, inertia, static_cast<size_t>(n * n) * sizeof(double));
    if (!factor(lower, n)) return NOT_DEFINITE;
    double largest = 0.0;
    for (int64_t i = 0; i < k; i++) {
        memcpy(whitened + i * n, rows + i * n, static_cast<size_t>(n) * sizeof(double));
        solve_lower(lower, whitened + i * n, n);
        sizes[i] = size_of(whitened + i * n, n);
        largest = larger(largest, sizes[i]);
    }
    for (int64_t j = 0; j < m; j++)
        if (!(sizes[driven[j]] > RANK * largest)) return WITHOUT_MOTION;
    int64_t useful = 0;
    int64_t *place = memory.take_indices(k);  // the column of each row, negative for rows of zeros
    for (int64_t i = 0; i < k; i++) place[i] = sizes[i] > RANK * largest ? useful++ : -1;
    double *turned = memory.take(n * useful), *right = memory.take(useful * useful), *values = memory.take(useful);
    for (int64_t i = 0; i < k; i++)
        for (int64_t j = 0; place[i] >= 0 && j < n; j++)
            turned[j * useful + place[i]] = whitened[i * n + j] / sizes[i];
    orthogonalize(turned, n, useful, right);
    const double greatest = singular_values(turned, n, useful, values);
    double *part = memory.take(useful), *missed = memory.take(useful), *x = memory.take(n);
    for (int64_t j = 0; j < m; j++) {
        const int64_t at = place[driven[j]];
        const double target = 1.0 / sizes[driven[j]];
        memset(missed, 0, static_cast<size_t>(useful) * sizeof(double));
        memset(x, 0, static_cast<size_t>(n) * sizeof(double));
        missed[at] = -target;
        for (int64_t c = 0; c < useful; c++) {
            if (!(values[c] > RANK * greatest)) continue;
            part[c] = right[at * useful + c] * target;
            for (int64_t i = 0; i < useful; i++) missed[i] += right[i * useful + c] * part[c];
            for (int64_t i = 0; i < n; i++) x[i] += turned[i * useful + c] * (part[c] / (values[c] * values[c]));
        }
        if (size_of(missed, useful) > FEASIBLE * target) return WITHOUT_MOTION;
        solve_upper(lower, x, n);
        for (int64_t i = 0; i < n; i++) motions[i * m + j] = x[i];
    }
    double *basis = memory.take(n * n);  // orthonormal rows: first those that move, then those that move no row
    int64_t rank = 0;
    for (int64_t c = 0; c < useful; c++) {
        if (!(values[c] > RANK * greatest)) continue;
        for (int64_t i = 0; i < n; i++) basis[rank * n + i] = turned[i * useful + c] / values[c];
        rank++;
    }
    for (int64_t found = rank; others && found < n; found++) {
        double *row = basis + found * n;
        int64_t farthest = 0;  // the joint that the basis contains least
        double least = INFINITY;
        for (int64_t j = 0; j < n; j++) {
            double sum = 0.0;
            for (int64_t i = 0; i < found; i++) sum += basis[i * n + j] * basis[i * n + j];
            if (sum < least) least = sum, farthest = j;
        }
        memset(row, 0, static_cast<size_t>(n) * sizeof(double));
        row[farthest] = 1.0;
        remove_parts(row, basis, found, n);
        const double size = size_of(row, n);
        for (int64_t j = 0; j < n; j++) row[j] /= size;
    }
    for (int64_t c = rank; others && c < n; c++) {
        memcpy(x, basis + c * n, static_cast<size_t>(n) * sizeof(double));
        solve_upper(lower, x, n);
        for (int64_t i = 0; i < n; i++) others[i * (n - rank) + c - rank] = x[i];
    }
    return n - rank;
}

// The smallest effective mass in any direction that joints and couplings allow.
double lightest_mass(const Parts &parts, int64_t n, const double *coupling, int64_t count, Memory &memory) {
    double *lower = memory.take(n * n), *seen = memory.take(3 * n), *turned = memory.take(n * larger_of(count, 3));
    double *right = memory.take(larger_of(count, 3) * larger_of(count, 3)), *values = memory.take(larger_of(count, 3));
    double *held = memory.take(n * count);
    memcpy(lower, parts.inertia, static_cast<size_t>(n * n) * sizeof(double));
    if (!factor(lower, n)) return NAN;
    for (int64_t j = 0; j < n; j++)
        for (int64_t i = 0; i < count; i++) turned[j * count + i] = coupling[i * n + j];
    orthogonalize(turned, n, count, right);
    const double largest = singular_values(turned, n, count, values);
    int64_t rank = 0;
    for (int64_t c = 0; c < count; c++) {
        if (!(values[c] > DEPENDENT * larger(1.0, largest))) continue;
        double *row = held + rank * n;
        for (int64_t j = 0; j < n; j++) row[j] = turned[j * count + c] / values[c];
        solve_lower(lower, row, n);
        remove_parts(row, held, rank, n);
        const double size = size_of(row, n);
        for (int64_t j = 0; j < n; j++) row[j] /= size;
        rank++;
    }
    memcpy(seen, parts.own, static_cast<size_t>(3 * n) * sizeof(double));
    for (int64_t i = 0; i < 3; i++) {
        solve_lower(lower, seen + i * n, n);
        remove_parts(seen + i * n, held, rank, n);
        for (int64_t j = 0; j < n; j++) turned[j * 3 + i] = seen[i * n + j];
    }
    orthogonalize(turned, n, 3, right);
    const double most = singular_values(turned, n, 3, values);
    return 1.0 / (most * most);
}

}  // namespace

bool factor(double *matrix, int64_t n) {
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j <= i; j++) {
            const double sum = matrix[i * n + j] - dot(matrix + i * n, matrix + j * n, j);
            if (i == j && !(sum > 0.0)) return false;
            matrix[i * n + j] = i == j ? sqrt(sum) : sum / matrix[j * n + j];
        }
    return true;
}
void solve_lower(const double *lower, double *x, int64_t n) {
    for (int64_t i = 0; i < n; i++) x[i] = (x[i] - dot(lower + i * n, x, i)) / lower[i * n + i];
}
void solve_upper(const double *lower, double *x, int64_t n) {
    for (int64_t i = n - 1; i >= 0; i--) {
        x[i] /= lower[i * n + i];
        for (int64_t j = 0; j < i; j++) x[j] -= lower[i * n + j] * x[i];
    }
}

void orthogonalize(double *matrix, int64_t rows, int64_t columns, double *right) {
    for (int64_t i = 0; i < columns * columns; i++) right[i] = i % (columns + 1) ? 0.0 : 1.0;
    double whole = 0.0;
    for (int64_t i = 0; i < rows * columns; i++) whole += matrix[i] * matrix[i];
    const auto turn = [columns](double *a, int64_t count, int64_t p, int64_t q, double c, double s) {
        for (int64_t i = 0; i < count; i++) {
            const double x = a[i * columns + p], y = a[i * columns + q];
            a[i * columns + p] = c * x - s * y;
            a[i * columns + q] = s * x + c * y;
        }
    };
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        bool done = true;
        for (int64_t p = 0; p < columns; p++) {
            for (int64_t q = p + 1; q < columns; q++) {
                double alpha = 0.0, beta = 0.0, gamma = 0.0;
                for (int64_t i = 0; i < rows; i++) {
                    const double x = matrix[i * columns + p], y = matrix[i * columns + q];
                    alpha += x * x;
                    beta += y * y;
                    gamma += x * y;
                }
                if (gamma == 0.0 || fabs(gamma) <= 1e-15 * sqrt(alpha * beta)) continue;
                if (alpha <= NOTHING * whole || beta <= NOTHING * whole) continue;  // the direction of rounding
                done = false;
                const double zeta = (beta - alpha) / (2.0 * gamma);
                const double t = copysign(1.0, zeta) / (fabs(zeta) + sqrt(1.0 + zeta * zeta));
                const double c = 1.0 / sqrt(1.0 + t * t);
                turn(matrix, rows, p, q, c, c * t);
                turn(right, columns, p, q, c, c * t);
            }
        }
        if (done) return;
    }
}

}  // namespace pretouch

// ---- the C interface ----

using namespace pretouch;

int64_t pretouch_robot_posture_reduce(const double *mass, const double *jacobian, const double *constraints,
                                      const int64_t *degrees, int64_t nv, int64_t base, int64_t joints, int64_t rows,
                                      double *result, int64_t *counts) {
    const int64_t m = base, n = joints, all = m + n;
    const Parts parts(result, m, n, rows);
    Memory memory(rows * m + 3 * m * m + 2 * m * n + 4 * m + 2 * n + rows * all + 16);
    if (!memory.start) return NO_MEMORY;
    for (int64_t i = 0; i < all; i++)
        for (int64_t j = 0; j < all; j++) parts.mass[i * all + j] = mass[degrees[i] * nv + degrees[j]];
    for (int64_t i = 0; i < 6; i++)
        for (int64_t j = 0; j < all; j++) parts.full[i * all + j] = jacobian[i * nv + degrees[j]];
    if (rows) {
        double *selected = memory.take(rows * all);
        for (int64_t i = 0; i < rows; i++)
            for (int64_t j = 0; j < all; j++) selected[i * all + j] = constraints[i * nv + degrees[j]];
        follow_constraints(selected, rows, m, n, parts, memory, counts);
    } else {
        memset(parts.forced, 0, static_cast<size_t>(m * n) * sizeof(double));
        for (int64_t i = 0; i < m * m; i++) parts.loose[i] = i % (m + 1) ? 0.0 : 1.0;
        counts[0] = m;
        counts[1] = 0;
    }
    if (!follow_momentum(parts, m, n, counts[0], memory)) return NOT_DEFINITE;
    reduce_inertia(parts, m, n, memory);
    add_base(parts.full, parts.forced, m, n, parts.own);
    add_base(parts.full, parts.motion, m, n, parts.relative);
    return 0;
}

int64_t pretouch_robot_least_energy(const double *rows, int64_t row_count, const int64_t *driven, int64_t motion_count,
                                    const double *inertia, int64_t joints, double *motions, double *others) {
    Memory memory(numbers_of_motion(joints, row_count));
    if (!memory.start) return NO_MEMORY;
    return find_motions(rows, row_count, driven, motion_count, inertia, joints, motions, others, memory);
}

int64_t pretouch_robot_axis_motion(double *posture, int64_t base, int64_t joints, const double *axis,
                                   const double *rows, int64_t row_count, int64_t couplings, const uint8_t *locked,
                                   double *motion) {
    const int64_t m = base, n = joints, k = row_count, driven = 0;
    const Parts parts(posture, m, n, 0);
    Memory memory(numbers_of_motion(n, k) + 2 * n * n + n * k + 5 * n + 2 * (couplings + 3) * n +
                  (couplings + 3) * (couplings + 4));
    if (!memory.start) return NO_MEMORY;
    int64_t *kept = memory.take_indices(n);
    double *inertia = memory.take(n * n), *selected = memory.take(k * n);
    double *moves = memory.take(n);
    int64_t count = 0;
    for (int64_t j = 0; j < n; j++)
        if (!locked[j]) kept[count++] = j;
    if (!count) return WITHOUT_MOTION;
    for (int64_t i = 0; i < count; i++) {
        const int64_t from = kept[i];
        for (int64_t j = 0; j < count; j++) inertia[i * count + j] = parts.inertia[from * n + kept[j]];
        for (int64_t r = 0; r < k; r++) selected[r * count + i] = rows[r * n + from];
    }
    const int64_t loose = find_motions(selected, k, &driven, 1, inertia, count, moves, nullptr, memory);
    if (loose < 0) return loose;
    double *q = motion, *result = motion + n;
    memset(q, 0, static_cast<size_t>(n) * sizeof(double));
    for (int64_t i = 0; i < count; i++) q[kept[i]] = moves[i];
    double moved = 0.0, twist[6];
    for (int64_t i = 0; i < n; i++) moved += q[i] * dot(parts.inertia + i * n, q, n);
    for (int64_t i = 0; i < 6; i++) twist[i] = dot(parts.relative + i * n, q, n);
    const double ahead = dot(twist, axis, 3), about = dot(twist + 3, axis, 3);
    for (int64_t i = 0; i < 3; i++) {
        twist[i] -= ahead * axis[i];
        twist[3 + i] -= about * axis[i];
    }
    result[0] = moved;
    result[1] = 1.0 - ahead;
    result[2] = sqrt(lightest_mass(parts, n, rows + (k - couplings) * n, couplings, memory) / moved);
    result[3] = size_of(twist + 3, 3);
    result[4] = size_of(twist, 3);
    return loose;
}

#endif
