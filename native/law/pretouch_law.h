/* The sampled controller of the letter's Fig. 1. Once per period T, it computes a reference for the robot's motion
 * controller from the readings of a proximity sensor. Simulations and tests run this source, and a robot can run it
 * unchanged: C99, no allocation, no globals, no libm functions except log, sqrt, fabs and floor.
 * docs/explanation/control.md explains each block; its table lists the blocks in the same order.
 *
 *            reading                             contact force, reference
 *               |                                          |
 *     pretouch_observe --d ln xi--> pretouch_damp --D_p d ln xi--> pretouch_drive --> x_v, x_v', x_v''
 *     valid? offset, floor,         L(2): impulse                  delivery, L(1), limits
 *     median, low-pass, logarithm
 *
 * With the virtual drag, pretouch_drag replaces pretouch_damp.
 *
 * Quantities are in SI units, xi in the unit of the readings. Signs are as in the letter: x points away from the
 * sensor, and mitigating gains are negative. Numbers are double, or float if PRETOUCH_FLOAT is defined. The parameters
 * come from pretouch.control.Controller, which designs the filter, discretizes the admittance and checks all values;
 * this source does not check them. Samples may have any values, including NaN. */

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

/* Status of a step, a sum of flags; see pretouch.control.Status. */
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

/* What the sensor delivered since the last step: nothing, a reading, or the message that it sees no object. Sensors of
 * distances send such messages; see pretouch.control.Arrival. */
enum { PRETOUCH_NOTHING = 0, PRETOUCH_READING = 1, PRETOUCH_NO_OBJECT = 2 };

/* Inputs at the start t_k of a period. */
typedef struct {
    pretouch_real reading;                /* raw output of the sensor; ignored if it sees no object */
    pretouch_real age;                    /* time since it was measured [s] */
    pretouch_real contact_force;          /* of the object on the plant along x [N] */
    pretouch_real reference_position;     /* x_d [m] */
    pretouch_real reference_velocity;     /* x_d' [m/s] */
    pretouch_real reference_acceleration; /* x_d'' [m/s^2], constant over the period */
    int32_t fresh;                        /* what arrived since the last step: 0, PRETOUCH_READING or PRETOUCH_NO_OBJECT */
} pretouch_sample;

/* Reference for the robot's motion controller in the period from t_k to t_k + T. */
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
    pretouch_real floor;         /* detection threshold after the offset is subtracted, > 0 */
    pretouch_real saturation;    /* raw reading from which the sensor is saturated */
    pretouch_real timeout;       /* time without a usable reading after which the sensor is lost [s] */
    pretouch_real largest_rate;  /* largest plausible |d ln xi/dt| [1/s], for at most one sensor period */
    int32_t median_length;       /* readings of the running median, 1 to PRETOUCH_MEDIAN */
    int32_t sections;            /* sections of the low-pass, 0 to PRETOUCH_SECTIONS */
    pretouch_section low_pass[PRETOUCH_SECTIONS]; /* coefficients b0, b1, b2, a1, a2 of each section */
} pretouch_sensing_numbers;

/* The last readings: `arrived` in order of arrival, a ring buffer in which the next reading replaces the one at the
 * index `oldest`; `ordered` in ascending order, followed by infinity. */
typedef struct {
    pretouch_real arrived[PRETOUCH_MEDIAN], ordered[PRETOUCH_MEDIAN + 1];
    int32_t oldest;
} pretouch_median_state;

typedef struct {
    pretouch_real quiet;                         /* time since the last usable reading, or "no object", arrived [s] */
    pretouch_real measured;                      /* time since it was measured [s] */
    pretouch_real level;                         /* its xi before the filters */
    pretouch_real filtered;                      /* its xi after the filters, at least the floor */
    pretouch_real log_level;                     /* ln(filtered / floor) */
    pretouch_real low_pass[PRETOUCH_SECTIONS][2]; /* states of the sections */
    pretouch_median_state median;
    int32_t latest; /* what arrived last and was usable; PRETOUCH_NOTHING at the start and after the sensor was lost */
} pretouch_sensing_state;

/* Conditioned sensor signal on which a law acts. */
typedef struct {
    pretouch_real change;    /* of ln xi since the previous usable reading; 0 if there is none */
    pretouch_real log_level; /* ln(xi / floor) >= 0, after the filters */
    pretouch_real level;     /* xi after the filters, at least the floor */
    pretouch_real elapsed;   /* time between the two readings of `change` [s]; 0 if there is no change */
    int32_t usable;          /* a usable reading arrived */
    int32_t restarted;       /* it is the first one, or the first one after "no object" or after the sensor was lost */
    int32_t no_object;       /* the sensor works and sees no object: the change of ln xi is undefined, thus 0 */
    int32_t detecting;       /* xi is above the floor, and the sensor is not lost */
    int32_t stale;           /* a reading is due and has not arrived */
    int32_t lost;            /* no reading arrived for longer than the timeout */
    int32_t status;          /* flags */
} pretouch_observation;

