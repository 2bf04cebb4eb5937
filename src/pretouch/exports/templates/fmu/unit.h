/* One instance of the control law behind the interfaces FMI 2.0 (fmi2.c) and FMI 3.0 (fmi3.c): its variables, its phases
 * and its steps. modelDescription.xml describes the variables. Compile fmi2.c or fmi3.c alone; each includes the law. */
#ifndef PRETOUCH_UNIT_H
#define PRETOUCH_UNIT_H

/* The law is a part of this file, so two units can be linked into one program. */
#if defined(__GNUC__)
#define PRETOUCH_API static __attribute__((unused))
#define UNIT_EXPORT __attribute__((visibility("default")))
#elif defined(_WIN32)
#define PRETOUCH_API static
#define UNIT_EXPORT __declspec(dllexport)
#else
#define PRETOUCH_API static
#define UNIT_EXPORT
#endif

#include "pretouch_design.h"
#include "pretouch_law.c"

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define UNIT_TOKEN "$token"

/* Names of the functions start with the model identifier, as the standard demands of sources that are linked into a
 * program. Define FMI2_OVERRIDE_FUNCTION_PREFIX or FMI3_OVERRIDE_FUNCTION_PREFIX for a shared library. */
#if defined(FMI2_OVERRIDE_FUNCTION_PREFIX) || defined(FMI3_OVERRIDE_FUNCTION_PREFIX)
#define UNIT_FUNCTION(type, name) UNIT_EXPORT type name
#else
#define UNIT_FUNCTION(type, name) UNIT_EXPORT type ${identifier}_##name
#endif

/* The values of the status that FMI 2.0 and 3.0 share. */
enum { UNIT_OK = 0, UNIT_DISCARD = 2, UNIT_ERROR = 3 };

enum { UNIT_INSTANTIATED, UNIT_INITIALIZING, UNIT_STEPPING, UNIT_TERMINATED };

/* All that a step or an importer changes. The state that an importer stores is a copy of this structure. */
typedef struct {
    int phase, has_run;
    double start, time;            /* of the simulation, and of the end of the last step [s] */
    double periods;                /* number of periods of the law that have begun */
    double waiting, age, measured; /* the newest reading that the law has not seen: value, age at a time [s], this time [s] */
    int32_t is_waiting;            /* 0, PRETOUCH_READING or PRETOUCH_NO_OBJECT */
    int32_t no_object;             /* input: whether the sensor sees no object */
    pretouch_parameters$suffix parameters;
    pretouch_design_state state;
    pretouch_sample sample;
    pretouch_output out;
} unit_memory;

typedef struct {
    unit_memory memory;
    char name[128];
    void *environment; /* of the importer, for its messages */
    void (*log)(void); /* the importer's function for messages, or NULL; its type depends on the version of FMI */
} unit;

/* Pass an error message to the importer. Each version of FMI defines it. */
static void unit_log_error(const unit *u, const char *text);

/* Log an error with its reason, and return the status for it. */
static int unit_refuse(const unit *u, const char *format, ...) {
    char text[400];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (u->log != NULL) unit_log_error(u, text);
    return UNIT_ERROR;
}

/* Set all start values. */
static void unit_start(unit *u) {
    memset(&u->memory, 0, sizeof u->memory);
    u->memory.parameters = pretouch_design;
}

/* Return a new instance, or NULL if there is no memory or the token is that of other files. */
static unit *unit_create(const char *name, const char *token, void *environment, void (*log)(void)) {
    unit *const u = calloc(1, sizeof *u);
    if (u == NULL) return NULL;
    u->environment = environment;
    u->log = log;
    snprintf(u->name, sizeof u->name, "%s", name != NULL ? name : "");
    unit_start(u);
    if (token != NULL && strcmp(token, UNIT_TOKEN) == 0) return u;
    unit_refuse(u, "The token of modelDescription.xml is not that of this library; export both again.");
    free(u);
    return NULL;
}

/* Go from one phase to the next. */
static int unit_advance(unit *u, int from, int to) {
    if (u->memory.phase != from) return unit_refuse(u, "This call is not allowed in the current phase of the simulation.");
    if (to == UNIT_STEPPING) pretouch_start$suffix(&u->memory.parameters, 0, 0, &u->memory.state);
    u->memory.phase = to;
    return UNIT_OK;
}

static double *unit_real(unit_memory *m, unsigned int reference) {
    switch (reference) {
$reals
    default: return NULL;
    }
}

static int unit_get_real(unit *u, unsigned int reference, double *value) {
    unit_memory *const m = &u->memory;
    const double *const place = unit_real(m, reference);
    if (place == NULL) return unit_refuse(u, "No real variable has the value reference %u.", reference);
    if (!m->has_run) { /* the robot is at its reference */
        m->out.position = m->sample.reference_position;
        m->out.velocity = m->sample.reference_velocity;
        m->out.acceleration = m->sample.reference_acceleration;
    }
    *value = *place;
    return UNIT_OK;
}

