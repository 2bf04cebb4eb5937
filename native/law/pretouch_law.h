/* The sampled controller of the letter's Fig. 1: from the readings of a proximity sensor to a reference for the robot's
 * own controller, once per period T. What is simulated and tested is this source, and a robot can run it as it is: C99,
 * no allocation, no globals, no libm beyond log, sqrt, fabs and floor. docs/control.md says what each block does and
 * why; its table names them in the same order.
 *
 *            reading                             contact force, reference
 *               |                                          |
 *     pretouch_observe --d ln xi--> pretouch_damp --D_p d ln xi--> pretouch_drive --> x_v, x_v', x_v''
 *     valid? offset, floor,         L(2): impulse                  delivery, L(1), limits
 *     median, low-pass, logarithm
 *
 * pretouch_drag stands in the place of pretouch_damp where the law is the virtual drag.
 *
 * Quantities are SI, xi in the unit of the readings, signs as in the letter: x points away from the sensor, a gain that
 * mitigates is negative. Numbers are double, or float where PRETOUCH_FLOAT is defined. Parameters are made by
 * pretouch.control.Controller, which designs the filter, discretizes the admittance and checks them: nothing is checked
 * here. Samples may be anything, also NaN. */

#ifndef PRETOUCH_LAW_H
#define PRETOUCH_LAW_H

#include <stdint.h>

#ifndef PRETOUCH_API
#if defined(_WIN32)
#define PRETOUCH_API __declspec(dllexport)
#elif defined(__GNUC__)
#define PRETOUCH_API __attribute__((visibility("default")))
#else
#define PRETOUCH_API
#endif
#endif

