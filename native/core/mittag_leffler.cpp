// The Mittag-Leffler function by two methods: an inverse Laplace transform along a parabola, and an integral along its
// branch cut.
//
// Parabola: Weideman and Trefethen (2007), Math. Comp. 76, 1341-1356. E_alpha(z) is the inverse Laplace transform of
// s^(alpha - 1) / (s^alpha - z) at time one. It is evaluated at 2 N nodes on s(u) = mu (1 + i u)^2 with mu = pi N / 12
// and the step 3 / N. The error is of order 2.85^-2N for a function that is analytic off the negative real axis. With
// N = 18 the relative error of the derivative at zero, which converges most slowly, is 1e-14. A larger N would only
// amplify rounding by exp(mu). Half of the nodes suffice; the others are complex conjugates.
//
// Line: the absolute rounding error of the sum on the parabola is constant, while E falls like exp(z). For orders near
// one and large |z|, E_alpha(-x) = sin(delta) / (pi alpha) int exp(-(x e^v)^(1/alpha)) / (2 (cosh v - cos delta)) dv
// with delta = pi (1 - alpha) is used instead: the transform on its branch cut at r = (x e^v)^(1/alpha). All terms are
// positive, so the sum keeps its relative accuracy for any small E. The trapezoidal rule at half-integers has an error
// due to the poles at v = +-i delta: their residues over 1 + exp(2 pi delta / step), which are added. At alpha = 1 only
// the residues remain, exp(-x). The poles lie inside the strip |Im v| <= alpha pi / 2 only for alpha > 2 / 3.

#include "mittag_leffler.hpp"

#include <math.h>

#include "pretouch.h"