/* ---- the letter's law: a virtual damper, L(2) ---- */

typedef struct {
    pretouch_real gain;      /* D_p [N s] */
    pretouch_real release;   /* fall of ln xi after which a rise counts as a new approach, for approach_only */
    pretouch_real ramp_step; /* rise of the active share of the gain per period */
    int32_t approach_only;   /* whether the law acts on approaches only */
} pretouch_damper_numbers;

typedef struct {
    pretouch_real ramp; /* active share of the gain, 0 to 1 */
    pretouch_real mark; /* level that ln xi has to exceed, for approach_only */
} pretouch_damper_state;

/* ---- the virtual drag: F = -phi |s'| s' for s = ln xi, during approaches only ---- */

typedef struct {
    pretouch_real drag;                 /* phi [N s^2] */
    pretouch_real variance;             /* variance of the noise of a reading that is independent of xi [its unit^2] */
    pretouch_real relative_variance;    /* variance of the noise in proportion to xi */
    pretouch_real level_share;          /* share of the prediction error of ln xi that corrects the level */
    pretouch_real rate_share;           /* share that corrects the rate, over the time between two readings */
    pretouch_real width;                /* width of the dead zone, in standard deviations of ln xi of a reading */
    pretouch_real still;                /* rate that counts as zero, per standard deviation of ln xi [1/s] */
    pretouch_real sensor_period;        /* nominal time between two readings [s] */
    pretouch_real hold;                 /* how long an approach lasts after the last rise of ln xi [s] */
    pretouch_real own_advance;          /* D_b <= 0: gain against the robot's own motion toward the object [N s] */
    pretouch_real known_acceleration;   /* acceleration of the object [m/s^2] */
    pretouch_real period;               /* T of the loop [s] */
    pretouch_real mass;                 /* M_a of the admittance [kg] */
    pretouch_real damping;              /* D_a of the admittance [N s/m] */
    pretouch_real stiffness;            /* K_a of the admittance [N/m] */
} pretouch_drag_numbers;

typedef struct {
    pretouch_real level, rate; /* smoothed ln(xi / floor) and its rate, without lag in a steady approach [1, 1/s] */
    pretouch_real mark;        /* value that the level has to exceed */
    pretouch_real hold;        /* remaining hold time [s] */
} pretouch_drag_state;

/* Output of a law: the impulse of a new reading [N s], which is delivered over one sensor period, and an additional
 * force in this period [N]. */
typedef struct {
    pretouch_real impulse, force;
} pretouch_push;

/* ---- from the impulse to the motion ---- */

/* Exact discretization of L(1) for a force that is constant during a period: coefficients of x~ and x~' at the end of
 * the period, as linear functions of x~ and x~' at its start and of the force. */
typedef struct {
    pretouch_real position_from_position; /* [1] */
    pretouch_real position_from_velocity; /* [s] */
    pretouch_real velocity_from_position; /* [1/s] */
    pretouch_real velocity_from_velocity; /* [1] */
    pretouch_real position_from_force;    /* [m/N] */
    pretouch_real velocity_from_force;    /* [m/(s N)] */
} pretouch_admittance_numbers;

typedef struct {
    pretouch_real period;       /* T of the loop [s] */
    pretouch_real speed;        /* largest |x~'| [m/s] */
    pretouch_real acceleration; /* largest |x~''| [m/s^2], mean over a period */
    pretouch_real excursion;    /* largest |x~| [m] */
} pretouch_motion_limits;

typedef struct {
    pretouch_real hold;              /* one sensor period [s], in which an impulse is delivered */
    pretouch_real fade_step;         /* share of the force that fades per period when a reading is late */
    pretouch_real largest_force;     /* largest |F_p| [N] */
    pretouch_real contact_gain;      /* share of the contact force that acts in the admittance */
    pretouch_real contact_threshold; /* contact force [N] from which a contact is reported */
    pretouch_admittance_numbers admittance;
    pretouch_motion_limits limits;
} pretouch_drive_numbers;

/* Delivery of an impulse: the constant force [N], the remaining impulse [N s], the impulse that was delivered before
 * its reading [N s], and the factor by which a late force has faded. */
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

/* Parameters and state of the controller with the virtual drag instead of the damper. */
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

/* Sets the state before the first step: nothing detected, no force. position, velocity: x~ [m], x~' [m/s] of the
 * plant. */
PRETOUCH_API void pretouch_start(const pretouch_parameters *p, pretouch_real position, pretouch_real velocity,
                                 pretouch_state *s);
PRETOUCH_API void pretouch_start_drag(const pretouch_parameters_drag *p, pretouch_real position,
                                      pretouch_real velocity, pretouch_state_drag *s);

/* Computes one period of the controller. */
PRETOUCH_API void pretouch_step(const pretouch_parameters *p, pretouch_state *s, const pretouch_sample *sample,
                                pretouch_output *out);

/* The blocks of a step. A custom law calls its block between pretouch_observe and pretouch_drive. */
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

/* Signature of the step of any law, and the steps with damper and drag in this form. */
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