#ifdef __cplusplus
extern "C" {
#endif

#ifdef PRETOUCH_FLOAT
typedef float pretouch_real;
#else
typedef double pretouch_real;
#endif

enum { PRETOUCH_MEDIAN = 16, PRETOUCH_SECTIONS = 4 };

/* What a step met: flags, added; see pretouch.control.Status. */
enum {
    PRETOUCH_DETECTING = 1,
    PRETOUCH_STALE = 2,
    PRETOUCH_SATURATED = 4,
    PRETOUCH_INVALID = 8,
    PRETOUCH_IMPLAUSIBLE = 16,
    PRETOUCH_LOST = 32,
    PRETOUCH_FORCE_LIMITED = 64,
    PRETOUCH_MOTION_LIMITED = 128,
    PRETOUCH_IN_CONTACT = 256,
    PRETOUCH_INPUT_FAULT = 512
};

/* What is known at the start t_k of a period. */
typedef struct {
    pretouch_real reading;                /* raw output of the sensor */
    pretouch_real age;                    /* how long ago it was measured [s] */
    pretouch_real contact_force;          /* of the object on the plant along x [N] */
    pretouch_real reference_position;     /* x_d [m] */
    pretouch_real reference_velocity;     /* x_d' [m/s] */
    pretouch_real reference_acceleration; /* x_d'' [m/s^2], constant over the period */
    int32_t fresh;                        /* whether the reading came since the step before */
} pretouch_sample;

/* What the robot is to do over the period from t_k to t_k + T. */
typedef struct {
    pretouch_real position;      /* x_v at t_k + T [m] */
    pretouch_real velocity;      /* x_v' at t_k + T [m/s] */
    pretouch_real acceleration;  /* x_v'' [m/s^2], its mean over the period */
    pretouch_real virtual_force; /* F_p [N], after its limit */
    pretouch_real log_level;     /* ln(xi / floor) after the filters */
    int32_t status;              /* flags */
} pretouch_output;

/* ---- from a reading to the change of ln xi ---- */

/* b_0 + b_1/z + b_2/z^2 over 1 + a_1/z + a_2/z^2 */
typedef struct {
    pretouch_real b0, b1, b2, a1, a2;
} pretouch_section;

typedef struct {
    pretouch_real period;        /* T of the loop [s] */
    pretouch_real sensor_period; /* nominal time between two readings [s] */
    pretouch_real offset;        /* output without an object */
    pretouch_real floor;         /* what is below, after the offset, is nothing, > 0 */
    pretouch_real saturation;    /* from this raw reading on the sensor is saturated */
    pretouch_real timeout;       /* without a usable reading for so long, the sensor is lost [s] */
    pretouch_real largest_rate;  /* largest |d ln xi/dt| that can be [1/s] */
    int32_t median_length;       /* readings of the running median, 1 to PRETOUCH_MEDIAN */
    int32_t sections;            /* of the low-pass, 0 to PRETOUCH_SECTIONS */
    pretouch_section low_pass[PRETOUCH_SECTIONS];
} pretouch_sensing_numbers;

/* The last readings: by arrival, `oldest` the place of the next one, and in order, followed by infinities. */
typedef struct {
    pretouch_real arrived[PRETOUCH_MEDIAN], ordered[PRETOUCH_MEDIAN + 1];
    int32_t oldest;
} pretouch_median_state;

typedef struct {
    pretouch_real quiet;                         /* time since the last usable reading came [s] */
    pretouch_real measured;                      /* time since it was measured [s] */
    pretouch_real level;                         /* xi of it, before the filters */
    pretouch_real filtered;                      /* and after them, at least the floor */
    pretouch_real log_level;                     /* ln(filtered / floor) */
    pretouch_real low_pass[PRETOUCH_SECTIONS][2]; /* states of the sections */
    pretouch_median_state median;
    int32_t running; /* whether there was a usable reading, and the sensor was not lost since */
} pretouch_sensing_state;

/* What a law is told about the sensor. */
typedef struct {
    pretouch_real change;    /* of ln xi since the usable reading before; 0 where there is none */
    pretouch_real log_level; /* ln(xi / floor) >= 0, after the filters */
    pretouch_real level;     /* xi itself, after the filters, at least the floor */
    pretouch_real elapsed;   /* time in which ln xi changed by `change` [s]: between the two readings; 0 where none */
    int32_t usable;          /* a reading came that can be used */
    int32_t restarted;       /* it is the first one, or the first one after the sensor was lost */
    int32_t detecting;       /* xi is above the floor, and the sensor is not lost */
    int32_t stale;           /* a reading is due and has not come */
    int32_t lost;            /* none has come for longer than the timeout */
    int32_t status;          /* flags */
} pretouch_observation;

/* ---- the letter's law: a virtual damper, L(2) ---- */

typedef struct {
    pretouch_real gain;      /* D_p [N s] */
    pretouch_real release;   /* by how much ln xi must fall before a rise counts anew, for approaches alone */
    pretouch_real ramp_step; /* by how much the share of the gain in force rises per period */
    int32_t approach_only;   /* whether approaches alone are damped */
} pretouch_damper_numbers;

typedef struct {
    pretouch_real ramp; /* share of the gain in force, 0 to 1 */
    pretouch_real mark; /* what ln xi has to exceed, for approaches alone */
} pretouch_damper_state;

/* ---- the virtual drag: F = -phi |s'| s' for s = ln xi, against approaches alone ---- */

typedef struct {
    pretouch_real drag;                 /* phi [N s^2] */
    pretouch_real variance;             /* of the part of a reading's noise that does not grow with xi [its unit^2] */
    pretouch_real relative_variance;    /* of the part that does */
    pretouch_real level_share;          /* of what a reading misses the expected ln xi by, that goes to its level */
    pretouch_real rate_share;           /* and to its rate */
    pretouch_real width;                /* of the dead zone of ln xi, of the deviation of a reading's ln xi */
    pretouch_real still;                /* rate that counts as none, of the same [1/s] */
    pretouch_real sensor_period;        /* nominal time between two readings [s] */
    pretouch_real hold;                 /* how long an approach lasts after ln xi rose last [s] */
    pretouch_real own_advance;          /* D_b <= 0: gain against the robot's own advance [N s] */
    pretouch_real known_acceleration;   /* of the object [m/s^2] */
    pretouch_real period;               /* T of the loop [s] */
    pretouch_real mass, damping, stiffness; /* of the admittance */
} pretouch_drag_numbers;

typedef struct {
    pretouch_real level, rate; /* of ln(xi / floor), smoothed: without lag behind a steady approach [1, 1/s] */
    pretouch_real mark;        /* what the level has to exceed */
    pretouch_real hold;        /* how long the approach lasts yet [s] */
} pretouch_drag_state;

/* What a law gives: an impulse for a new reading [N s], delivered over one sensor period, and a force now [N]. */
typedef struct {
    pretouch_real impulse, force;
} pretouch_push;

/* ---- from the impulse to the motion ---- */

/* L(1) over one period under a constant force, exactly: rows of the transition matrix, and the input vector. */
typedef struct {
    pretouch_real position_from_position, position_from_velocity;
    pretouch_real velocity_from_position, velocity_from_velocity;
    pretouch_real position_from_force, velocity_from_force;
} pretouch_admittance_numbers;

/* Largest |x~'| [m/s], |x~''| [m/s^2] and |x~| [m]. */
typedef struct {
    pretouch_real period, speed, acceleration, excursion;
} pretouch_motion_limits;

typedef struct {
    pretouch_real hold;              /* one sensor period [s]: in which an impulse is delivered */
    pretouch_real fade_step;         /* by how much the force of a late reading fades per period */
    pretouch_real largest_force;     /* |F_p| [N] */
    pretouch_real contact_gain;      /* share of the contact force that acts in the admittance */
    pretouch_real contact_threshold; /* contact force [N] from which a contact is reported */
    pretouch_admittance_numbers admittance;
    pretouch_motion_limits limits;
} pretouch_drive_numbers;

/* An impulse on its way: constant force [N], rest of the impulse [N s], what was given ahead [N s], fading. */
typedef struct {
    pretouch_real steady, rest, ahead, fading;
} pretouch_delivery;

/* The virtual object relative to the reference: x~ [m] and x~' [m/s]. */
typedef struct {
    pretouch_real position, velocity;
} pretouch_motion;

typedef struct {
    pretouch_delivery delivery;
    pretouch_motion motion;
    pretouch_real reference; /* x_d of the last step with a reference [m] */
} pretouch_drive_state;

/* ---- the controller ---- */

typedef struct {
    pretouch_sensing_numbers sensing;
    pretouch_drive_numbers drive;
    pretouch_damper_numbers law;
} pretouch_parameters;

typedef struct {
    pretouch_sensing_state sensing;
    pretouch_drive_state drive;
    pretouch_damper_state law;
} pretouch_state;

/* The same with the virtual drag. */
typedef struct {
    pretouch_sensing_numbers sensing;
    pretouch_drive_numbers drive;
    pretouch_drag_numbers law;
} pretouch_parameters_drag;

typedef struct {
    pretouch_sensing_state sensing;
    pretouch_drive_state drive;
    pretouch_drag_state law;
} pretouch_state_drag;

/* The state before the first step: nothing detected, no force; x~ [m] and x~' [m/s] of the plant. */
PRETOUCH_API void pretouch_start(const pretouch_parameters *p, pretouch_real position, pretouch_real velocity,
                                 pretouch_state *s);
PRETOUCH_API void pretouch_start_drag(const pretouch_parameters_drag *p, pretouch_real position,
                                      pretouch_real velocity, pretouch_state_drag *s);

/* One period. */
PRETOUCH_API void pretouch_step(const pretouch_parameters *p, pretouch_state *s, const pretouch_sample *sample,
                                pretouch_output *out);

/* The blocks it is made of. A law of your own puts its own between pretouch_observe and pretouch_drive. */
PRETOUCH_API void pretouch_start_sensing(const pretouch_sensing_numbers *p, pretouch_sensing_state *s);
PRETOUCH_API void pretouch_start_drive(pretouch_real position, pretouch_real velocity, pretouch_drive_state *s);
PRETOUCH_API void pretouch_observe(const pretouch_sensing_numbers *p, pretouch_sensing_state *s,
                                   const pretouch_sample *sample, pretouch_observation *seen);
PRETOUCH_API void pretouch_damp(const pretouch_damper_numbers *p, pretouch_damper_state *s,
                                const pretouch_observation *seen, pretouch_push *push);
PRETOUCH_API void pretouch_drag(const pretouch_drag_numbers *p, pretouch_drag_state *s,
                                const pretouch_observation *seen, const pretouch_drive_state *driven,
                                pretouch_push *push);
PRETOUCH_API void pretouch_drive(const pretouch_drive_numbers *p, pretouch_drive_state *s,
                                 const pretouch_observation *seen, const pretouch_push *push,
                                 const pretouch_sample *sample, pretouch_output *out);

/* How any law is called that knows its parameters and its state; pretouch_step, and the drag's step, in that form. */
typedef void pretouch_law_step(const void *parameters, void *state, const pretouch_sample *sample,
                               pretouch_output *out);
PRETOUCH_API void pretouch_step_damper(const void *parameters, void *state, const pretouch_sample *sample,
                                       pretouch_output *out);
PRETOUCH_API void pretouch_step_drag(const void *parameters, void *state, const pretouch_sample *sample,
                                     pretouch_output *out);

#ifdef __cplusplus
}
#endif

#endif
