/* C interface of the kernels. Python calls them through ctypes (pretouch/_core/native.py), which checks every argument,
 * so no function here reports errors. All arrays are contiguous, and float64 unless stated otherwise. Output arrays are
 * not const. */

#ifndef PRETOUCH_H
#define PRETOUCH_H

#include <stdint.h>

#include "../law/pretouch_law.h" /* PRETOUCH_API, and the sampled law */

#ifdef __cplusplus
extern "C" {
#endif

/* Numbers of many encounters: stride 1, or one number for all of them: stride 0. */
typedef struct {
    const double *at;
    int64_t stride;
} pretouch_column;

/* Which kernels run: 0 base, 1 AVX2 and FMA, 2 AVX-512. Choosing returns the variant that runs from then
 * on: the requested one, or the best that the processor and the library support. */
PRETOUCH_API int pretouch_best_variant(void);
PRETOUCH_API int pretouch_choose_variant(int wanted);

/* ---- one encounter at a time; every contact is found or excluded (linear.cpp, lanes_guaranteed.cpp) ----
 * values: M, D, K, x~(0), x~'(0), p, v, a, velocity and acceleration of the reference; SI, shape (n, 10).
 * rows: filled with COLUMNS of motion/layout.py, shape (n, 15); status: filled with the values of ContactStatus. */
PRETOUCH_API void pretouch_solve_linear(const double *values, int64_t n, double slope, const double *gains,
                                        double horizon, double low, double high, double *rows, int64_t *status);

/* The first `count` of y, y', y'', y''' and the integral of y, for M y'' + D y' + K y = f0 + f1 t, for each row (M, D,
 * K, y0, v0, f0, f1) at times, shape (n, m). In out, encounters are `stride` numbers apart, times `step` numbers. */
PRETOUCH_API void pretouch_respond(const double *rows, int64_t n, const double *times, int64_t m, double *out,
                                   int64_t stride, int64_t step, int64_t count);

/* A curve on pieces: middle, half width and coefficients of g of each, ascending, shape (count, width); whether its lowest
 * border is the contact, and whether the curve continues beyond the highest. */
typedef struct {
    const double *pieces;
    int64_t count, width, ends_in_contact, open_ended;
} pretouch_pieces;

/* If times, shape (n, m), is not null, trace is filled with TRACE_COLUMNS of motion/layout.py, shape (n, m, 4). An
 * obstacle whose acceleration changes has further sections of its path, shape (n, section_count, 4): the time at which
 * a section starts, and p, v and a of p + v t + a t^2 / 2 from there on, with t from the start of the encounter. */
PRETOUCH_API void pretouch_solve_series(const double *values, int64_t n, const double *gains,
                                        const pretouch_pieces *curve, double horizon, double *rows, int64_t *status,
                                        const double *times, int64_t m, double *trace, const double *sections,
                                        int64_t section_count);

/* The tables of stiff_step.cpp, for tests: points (10), then four matrices (10, 10) of radau_tables.hpp. */
PRETOUCH_API void pretouch_radau_points(double *tables);

/* Derivatives of time and l' at contact by nine inputs: found, shape (n, 2, 9); or, where shape is not null, by a parameter
 * of the curve as well, (n, 2, 10), whose change of g has the coefficients shape, (count, width - 2), on the pieces. */
PRETOUCH_API void pretouch_follow_gradients(const double *values, int64_t n, const double *gains,
                                            const pretouch_pieces *curve, const double *shape, double horizon,
                                            double *found, int8_t *status);

/* ---- many encounters with a constant slope, vectorized (lanes_linear.cpp) ---- */
/* Rows with one number per encounter: the first row, and the distance between rows. */
typedef struct {
    double *at;
    int64_t stride;
} pretouch_rows;

/* Outputs at contacts. time and status (0, or -1 if open) are computed, or `given` by an earlier call. The others are
 * filled if not null, with NaN if open: l'; x~, x~', x~'', l' and the integral of x~; the derivatives of time, x~ and
 * l', ten rows each, by the inputs up to D_p and by the slope; the largest demands, five rows. */
typedef struct {
    double *time;
    int8_t *status;
    int64_t given;
    double *approach;
    pretouch_rows states, gradients, peaks;
} pretouch_linear;

/* inputs: M, D, K, x~(0), x~'(0), p, v, a, D_p, and for the demands velocity and acceleration of the reference. */
PRETOUCH_API void pretouch_linear_contacts(const pretouch_column *inputs, int64_t n, double slope, double horizon,
                                           const pretouch_linear *wanted);

/* For tests: for x <= 0 the rows e^x and 1 - e^x; the same two with phi_2, phi_3 and their validity, 1 or 0; e^x and
 * 1 - e^x with low accuracy; ln(1 - x) with low accuracy. out, shape (10, n). */
PRETOUCH_API void pretouch_exponentials(const double *x, int64_t n, double *out);

/* ---- many encounters with any curve, vectorized (lanes_series.cpp) ----
 * The curves: windows of all, shape (rows, width); first row of each curve, and the number of rows; curve of each
 * encounter. */
typedef struct {
    const double *windows;
    int64_t rows, width;
    const int64_t *starts;
    const int64_t *curve_of;
    int64_t stride; /* of curve_of: 0 if all encounters share one curve */
} pretouch_curves;

/* out: time, x~, x~', x~'', l' and the integral of x~, shape (6, n); gradients, if not null: of time, x~ and l' by
 * the inputs, shape (3, 9, n); or peaks, if not null: the largest demands, shape (5, n), for a reference as above. */
PRETOUCH_API void pretouch_series_contacts(const pretouch_column *inputs, const pretouch_column *reference, int64_t n,
                                           const pretouch_curves *curves, double horizon, double *out,
                                           double *gradients, double *peaks, int8_t *status);

/* ---- approaches under the virtual drag (lanes_drag.cpp) ----
 * inputs: k = phi / M, a_o, l, l'^2 and t at the start, k, l and l'^2 not negative; for peaks, the position
 * relative to the robot's start, the velocity and the acceleration of the obstacle at t = 0; shape (n) each.
 *
 * Outputs: rows, shape (n, 6): t, l, l'^2, g at the end, 2 k int g^2 dl, and the estimated relative error of the
 * duration; status: the values of ContactStatus; cells: how many intervals an approach has. The others are filled if not
 * null, and only at ends that are not unresolved: peaks, shape (n, 7): the largest k g^2 l'^2 and its distance, the
 * smallest, the largest and the smallest velocity, the largest and the smallest travel of the robot; gradients, shape (n,
 * 2, 5): derivatives of l'^2 and t at the end by k, a_o, l and l'^2 at the start, and the parameter of `changes`; nodes:
 * distances of the 16 quadrature points of each interval; balance, shape (n, 2): k int s' ds and its moment; trace, shape
 * (n, m, 2): l and |l'| at ascending times, shape (n, m), that lie in the approach.
 *
 * first: index of the first interval of each approach, for nodes and for values at nodes: changes (dg/d(parameter)) for
 * gradients, and log_outputs (ln xi) for balance; null without any of them. */
typedef struct {
    double *rows;
    int64_t *status, *cells;
    double *peaks, *gradients, *nodes, *balance;
    const int64_t *first;
    const double *changes, *log_outputs;
    const double *times;
    int64_t m;
    double *trace;
} pretouch_approaches;

PRETOUCH_API void pretouch_drag_approaches(const pretouch_column *inputs, int64_t n, const pretouch_curves *curves,
                                           double horizon, const pretouch_approaches *wanted);

/* ---- designs (lanes_design.cpp) ---- */
/* inputs: as values above, shape (10, n). slope: g at l = 0. curves and pieces: the curve, both null if that is g
 * everywhere; then the distances from `nearest` to `farthest` are valid. falling: whether
 * g < 0 at all distances that an encounter may reach. terms: rows of factor * |quantity|^exponent, shape (k, 4): quantity
 * (0 time, 1 displacement, 2 velocity, 3 acceleration, 4 relative velocity, 5 virtual force, at contact; the largest 6
 * excursion, 7 travel, 8 speed, 9 acceleration, 10 virtual force), factor in SI, exponent, and 1 if the term is divided by
 * the obstacle's squared speed, else 0. limits: rows of quantity, factor and exponent, at most 16, for
 * factor * |quantity|^exponent <= 1. Gains are scale * sinh(u), u from
 * weak to strong, within [low, high]. out: the optimal gains, their objective, and 1 if both are certain, 2 if no gain
 * meets the limits, else 0; shape (3, n). */
PRETOUCH_API void pretouch_find_gains(const double *inputs, int64_t n, double slope, const pretouch_curves *curves,
                                      const pretouch_pieces *pieces, double nearest, double farthest, int falling,
                                      double horizon, const double *terms, int64_t k, const double *limits,
                                      int64_t limit_count, double scale, double strong, double weak, double low,
                                      double high, double *out);
/* Two Chebyshev series at n places in [low, high]: coefficients of both, shape (2, m); out, shape (2, n). */
PRETOUCH_API void pretouch_interpolate(const double *place, int64_t n, double low, double high,
                                       const double *coefficients, int64_t m, double *out);

/* ---- the sampled loop (loop*.cpp) ---- */
/* m x'' = f - friction(x') - F_contact; f follows k (x_v - x) + d_v x_v' - d_x x' + m_f x_v'' at the servo's rate. A
 * mass of 0 stands for the ideal plant, a servo rate of 0 for no lag. */
typedef struct {
    double mass, stiffness, reference_damping, own_damping, feedforward_mass, servo_rate, coulomb_friction;
    double friction_speed;
} pretouch_plant;

/* A linear plant with the states x, x' and so many hidden ones z, which replaces the coefficients but the mass. rows:
 * x'' and z' by (x, x', z, x_v, x_v', x_v'', force on the plant), shape (1 + hidden, 6 + hidden); null without such a
 * plant. starts: z at the start by (x, x') there, shape (hidden, 2). */
enum { PRETOUCH_MOST_HIDDEN = 30 };
typedef struct {
    const double *rows, *starts;
    int64_t hidden;
} pretouch_state_space;

/* k d^n + c d', c times d^n where damping grows with depth (other than 0); 1 / mass of the obstacle, 0: driven. */
typedef struct {
    double stiffness, damping, exponent, grows, inverse_mass;
} pretouch_contact;

/* See SensorChain in simulation/chain.py, where `offset` is that and the crosstalk; truth values are 0 or not. */
typedef struct {
    double rate, phase, exposure, delay, jitter, noise, relative_noise, offset, drift, lowest, highest, resolution;
    double dropout, measures_distance, distance_noise, distance_resolution, random_phase, misfit, misfit_length;
} pretouch_chain;

/* ln xi and its slope times the step at equal distances, shape (rows, 2), from `low` on; beyond `high` xi is 0. */
typedef struct {
    const double *table;
    int64_t rows;
    double low, step, high;
} pretouch_curve;

/* A law's step; its parameters and first states, each so many octets long, a multiple of 8; whose is which. */
typedef struct {
    pretouch_law_step *step;
    const char *parameters;
    const char *states;
    int64_t parameters_size, state_size;
    const int64_t *law_of, *start_of;
} pretouch_laws;

/* Position and velocity of the plant; position, velocity, acceleration of obstacle and reference. */
typedef struct {
    double x, v, xo, vo, ao, xd, vd, ad;
} pretouch_scene;

/* The obstacle's acceleration until a time, which is not that of the scene before. */
typedef struct {
    double until, acceleration;
} pretouch_stretch;

/* A reading on its way: the number, when it can be had, when it was measured. */
typedef struct {
    double value, ready, taken;
} pretouch_reading;

/* Filled by RESULT_COLUMNS, CONTACT_COLUMNS, TRACE_COLUMNS and COURSE_COLUMNS of simulation/native_loop.py. */
typedef struct {
    double status, time, position, velocity, displacement, relative_velocity, closest_distance, largest_excursion;
    double largest_travel, largest_speed, largest_virtual_force, peak_force, impulse, rebound_velocity, contacts;
    double detection_time, flags, end_time, impact_force, distance, acceleration, virtual_force, largest_acceleration;
} pretouch_end;
typedef struct {
    double time, relative_velocity, peak_force, impulse, rebound_velocity, duration;
} pretouch_touch;
typedef struct {
    double time, distance, position, velocity, obstacle_position, virtual_position, virtual_velocity, virtual_force;
    double contact_force, reading, log_level, flags;
} pretouch_instant;
typedef struct {
    double time, distance, relative_velocity, contact_force;
} pretouch_moment;

/* All encounters of a loop. trace and course, as far as they have rows, are those of the last encounter that is run. */
typedef struct {
    pretouch_laws laws;
    pretouch_plant plant;
    pretouch_contact contact;
    pretouch_chain chain;
    const pretouch_curve *curves;
    const int64_t *curve_of;
    double period, plant_step, horizon, follow_time; /* of the controller, of the plant, to wait for contact, to follow it */
    uint64_t seed;
    const pretouch_scene *scenes;
    const int64_t *draws; /* which run's noise each meets */
    pretouch_end *ends;
    pretouch_touch *touches; /* so many a run */
    int64_t most_touches;
    pretouch_instant *trace;
    int64_t trace_rows;
    pretouch_moment *course;
    int64_t course_rows;
    const pretouch_stretch *stretches; /* so many a scene, by their time, before its acceleration holds */
    int64_t stretches_each;
    pretouch_state_space linear;
} pretouch_loop;

/* Runs those encounters that `which` names, several of them side by side where the law is the damper. state: room for
 * eight states of the law; waiting: for eight times `room` readings, a power of two, more than can be on their way at
 * once. */
PRETOUCH_API void pretouch_run_encounters(const pretouch_loop *loop, const int64_t *which, int64_t n, void *state,
                                          pretouch_reading *waiting, int64_t room);

/* Steps a law over n samples in a row. */
PRETOUCH_API void pretouch_run_law(pretouch_law_step *step, const void *parameters, void *state,
                                   const pretouch_sample *samples, int64_t n, pretouch_output *out);

/* A step that resolves a contact that starts with a relative speed, and how long it would last without loss and
 * drive [s]. inverse_mass: 1 / the reduced mass of both bodies. */
PRETOUCH_API double pretouch_contact_step(const pretouch_contact *contact, double inverse_mass, double speed);
PRETOUCH_API double pretouch_elastic_duration(const pretouch_contact *contact, double inverse_mass, double speed);
/* The sensor chain of one run by itself, for robots that are simulated elsewhere. `sensor`: this many bytes of the caller,
 * aligned to 8; chain, curve and waiting (a power of two of rows) must live as long. A sensor starts at a distance [m] at
 * t = 0, is shown the distance at each instant that it asks for, and delivers the newest reading until a time: 1 if
 * there is a new one; reading and measured (when it was taken [s]) keep the last one otherwise. */
PRETOUCH_API int64_t pretouch_sensor_size(void);
PRETOUCH_API void pretouch_sensor_start(void *sensor, const pretouch_chain *chain, const pretouch_curve *curve,
                                        uint64_t seed, int64_t run, pretouch_reading *waiting, int64_t room,
                                        double distance);
PRETOUCH_API double pretouch_sensor_next(const void *sensor);
PRETOUCH_API void pretouch_sensor_look(void *sensor, double distance);
PRETOUCH_API int64_t pretouch_sensor_deliver(void *sensor, double t, double *reading, double *measured);
/* The cubic through both ends of a step, by slopes over the whole step: its value and, into `slope`, its slope at s. */
PRETOUCH_API double pretouch_cubic(double start, double start_slope, double end, double end_slope, double s,
                                   double *slope);
/* The part of a step at which that cubic first touches zero, 2 where it does not; `least`: what it comes to. */
PRETOUCH_API double pretouch_first_touch(double start, double start_slope, double end, double end_slope, double doubt,
                                         double *least);

#ifdef __cplusplus
}
#endif

#endif
