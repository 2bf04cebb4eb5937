/* C interface of the kernels. Python calls them through ctypes (pretouch/_core/native.py) and checks every argument
 * before, so no function here reports errors. All arrays are contiguous, and float64 unless stated otherwise. Output
 * arrays are those that are not const. */

#ifndef PRETOUCH_H
#define PRETOUCH_H

#include <stdint.h>

#include "../law/pretouch_law.h" /* declares PRETOUCH_API and the sampled law */

#ifdef __cplusplus
extern "C" {
#endif

/* One quantity of many encounters: one number each (stride 1), or one number for all (stride 0). */
typedef struct {
    const double *at;
    int64_t stride;
} pretouch_column;

/* Variants of the vectorized kernels: 0 base, 1 AVX2 and FMA, 2 AVX-512. pretouch_best_variant returns the best one
 * that the processor and the library support. pretouch_choose_variant selects a variant, or the best one if `wanted` is
 * negative or not supported, and returns the variant that runs from then on. */
PRETOUCH_API int pretouch_best_variant(void);
PRETOUCH_API int pretouch_choose_variant(int wanted);

/* ---- guaranteed solvers: one encounter at a time, no contact is missed (linear.cpp, lanes_guaranteed.cpp) ----
 * values: M, D, K, x~(0), x~'(0), p, v, a, velocity and acceleration of the reference; in SI units, shape (n, 10).
 * rows: output, COLUMNS of motion/layout.py, shape (n, 15). status: output, values of ContactStatus. */
PRETOUCH_API void pretouch_solve_linear(const double *values, int64_t n, double slope, const double *gains,
                                        double horizon, double low, double high, double *rows, int64_t *status);

/* The response of M y'' + D y' + K y = f0 + f1 t: the first `count` of y, y', y'', y''' and the integral of y. Each row
 * has M, D, K, y0, v0, f0 and f1; times has the shape (n, m). In `out`, encounters are `stride` numbers apart, and
 * times `step` numbers. */
PRETOUCH_API void pretouch_respond(const double *rows, int64_t n, const double *times, int64_t m, double *out,
                                   int64_t stride, int64_t step, int64_t count);

/* The slope g of a sensor curve, by polynomials on pieces. pieces: middle, half width and coefficients of g for each
 * piece, in ascending order, shape (count, width). ends_in_contact: whether the lowest border is the contact.
 * open_ended: whether the curve continues beyond the highest border. */
typedef struct {
    const double *pieces;
    int64_t count, width, ends_in_contact, open_ended;
} pretouch_pieces;

/* Solves encounters with a curve in pieces. If `times`, shape (n, m), is not null, `trace` is filled with TRACE_COLUMNS
 * of motion/layout.py, shape (n, m, 4). An obstacle whose acceleration changes has further sections of its path in
 * `sections`, shape (n, section_count, 4). Each has the time at which it starts, and p, v and a of p + v t + a t^2 / 2
 * from then on, where t starts with the encounter. */
PRETOUCH_API void pretouch_solve_series(const double *values, int64_t n, const double *gains,
                                        const pretouch_pieces *curve, double horizon, double *rows, int64_t *status,
                                        const double *times, int64_t m, double *trace, const double *sections,
                                        int64_t section_count);

/* For tests: copies RadauTables of radau_tables.hpp, the 10 points and four matrices of shape (10, 10). */
PRETOUCH_API void pretouch_radau_points(double *tables);

/* Derivatives of time and l' at contact by the nine inputs M to D_p: `found`, shape (n, 2, 9). status: 0 for a contact,
 * 1 if l left the curve, else 2; the derivatives are then NaN. If `shape` is not null, derivatives by a parameter of
 * the curve are added, and `found` has the shape (n, 2, 10). `shape` has the coefficients of dg/d(parameter) on the
 * pieces, shape (count, width - 2). */
PRETOUCH_API void pretouch_follow_gradients(const double *values, int64_t n, const double *gains,
                                            const pretouch_pieces *curve, const double *shape, double horizon,
                                            double *found, int8_t *status);

/* ---- many encounters with a constant slope, vectorized (lanes_linear.cpp) ---- */
/* Output rows with one number per encounter: the first row, and the distance between rows, in numbers. */
typedef struct {
    double *at;
    int64_t stride;
} pretouch_rows;

/* Outputs at contacts. time and status (0 for a contact, -1 if open, which means that another solver must decide) are
 * computed, or are inputs from an earlier call if `given` is not 0. The other outputs are computed if they are not
 * null; they are NaN if the encounter is open.
 * approach: l'.
 * states: five rows, x~, x~', x~'', l' and the integral of x~.
 * gradients: the derivatives of time, x~ and l', ten rows each, by the inputs up to D_p and by the slope.
 * peaks: five rows, the largest demands, PEAKS of motion/layout.py. */
typedef struct {
    double *time;
    int8_t *status;
    int64_t given;
    double *approach;
    pretouch_rows states, gradients, peaks;
} pretouch_linear;

/* inputs: M, D, K, x~(0), x~'(0), p, v, a, D_p; for peaks also velocity and acceleration of the reference. */
PRETOUCH_API void pretouch_linear_contacts(const pretouch_column *inputs, int64_t n, double slope, double horizon,
                                           const pretouch_linear *wanted);

/* For tests: the functions of lanes_exponential.hpp for x <= 0, in the rows of out, shape (10, n): e^x and 1 - e^x; the
 * same two with phi_2, phi_3 and their validity, 1 or 0; e^x and 1 - e^x with low accuracy; ln(1 - x) with low
 * accuracy. */
PRETOUCH_API void pretouch_exponentials(const double *x, int64_t n, double *out);

/* ---- many encounters with any curve, vectorized (lanes_series.cpp) ----
 * Tables of one or several sensor curves. windows: rows of all curves, shape (rows, width). starts: index of the first
 * row of each curve, followed by the number of rows. curve_of: index of the curve of each encounter. */
typedef struct {
    const double *windows;
    int64_t rows, width;
    const int64_t *starts;
    const int64_t *curve_of;
    int64_t stride; /* stride of curve_of: 0 if all encounters share one curve, else 1 */
} pretouch_curves;

/* out: time, x~, x~', x~'', l' and the integral of x~ at the contact, shape (6, n). gradients, if not null: the
 * derivatives of time, x~ and l' by the nine inputs, shape (3, 9, n). peaks, if not null and without gradients: five
 * rows of n numbers, the largest demands; a row that is null is not computed. reference: for peaks, velocity and
 * acceleration of the reference. */
PRETOUCH_API void pretouch_series_contacts(const pretouch_column *inputs, const pretouch_column *reference, int64_t n,
                                           const pretouch_curves *curves, double horizon, double *out,
                                           double *gradients, double *const *peaks, int8_t *status);

/* ---- approaches under the virtual drag (lanes_drag.cpp) ----
 * inputs: k = phi / M, a_o, l, l'^2 and t at the start, where k, l and l'^2 are not negative. For peaks also the
 * obstacle's position relative to the robot's start, its velocity and its acceleration at t = 0. Shape (n) each.
 *
 * Outputs that are always computed:
 * rows, shape (n, 6): t, l, l'^2 and g at the end, 2 k int g^2 dl, and the estimated relative error of the duration.
 * status: values of ContactStatus. cells: the number of intervals of each approach.
 *
 * Outputs that are computed if they are not null and the approach is not unresolved:
 * peaks, shape (n, 7): the largest k g^2 l'^2 and its distance, the smallest one; the largest and the smallest velocity
 * and the largest and the smallest travel of the robot.
 * gradients, shape (n, 2, 5): derivatives of l'^2 and t at the end by k, a_o, l and l'^2 at the start, and by the
 * parameter of `changes`.
 * nodes: distances of the 16 quadrature points of each interval.
 * balance, shape (n, 2): k int s' ds and its moment.
 * trace, shape (n, m, 2): l and |l'| at ascending times, shape (n, m), that lie in the approach.
 *
 * first: index of the first interval of each approach, for the arrays with values at the nodes. These are nodes,
 * changes (dg/d(parameter), for gradients) and log_outputs (ln xi, for balance). It is null if none of them is used. */
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

/* ---- encounters under the virtual drag whose obstacle has a course (lanes_drag_course.hpp) ----
 * values, curve, rows, status, times, trace and sections are those of pretouch_solve_series. drags: phi, shape (n).
 * impulses, shape (n): the time integral of the admittance's force. steps, shape (n): the number of steps with a drag.
 * nodes, if not null: weight [s], l and l' at 16 Gauss points of each of these steps. first: the index of the first of
 * these steps of each encounter. */
typedef struct {
    double *rows;
    int64_t *status;
    double *impulses;
    int64_t *steps;
    const int64_t *first;
    double *nodes;
    const double *times;
    int64_t m;
    double *trace;
    const double *sections;
    int64_t section_count;
} pretouch_drag_courses;

PRETOUCH_API void pretouch_solve_drag_courses(const double *values, int64_t n, const double *drags,
                                              const pretouch_pieces *curve, double horizon,
                                              const pretouch_drag_courses *wanted);

/* ---- designs (lanes_design.cpp) ---- */
/* Finds the optimal gain of each encounter.
 * inputs: the columns of `values` above, shape (10, n).
 * slope: g at l = 0. curves and pieces: the sensor curve; both are null if g is constant, and then the distances from
 * `nearest` to `farthest` are valid. falling: whether g < 0 at all distances that an encounter may reach.
 * terms: terms factor * |quantity|^exponent of the objective, shape (k, 4): quantity, factor in SI units, exponent, and
 * 1 if the term is divided by the obstacle's squared speed, else 0. Quantities at contact: 0 time, 1 displacement, 2
 * velocity, 3 acceleration, 4 relative velocity, 5 virtual force. Largest values: 6 excursion, 7 travel, 8 speed, 9
 * acceleration, 10 virtual force.
 * limits: at most 16 rows of quantity, factor and exponent, for factor * |quantity|^exponent <= 1.
 * Searched gains are scale * sinh(u), with u from weak to strong, within [low, high].
 * out, shape (3, n): optimal gain, its objective, and 1 if both are certain, 2 if no gain meets the limits, else 0. */
PRETOUCH_API void pretouch_find_gains(const double *inputs, int64_t n, double slope, const pretouch_curves *curves,
                                      const pretouch_pieces *pieces, double nearest, double farthest, int falling,
                                      double horizon, const double *terms, int64_t k, const double *limits,
                                      int64_t limit_count, double scale, double strong, double weak, double low,
                                      double high, double *out);
/* Evaluates Chebyshev series at n places in [low, high]. coefficients: shape (rows, m); out: shape (rows, n). */
PRETOUCH_API void pretouch_interpolate(const double *place, int64_t n, double low, double high,
                                       const double *coefficients, int64_t m, int64_t rows, double *out);

/* ---- the sampled loop (loop*.cpp) ---- */
/* The plant m x'' = f - friction(x') - F_contact. The drive force f follows the command k (x_v - x) + d_v x_v' - d_x x'
 * + m_f x_v'' as a first-order lag with the servo's rate [1/s]. A mass of 0 means an ideal plant, a servo rate of 0 no
 * lag. */
typedef struct {
    double mass, stiffness, reference_damping, own_damping, feedforward_mass, servo_rate, coulomb_friction;
    double friction_speed;
} pretouch_plant;

/* A linear plant with the states x, x' and z, where `hidden` is the number of states z. It replaces all coefficients of
 * pretouch_plant except for the mass. rows: x'' and z' as linear functions of (x, x', z, x_v, x_v', x_v'', force on the
 * plant), shape (1 + hidden, 6 + hidden); null if there is no such plant. starts: initial z as linear functions of
 * initial (x, x'), shape (hidden, 2). */
enum { PRETOUCH_MOST_HIDDEN = 30 };
typedef struct {
    const double *rows, *starts;
    int64_t hidden;
} pretouch_state_space;

/* The contact force k d^n + c d' at the depth d, or k d^n + c d^n d' if `grows` is not 0. inverse_mass: 1 / mass of the
 * obstacle, 0 if its motion is prescribed. */
typedef struct {
    double stiffness, damping, exponent, grows, inverse_mass;
} pretouch_contact;

/* A disturbance of the readings, as Disturbance in simulation/disturbance.py: what happens, from a time [s] or from the
 * first sample at a distance [m] of at most `distance` on, and for how long [s]. factor: of the signal xi. */
enum { PRETOUCH_MOST_DISTURBANCES = 8 };
enum { PRETOUCH_CABLE = 1, PRETOUCH_REFLECTANCE, PRETOUCH_OBJECT_LEAVES, PRETOUCH_FULL_SCALE, PRETOUCH_STUCK };
typedef struct {
    double kind, time, distance, duration, factor;
} pretouch_disturbance;

/* The fields of SensorChain in simulation/chain.py; `offset` is the sum of its offset and crosstalk. Flags are true if
 * they are not 0. */
typedef struct {
    double rate, phase, exposure, delay, jitter, noise, relative_noise, offset, drift, lowest, highest, resolution;
    double dropout, measures_distance, distance_noise, distance_resolution, random_phase, misfit, misfit_length;
    pretouch_disturbance disturbances[PRETOUCH_MOST_DISTURBANCES]; /* the first one of the kind 0 ends the list */
} pretouch_chain;

/* table, shape (rows, 2): ln xi and its slope times `step`, at distances from `low` on, `step` apart. Beyond `high`, xi
 * is 0. */
typedef struct {
    const double *table;
    int64_t rows;
    double low, step, high;
} pretouch_curve;

/* A law: its step function, and arrays of parameters and initial states. Their sizes are in bytes, multiples of 8.
 * law_of and start_of: index of the parameters and of the initial state of each encounter. */
typedef struct {
    pretouch_law_step *step;
    const char *parameters;
    const char *states;
    int64_t parameters_size, state_size;
    const int64_t *law_of, *start_of;
} pretouch_laws;

/* Start of an encounter: position and velocity of the plant; position, velocity and acceleration of obstacle and
 * reference. */
typedef struct {
    double x, v, xo, vo, ao, xd, vd, ad;
} pretouch_scene;

/* Acceleration of the obstacle until a time, in place of the acceleration in pretouch_scene. */
typedef struct {
    double until, acceleration;
} pretouch_stretch;

/* A reading in transit: its value, when it becomes available, when it was measured [s], and 1 if it says that a sensor of
 * distances sees no object, otherwise 0. */
typedef struct {
    double value, ready, taken, no_object;
} pretouch_reading;

/* Output rows: RESULT_COLUMNS, CONTACT_COLUMNS, TRACE_COLUMNS and COURSE_COLUMNS of simulation/native_loop.py. */
typedef struct {
    double status, time, position, velocity, displacement, relative_velocity, closest_distance, largest_excursion;
    double largest_travel, largest_speed, largest_virtual_force, peak_force, impulse, rebound_velocity, contacts;
    double detection_time, flags, end_time, impact_force, distance, acceleration, virtual_force, largest_acceleration;
    double largest_advance;
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

/* All encounters of a loop. trace and course may have 0 rows. Each encounter that is run overwrites them, so they are
 * useful for a single one. */
typedef struct {
    pretouch_laws laws;
    pretouch_plant plant;
    pretouch_contact contact;
    pretouch_chain chain;
    const pretouch_curve *curves;
    const int64_t *curve_of;
    /* controller's period, longest step of the plant, longest wait for a contact, time simulated after a contact [s] */
    double period, plant_step, horizon, follow_time;
    uint64_t seed;
    const pretouch_scene *scenes;
    const int64_t *draws; /* number of the noise realization of each encounter */
    pretouch_end *ends;
    pretouch_touch *touches; /* most_touches rows for each encounter */
    int64_t most_touches;
    pretouch_instant *trace;
    int64_t trace_rows;
    pretouch_moment *course;
    int64_t course_rows;
    const pretouch_stretch *stretches; /* stretches_each rows per scene, by time; then its acceleration holds */
    int64_t stretches_each;
    pretouch_state_space linear;
} pretouch_loop;

/* Runs the encounters with the indices `which`, several at once in vector lanes if the law is the virtual damper.
 * state: memory for eight states of the law. waiting: memory for 8 `room` readings, where `room` is a power of two that
 * exceeds the number of readings in transit. */
PRETOUCH_API void pretouch_run_encounters(const pretouch_loop *loop, const int64_t *which, int64_t n, void *state,
                                          pretouch_reading *waiting, int64_t room);

/* Calls the step of a law for n successive samples. */
PRETOUCH_API void pretouch_run_law(pretouch_law_step *step, const void *parameters, void *state,
                                   const pretouch_sample *samples, int64_t n, pretouch_output *out);

/* For a contact that starts with a relative speed [m/s]: a step size that resolves it, and its duration without damping
 * and external forces [s]. inverse_mass: 1 / the reduced mass of both bodies [1/kg]. */
PRETOUCH_API double pretouch_contact_step(const pretouch_contact *contact, double inverse_mass, double speed);
PRETOUCH_API double pretouch_elastic_duration(const pretouch_contact *contact, double inverse_mass, double speed);
/* The sensor chain of one run, for robots that are simulated elsewhere. `sensor`: memory of the caller with
 * pretouch_sensor_size() bytes, aligned to 8. chain, curve and waiting (`room` rows, a power of two) must live as long.
 *
 * pretouch_sensor_start starts a sensor at a distance [m] at t = 0. pretouch_sensor_next returns the time at which the
 * sensor samples the distance next [s], and pretouch_sensor_look passes that distance to it. pretouch_sensor_deliver
 * writes the newest reading that is available at t, and when it was measured [s]. It returns
 * PRETOUCH_READING if the reading is new, PRETOUCH_NO_OBJECT if the sensor measures distances and newly sees no object;
 * otherwise it writes the previous reading and returns PRETOUCH_NOTHING. */
PRETOUCH_API int64_t pretouch_sensor_size(void);
PRETOUCH_API void pretouch_sensor_start(void *sensor, const pretouch_chain *chain, const pretouch_curve *curve,
                                        uint64_t seed, int64_t run, pretouch_reading *waiting, int64_t room,
                                        double distance);
PRETOUCH_API double pretouch_sensor_next(const void *sensor);
PRETOUCH_API void pretouch_sensor_look(void *sensor, double distance);
PRETOUCH_API int64_t pretouch_sensor_deliver(void *sensor, double t, double *reading, double *measured);
/* ---- robots in MuJoCo (robot_sight.cpp, robot_loop.cpp) ----
 * The functions of the MuJoCo library that Python has loaded, by their addresses: this library neither includes
 * MuJoCo's headers nor links to it. Models and data are MuJoCo's, and only its functions read them, except for the
 * arrays and numbers below, whose addresses Python passes. set_log_handler may be null. */
typedef void pretouch_log_handler(const void *message);
typedef struct {
    void (*step1)(const void *model, void *data);
    void (*step2)(const void *model, void *data);
    void (*kinematics)(const void *model, void *data);
    void (*com_pos)(const void *model, void *data);
    void (*subtree_vel)(const void *model, void *data);
    void (*mul_m)(const void *model, const void *data, double *result, const double *vector);
    void (*mul_jac_t)(const void *model, const void *data, double *result, const double *vector);
    void (*jac)(const void *model, const void *data, double *positions, double *rotations, const double *point,
                int body);
    void (*contact_force)(const void *model, const void *data, int contact, double *wrench);
    double (*ray)(const void *model, const void *data, const double *point, const double *ray, const uint8_t *groups,
                  uint8_t with_static, int body, int *geom, double *normal);
    void (*multi_ray)(const void *model, void *data, const double *point, const double *rays, const uint8_t *groups,
                      uint8_t with_static, int body, int *geoms, double *distances, double *normals, int count,
                      double cutoff);
    pretouch_log_handler *(*set_log_handler)(pretouch_log_handler *handler);
} pretouch_engine;

/* The beam of a sensor at a site, see Sight in robots/sight.py. rays: unit vectors in the frame of the site, the axis
 * first, shape (count, 3); cosines: of their angles to the axis. own: by geom, whether it belongs to the robot. curve:
 * may be null if only the axis is used. first_slope: d ln xi / dl at the lowest distance of the curve. scratch: memory
 * for 7 `count` numbers and `count` integers. */
typedef struct {
    const pretouch_engine *engine;
    const void *model;
    const double *rays, *cosines;
    const uint8_t *own;
    const pretouch_curve *curve;
    double *scratch;
    int32_t *geoms;
    int32_t count, body;
    double farthest, behind, flush, lowest, first_slope;
} pretouch_sight;

/* The first object on the axis: its distance from the contact surface [m], infinite without one; geom, and normal. */
typedef struct {
    double distance, normal[3];
    int64_t geom;
} pretouch_glance;

/* point, frame: position and orientation of the site, shape (3,) and (3, 3). */
PRETOUCH_API void pretouch_sight_glance(const pretouch_sight *sight, void *data, const double *point,
                                        const double *frame, pretouch_glance *glance);

/* Returns the distance [m] at which a plane that faces the sensor causes the same output as the scene; infinite if
 * nothing is visible. */
PRETOUCH_API double pretouch_sight_distance(const pretouch_sight *sight, void *data, const double *point,
                                            const double *frame);

/* One sensor site in a run: its sensor, its law and its results so far.
 * surface: by geom, 1 for the contact surface of the site and 2 for another geom of the same rigid body.
 * obstacle: what stopped the reference before the contact, values of PRETOUCH_OBSTACLES in robots/compiled_run.py.
 * target: position and velocity of the reference at the start and at the end of the period. */
typedef struct {
    const pretouch_sight *sight;
    const uint8_t *surface;
    pretouch_law_step *step;
    const void *parameters;
    void *law, *sensor;
    int64_t index;
    double approach, hand;
    pretouch_glance glance;
    double target[4], force, peak, impulse, excursion, time, speed, saturated;
    int64_t obstacle, detected;
    pretouch_output output;
} pretouch_robot_site;

/* The largest force and the first instant of all contacts between a body of the robot and another body at a site, -1
 * for none. total: force of the current step. */
typedef struct {
    int32_t body, other, site, current;
    double time, speed, peak, total[3];
} pretouch_robot_touch;

/* The joint motion as a function of the positions of the sites along their axes: the last anchor, and for a single
 * site the rows of all known anchors, from the position `first` times the spacing on. A row has the fields joints,
 * motions, turn, direction and points in this order, preceded by 1 if it is known. n joints, m sites. blocked: sign of
 * the motion of a single site along which no further anchor exists, 0 for none. ends: whether a joint that follows the
 * others is then at the end of its range. */
typedef struct {
    double *joints, *motions, *turn, *direction, *points, *inside;
    const double *ranges;
    double spacing, blocked, *table;
    int64_t rows, first, ends;
} pretouch_robot_path;

/* Torques of the joints: scale ((inertia (c_a q_r'' + c_v q_r' - c_d q' + c_p (q_r - q)) + load). The controller of the
 * joints takes a reference every `interval` seconds, 0 for every step, and follows it from `delay` seconds later on. */
typedef struct {
    double acceleration, velocity, damping, stiffness, scale, interval, delay;
} pretouch_joint_feedback;

/* Why a run stops, to be continued by another call. */
enum {
    PRETOUCH_RUN_ENDED = 0,     /* it is over */
    PRETOUCH_RUN_DETECTED = 1,  /* sites with `detected` 1 have detected an object; Python sets 2 */
    PRETOUCH_RUN_ANCHOR = 2,    /* the joint path needs an anchor at `motion` */
    PRETOUCH_RUN_TORQUES = 3,   /* Python writes `wanted` for the reference in `reference` */
    PRETOUCH_RUN_TOUCHED = 4,   /* bits of `touched`: sites that have been touched in the last step */
    PRETOUCH_RUN_ROWS = 5,      /* the time series is full; Python sets row_count to 0 */
    PRETOUCH_RUN_FAILED = 6     /* MuJoCo has stopped with an error; its message is in `message` */
};

/* One run of a robot in MuJoCo. All arrays keep their addresses during the run.
 * qpos to subtree_velocity: arrays of the data. contacts: list of the contacts, `contact_size` bytes each, with the
 * offsets of the fields in contact_fields: geom, flex, pos, frame. support: sorted pairs of bodies low * bodies + high
 * that touch at the start. own, moving, still: by body, see touches.py. flex_body: a body of each flex.
 * driven, base: indices of degrees of freedom. places: of the driven joints in qpos. highest: torques, shape (n, 2).
 * motion: positions, velocities, accelerations of the sites, shape (3, m). reference: the same of the joints, shape
 * (3, n). scratch: memory for 4 nv + (base + 1) base numbers.
 * equality_count, constraint_count: numbers of the data. equality: memory for most_equalities rows of nv numbers, and
 * for as many of base numbers and 2 base base + 3 base; selected: memory for most_constraints numbers, which are 0.
 * unseen: distance that the sensor gets if it sees nothing [m].
 * setpoints: references on their way to the controller of the joints, a ring of most_setpoints rows of a time and a
 * reference, shape (1 + 3 n); null if every reference acts at once.
 * rows: time series; a row has the time, distances, references and forces of the sites, torques, and qpos. */
typedef struct {
    const pretouch_engine *engine;
    const void *model;
    void *data;
    double *qpos, *qvel, *applied;
    const double *bias, *passive, *site_points, *site_frames, *subtree_velocity;
    const int32_t *contact_count, *equality_count, *constraint_count;
    const char *contacts;
    int64_t contact_size, contact_fields[4];
    int64_t nq, nv, bodies;
    const int32_t *geom_body, *flex_body, *body_root, *body_tree;
    const uint8_t *own, *moving, *still;
    const int64_t *support;
    int64_t support_count;
    pretouch_robot_site *sites;
    int64_t site_count;
    pretouch_robot_path path;
    pretouch_joint_feedback feedback;
    const int64_t *driven, *base, *places;
    int64_t driven_count, base_count;
    const double *highest;
    double *motion, *reference, *wanted, *torques, *scratch;
    double *equality, *selected;
    int64_t most_equalities, most_constraints;
    double *setpoints;
    int64_t most_setpoints, setpoint_head, setpoint_tail;
    pretouch_robot_touch *touches;
    int64_t most_touches, touch_count;
    double *rows;
    int64_t most_rows, row_count;
    double period, time_step, follow_time, longest, patience, resting, unseen;
    int64_t steps, periods, floats, returns, ask_torques;
    /* law of a hand: sites -1 for none; ln of the ratio of floors; gain; share per period; position, velocity, target */
    int64_t hand_first, hand_second;
    double hand_floors, hand_gain, hand_share, hand_position, hand_velocity, hand_target[4];
    /* state */
    int64_t phase, number, sub_step, anchored, touched, passed;
    double now, last_contact, first, last, summit, force, peak, pair_direction[3];
    int64_t pair_body, pair_other;
    char message[256];
} pretouch_robot_run;

/* Continues a run until it needs Python or is over, and returns why. */
PRETOUCH_API int64_t pretouch_run_robot(pretouch_robot_run *run);

/* The dynamics of a robot in a posture, reduced to its driven joints (robot_dynamics.cpp), see PostureDynamics in
 * robots/dynamics.py. mass, jacobian, constraints: of all nv degrees of freedom, shapes (nv, nv), (6, nv), (rows, nv).
 * degrees: those of the base, then those of the joints. result: mass and Jacobian of these degrees, inertia, own and
 * relative Jacobian, motion, forced, the columns of loose as rows, and coupling, one after the other. counts: numbers of
 * columns of loose and of rows of coupling. Returns 0, -2 if a mass matrix is not positive definite, or -3 without
 * memory. */
PRETOUCH_API int64_t pretouch_robot_posture_reduce(const double *mass, const double *jacobian,
                                                   const double *constraints, const int64_t *degrees, int64_t nv,
                                                   int64_t base, int64_t joints, int64_t rows, double *result,
                                                   int64_t *counts);

/* Finds the motions with the least kinetic energy along some rows of a Jacobian, see least_energy in
 * robots/dynamics.py. motions: shape (joints, motion_count). others: memory for joints^2 numbers, or null. Returns the
 * number of other motions, -1 if there is no motion, or as above. */
PRETOUCH_API int64_t pretouch_robot_least_energy(const double *rows, int64_t row_count, const int64_t *driven,
                                                 int64_t motion_count, const double *inertia, int64_t joints,
                                                 double *motions, double *others);

/* Finds the motion of the joints along the first row, see AxisMotion in robots/dynamics.py. posture: the result of
 * pretouch_robot_posture_reduce. couplings: number of the last rows that couple joints. locked: by joint. motion: the
 * joint velocities, then moved mass, recoil share, conditioning, turning and sideways. Returns as
 * pretouch_robot_least_energy. */
PRETOUCH_API int64_t pretouch_robot_axis_motion(double *posture, int64_t base, int64_t joints, const double *axis,
                                                const double *rows, int64_t row_count, int64_t couplings,
                                                const uint8_t *locked, double *motion);

/* The cubic Hermite polynomial over a step, with derivatives by s as slopes: returns its value at s, 0 to 1, and writes
 * its slope there. */
PRETOUCH_API double pretouch_cubic(double start, double start_slope, double end, double end_slope, double s,
                                   double *slope);
/* Returns the part of a step at which this cubic first touches zero, 2 if it does not. A minimum of at most `doubt`
 * counts as a touch. least: output, its smallest value. */
PRETOUCH_API double pretouch_first_touch(double start, double start_slope, double end, double end_slope, double doubt,
                                         double *least);


/* ---- calibration: curves that fit readings (curve_fits.cpp, mittag_leffler.cpp) ----
 * The Mittag-Leffler function and its derivative at z <= 0: one order in (0, 1] for each row of z, shape (count, n). */
PRETOUCH_API void pretouch_mittag_leffler(const double *orders, int64_t count, const double *z, int64_t n,
                                          double accuracy, double *value, double *slope);

/* Residuals of several parameters x, shape (rows, p), each in the least-squares problem with the index `problem`:
 * residuals, output, shape (rows, n). */
typedef void (*pretouch_residuals)(const double *x, const int64_t *problem, int64_t rows, double *residuals);

/* Least-squares problems of one kind.
 *
 * Curves of a family (FAMILIES in calibration/curve_residuals.py) that are fitted to n readings have the residuals
 * (asinh((y - o) / width) - asinh(xi / width)) / error. The offset o is given for each problem, or is the last
 * parameter if `offsets` is null. A ceiling C turns the ideal output u into xi = u / (1 + (u / C)^p)^(1/p); `above` is
 * ln(C / (largest y - o)), infinite for none, and `sharpness` is p, one number for each problem. Both may be null.
 * Arrays with a step have the row problem * step; step 0 means one row for all.
 *
 * For other residuals, `function` is not null; then only p, n and `pulls` count. `pulls`, shape (problems, 3), adds a
 * residual stiffness * (q_k - target) with k, stiffness and target; q are the coordinates of the family and ln -g in
 * the middle of the window. It may be null. */
typedef struct {
    int64_t parameters, points;
    pretouch_residuals function;
    int64_t family;
    double first, last; /* ends of the window [m] */
    const double *distances, *outputs, *widths, *errors; /* shape (n) */
    const double *offsets, *weights; /* shapes (problems) and (problems, n); weights null if all are 1 */
    int64_t offset_step, weight_step;
    const double *above, *sharpness, *pulls;
} pretouch_fit;

/* Size of the workspace of both functions below, in numbers. */
PRETOUCH_API int64_t pretouch_fit_room(const pretouch_fit *fit);

/* Residuals of parameters x, shape (rows, p): residuals, shape (rows, n), or n + 1 with `pulls`. */
PRETOUCH_API void pretouch_fit_residuals(const pretouch_fit *fit, const double *x, const int64_t *problem, int64_t rows,
                                         double *residuals, double *workspace);

/* Minimizes the sums of squares by the Levenberg-Marquardt method, each from its start x, shape (rows, p), between
 * bounds, whose rows are `bound_step` numbers apart. A sum of squares has converged if its relative change is below
 * `tolerance`, or the parameters change by less. x: start and solution. residuals: output. jacobian: output,
 * derivatives of the residuals, shape (rows, n, p); 0 for a parameter that stays at a bound. costs: output, the sums of
 * squares. */
PRETOUCH_API void pretouch_minimize(const pretouch_fit *fit, const int64_t *problem, int64_t rows, const double *low,
                                    const double *high, int64_t bound_step, double tolerance, int64_t most, double *x,
                                    double *residuals, double *jacobian, double *costs, double *workspace);

#ifdef __cplusplus
}
#endif

#endif