namespace pretouch {
namespace {

constexpr double PI = 3.141592653589793;
constexpr int NODES = 18;

// At each node s of the parabola: ln s, and the weight of the integrand times s, both as real and imaginary part.
// tests/equations/test_mittag_leffler_tables.py recomputes them.
struct Node {
    double log_real, log_imaginary, real, imaginary;
};
constexpr Node PARABOLA[NODES] = {
    {1.5571154368021383, 0.16628246377688247, 8.696064412574668, 7.358208349101642},
    {1.6108196157739993, 0.4899573262537283, -4.391374210226015, 7.318957017043359},
    {1.7102804093046373, 0.789582239399523, -4.448519782226874, -1.8317434397404775},
    {1.8430718832864494, 1.0561488968527193, 0.5223624092680731, -1.9849771552186777},
    {1.996482096585984, 1.2870022175865687, 0.6603951568845355, 0.09434216526921937},
    {2.1601115203677863, 1.483894536011835, -0.007211590893363707, 0.16586659054736527},
    {2.3265848849217172, 1.6507537010414768, -0.03173105046547739, 0.0012692420186190957},
    {2.491178338422091, 1.7921107691426879, -0.0005167701988883456, -0.0046509317899951115},
    {2.651119422384054, 1.9122667497454622, 0.0005242379273415472, -9.038584954164607e-05},
    {2.8049401236569236, 2.014960130605857, 1.0283542159098804e-05, 4.55414009902947e-05},
    {2.9519935416134206, 2.1033004250967475, -3.052908934621782e-06, 8.326115276241223e-07},
    {3.0921270240262917, 2.179818093199122, -4.9665529808642795e-08, -1.5802668575477254e-07},
    {3.2254726638872078, 2.2465527032754533, 6.3179543290600264e-09, -2.2198217912913607e-09},
    {3.3523172502211662, 2.305143994431335, 7.5041884178319e-11, 1.951088988636294e-10},
    {3.473023335553653, 2.356912365158762, -4.6537379851759734e-12, 1.929598676780282e-12},
    {3.5879823083334172, 2.402925338242542, -3.787696585055697e-14, -8.572155429336577e-14},
    {3.697587197545908, 2.4440506464219793, 1.2191715646647132e-15, -5.689467301768661e-16},
    {3.802217519670013, 2.480997943931286, 6.550482251787442e-18, 1.3385768079739555e-17},
};

constexpr double NEAR_ONE = 0.68;       // order above which the integral along the line is used
constexpr double ROUNDING = 3.678794411714423e-14;  // absolute error of the sum on the parabola, 1e-13 / e, so that the
                                                    // relative error of E(-1) is 1e-13
constexpr double STEP = 0.15;           // on the line; the error exp(-2 pi d / step) is below 1e-19 there
constexpr double ROUGH = 1e-11;         // accuracy from which on a larger step suffices
constexpr double ROUGH_STEP = 0.2;      // its error is below 3e-15 of the integral
constexpr double LARGEST_POWER = 6.620073206530356;  // ln 750: exp(-750) is 0
constexpr double LARGEST = 1e300;         // replaces infinite arguments
constexpr int64_t CHUNK = 64;           // arguments that share the nodes on the line
constexpr double SHIFT = 1e-6;          // difference of orders that gives the derivative by the order on the line

void on_parabola(double order, const double *z, int64_t n, double *value, double *slope, double *by_order) {
    double real[NODES], imaginary[NODES], a[NODES], b[NODES], c[NODES], d[NODES];
    for (int j = 0; j < NODES; j++) {
        const Node &node = PARABOLA[j];
        const double size = exp(order * node.log_real), angle = order * node.log_imaginary;
        real[j] = size * cos(angle);  // s^alpha
        imaginary[j] = size * sin(angle);
        a[j] = node.real * real[j] - node.imaginary * imaginary[j];
        b[j] = node.real * imaginary[j] + node.imaginary * real[j];
        c[j] = a[j] * node.log_real - b[j] * node.log_imaginary;
        d[j] = a[j] * node.log_imaginary + b[j] * node.log_real;
    }
    for (int64_t i = 0; i < n; i++) {
        double sum = 0, squares = 0, logs = 0;
        for (int j = 0; j < NODES; j++) {
            const double along = real[j] - fmax(z[i], -LARGEST), size = 1 / (along * along + imaginary[j] * imaginary[j]);
            const double x = along * size, y = -imaginary[j] * size;  // of 1 / (s^alpha - z)
            const double square = x * x - y * y, twice = 2 * x * y;
            sum += x * a[j] - y * b[j];
            squares += square * a[j] - twice * b[j];
            logs += square * c[j] - twice * d[j];
        }
        value[i] = sum;
        slope[i] = squares;
        if (by_order != nullptr) by_order[i] = -z[i] * logs;
    }
}

// Computes E_alpha, and its derivative if `slope` is not null, at those of n <= CHUNK arguments with z < far.
void on_line(double order, const double *z, int64_t n, double far, double accuracy, double *value, double *slope) {
    const bool exact = accuracy < ROUGH;
    const double step = exact ? STEP : ROUGH_STEP, lowest = exact ? 1e-17 : 1e-6 * accuracy;
    const double delta = PI * (1 - order), half = sin(delta / 2), factor = step * sin(delta) / (PI * order);
    double farthest = 0, power[CHUNK];
    for (int64_t i = 0; i < n; i++) {
        if (!(z[i] < far)) continue;
        farthest = fmax(farthest, fmin(-z[i], LARGEST));
        power[i] = fmin(pow(-z[i], 1 / order), LARGEST);
        value[i] = 0;
        if (slope != nullptr) slope[i] = 0;
    }
    if (farthest == 0) return;
    // below, e^v < lowest / x for every argument -x; above, the integrand is 0
    const double first = floor((log(lowest) - log(farthest)) / step), last = ceil(order * LARGEST_POWER / step);
    for (double k = first; k < last && factor > 0; k++) {
        const double v = step * (k + 0.5), grown = sinh(v / 2), root = exp(v / order);
        const double weight = factor / (4 * (grown * grown + half * half));
        for (int64_t i = 0; i < n; i++) {
            if (!(z[i] < far)) continue;
            const double part = weight * exp(-power[i] * root);
            value[i] += part;
            if (slope != nullptr) slope[i] += root * part;
        }
    }
    const double turn = cos(delta / order), aside = sin(delta / order);
    const double share = 2 / order / (1 + exp(2 * PI * delta / step));
    for (int64_t i = 0; i < n; i++) {
        if (!(z[i] < far)) continue;
        const double decay = share * exp(-power[i] * turn), angle = power[i] * aside;
        value[i] += decay * cos(angle);
        if (slope == nullptr) continue;
        const double residue = decay * (cos(angle) * turn + sin(angle) * aside);
        slope[i] = (slope[i] + residue) * power[i] / (-z[i] * order);
    }
}

}  // namespace

void mittag_leffler(double order, const double *z, int64_t n, double accuracy, double *value, double *slope,
                    double *by_order) {
    on_parabola(order, z, n, value, slope, by_order);
    const double far = -log(accuracy / ROUNDING);
    for (int64_t i = 0; order > NEAR_ONE && i < n; i += CHUNK) {
        const int64_t size = n - i < CHUNK ? n - i : CHUNK;
        on_line(order, z + i, size, far, accuracy, value + i, slope + i);
        if (by_order == nullptr) continue;
        const double shift = order + SHIFT > 1 ? -SHIFT : SHIFT;
        on_line(order + shift, z + i, size, far, accuracy, by_order + i, nullptr);
        for (int64_t j = i; j < i + size; j++) {
            if (z[j] < far) by_order[j] = (by_order[j] - value[j]) / shift;
        }
    }
    if (order == 1) {
        for (int64_t i = 0; i < n; i++) value[i] = slope[i] = exp(z[i]);
    }
}

}  // namespace pretouch

void pretouch_mittag_leffler(const double *orders, int64_t count, const double *z, int64_t n, double accuracy,
                             double *value, double *slope) {
    for (int64_t i = 0; i < count; i++) {
        pretouch::mittag_leffler(orders[i], z + i * n, n, accuracy, value + i * n, slope + i * n, nullptr);
    }
}