static int unit_set_real(unit *u, unsigned int reference, double value) {
    double *const place = unit_real(&u->memory, reference);
    if (place == NULL || reference == 0 || reference > $number_reference)
        return unit_refuse(u, "No real variable that can be set has the value reference %u.", reference);
    if (reference == $number_reference) {
        const double exported = pretouch_design.law.$number;
        if (u->memory.phase > UNIT_INITIALIZING)
            return unit_refuse(u, "$number: it cannot be changed after the initialization.");
        if (!(fmin(exported, 0) <= value && value <= fmax(exported, 0)))
            return unit_refuse(u, "$number: found %g $number_unit, but this unit allows %g to 0 $number_unit; export again for "
                               "another $number.", value, exported);
    }
    *place = value;
    return UNIT_OK;
}

/* Return the flag `fresh` or `no_object`, or NULL for another value reference. */
static int32_t *unit_boolean(unit *u, unsigned int reference) {
    if (reference == $fresh_reference) return &u->memory.sample.fresh;
    if (reference == $no_object_reference) return &u->memory.no_object;
    unit_refuse(u, "No boolean variable has the value reference %u.", reference);
    return NULL;
}

/* Return the status flags, or NULL for another value reference. */
static const int32_t *unit_integer(unit *u, unsigned int reference) {
    if (reference == $status_reference) return &u->memory.out.status;
    unit_refuse(u, "No integer variable has the value reference %u.", reference);
    return NULL;
}

/* Run all periods of the law that begin in a step [s], at its start at the earliest and before its end. The periods begin
 * at whole multiples of the period after the start of the simulation, whatever steps the importer takes. Inputs hold during
 * a step, but the reference moves on with its constant acceleration. A reading that arrives between two periods waits for
 * the next one and gets older meanwhile; the law sees it once. */
static int unit_step(unit *u, double time, double step) {
    unit_memory *const m = &u->memory;
    const double period = m->parameters.sensing.period;
    if (m->phase != UNIT_STEPPING) return unit_refuse(u, "A step is only possible after the initialization.");
    if (!(isfinite(time) && 0 < step && step <= 1e9 * period))
        return unit_refuse(u, "step: found %.17g s at the time %.17g s, expected more than 0 and at most %g s.", step, time,
                           1e9 * period);
    if (!m->has_run) m->start = m->time = time;
    const double end = time + step, same = fmax(1e-6 * period, 8 * DBL_EPSILON * fmax(fabs(time), fabs(end)));
    if (!(same < period / 4))
        return unit_refuse(u, "time: at %.17g s, a number cannot resolve the control period of %.17g s.", time, period);
    if (!(fabs(time - m->time) <= same))
        return unit_refuse(u, "time: found %.17g s, but the step before ended at %.17g s.", time, m->time);
    pretouch_sample sample = m->sample;
    if (sample.fresh) {
        m->waiting = sample.reading;
        m->age = sample.age;
        m->measured = time;
        m->is_waiting = m->no_object ? PRETOUCH_NO_OBJECT : PRETOUCH_READING;
    }
    for (; m->start + m->periods * period < end - same; m->periods++) {
        const double late = m->start + m->periods * period - time, after = late > same ? late : 0;
        const double waited = m->start + m->periods * period - m->measured;
        sample.fresh = m->is_waiting;
        if (m->is_waiting) {
            sample.reading = m->waiting;
            sample.age = m->age + (waited > same ? waited : 0);
            m->is_waiting = 0;
        }
        sample.reference_position = m->sample.reference_position +
                                    after * (m->sample.reference_velocity + after / 2 * m->sample.reference_acceleration);
        sample.reference_velocity = m->sample.reference_velocity + after * m->sample.reference_acceleration;
        $step(&m->parameters, &m->state, &sample, &m->out);
    }
    m->has_run = 1;
    m->time = end;
    return UNIT_OK;
}

/* ---- the state as a whole ---- */

static int unit_store(const unit *u, void **stored) {
    if (*stored == NULL) *stored = malloc(sizeof u->memory);
    if (*stored == NULL) return unit_refuse(u, "There is no memory for a copy of the state.");
    memcpy(*stored, &u->memory, sizeof u->memory);
    return UNIT_OK;
}

static int unit_restore(unit *u, const void *stored) {
    if (stored == NULL) return unit_refuse(u, "There is no stored state.");
    memcpy(&u->memory, stored, sizeof u->memory);
    return UNIT_OK;
}

static int unit_free(void **stored) {
    if (stored == NULL) return UNIT_OK;
    free(*stored);
    *stored = NULL;
    return UNIT_OK;
}

static int unit_serialize(const unit *u, const void *stored, void *bytes, size_t size) {
    if (stored == NULL || size < sizeof u->memory) return unit_refuse(u, "There is no stored state, or no room for it.");
    memcpy(bytes, stored, sizeof u->memory);
    return UNIT_OK;
}

static int unit_deserialize(const unit *u, const void *bytes, size_t size, void **stored) {
    if (size != sizeof u->memory) return unit_refuse(u, "The stored state has another size than that of this unit.");
    if (unit_store(u, stored) != UNIT_OK) return UNIT_ERROR;
    memcpy(*stored, bytes, size);
    return UNIT_OK;
}

#endif
