// Runs the kernels on the cases that check_machine.py has written, and prints the largest deviation from its results.

#include <math.h>
#include <stdio.h>

#include "cases.h"
#include "core/pretouch.h"

static int compare(const char *name, const double *actual, const double *expected, int n, double allowed) {
    double worst = 0.0;
    for (int i = 0; i < n; i++) {
        if (isnan(actual[i]) && isnan(expected[i])) continue;
        const double far =
            actual[i] == expected[i] ? 0.0 : fabs(actual[i] - expected[i]) / fmax(fabs(expected[i]), 1e-6);
        if (!isnan(worst) && !(far <= worst)) worst = far;  // a NaN stays
    }
    printf("%-12s %5d numbers, %.1e apart (%.0e allowed)\n", name, n, worst, allowed);
    return !(worst <= allowed);
}

int main(void) {
    static double time[N], states[5 * N], contacts[6 * N], rows[15 * N], designs[3 * N];
    static int8_t status[N];
    static int64_t ended[N];
    pretouch_column inputs[9];
    for (int i = 0; i < 9; i++) inputs[i] = {INPUTS + i * N, 1};
    pretouch_curves curves = {WINDOWS, WINDOW_ROWS, WINDOW_WIDTH, STARTS, CURVE_OF, 0};
    int failed = 0;
    const pretouch_linear wanted = {time, status, 0, nullptr, {states, N}, {}, {}};
    pretouch_linear_contacts(inputs, N, SLOPE, 30.0, &wanted);
    failed |= compare("linear", states, EXPECTED_LINEAR, 5 * N, 1e-9);
    pretouch_series_contacts(inputs, nullptr, N, &curves, 30.0, contacts, nullptr, nullptr, status);
    failed |= compare("lanes", contacts, EXPECTED_LANES, 6 * N, 1e-8);
    const pretouch_pieces curve = {PIECES, PIECE_ROWS, PIECE_WIDTH, 1, 0};
    pretouch_solve_series(VALUES, N, INPUTS + 8 * N, &curve, 30.0, rows, ended, nullptr, 0, nullptr, nullptr, 0);
    failed |= compare("guaranteed", rows, EXPECTED_SERIES, 15 * N, 1e-8);
    const double term[4] = {4.0, 1.0, 2.0, 0.0}, other[4] = {1.0, 25.0, 2.0, 0.0};
    const double limit[3] = {6.0, 1.0 / 0.06, 1.0};  // the largest excursion may be at most 6 cm
    double terms[8];
    for (int i = 0; i < 4; i++) terms[i] = term[i], terms[4 + i] = other[i];
    pretouch_find_gains(DESIGN_INPUTS, N, SLOPE, &curves, &curve, 0.0, INFINITY, 1, 30.0, terms, 2, limit, 1, 0.05, asinh(-10.0 / 0.05),
                        asinh(-0.01 / 0.05), -10.0, -0.01, designs);
    failed |= compare("designs", designs, EXPECTED_DESIGNS, 3 * N, 1e-6);
    return failed;
}
