/* The control law as a co-simulation unit of FMI 2.0. The declarations follow the standard; unit.h has the content. */
#include "unit.h"

typedef unsigned int reference;

typedef void logger(void *environment, const char *instance, int status, const char *category, const char *message, ...);

typedef struct {
    logger *log;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} callbacks;

static void unit_log_error(const unit *u, const char *text) {
    ((logger *)u->log)(u->environment, u->name, UNIT_ERROR, "logStatusError", text); /* no text has a percent sign */
}

UNIT_FUNCTION(const char *, fmi2GetTypesPlatform)(void) { return "default"; }

UNIT_FUNCTION(const char *, fmi2GetVersion)(void) { return "2.0"; }

UNIT_FUNCTION(int, fmi2SetDebugLogging)(void *u, int on, size_t count, const char *const categories[]) {
    (void)u, (void)on, (void)count, (void)categories; /* errors are always logged, and there are no other messages */
    return UNIT_OK;
}

/* ---- life of an instance ---- */

UNIT_FUNCTION(void *, fmi2Instantiate)(const char *name, int type, const char *token, const char *resources,
                                     const callbacks *given, int visible, int logging) {
    (void)resources, (void)visible, (void)logging;
    if (type != 1) return NULL; /* 1: co-simulation */
    return unit_create(name, token, given ? given->environment : NULL, given ? (void (*)(void))given->log : NULL);
}

UNIT_FUNCTION(void, fmi2FreeInstance)(void *u) { free(u); }

UNIT_FUNCTION(int, fmi2SetupExperiment)(void *u, int with_tolerance, double tolerance, double start, int with_stop,
                                       double stop) {
    (void)with_tolerance, (void)tolerance, (void)with_stop, (void)stop;
    ((unit *)u)->memory.time = start;
    return UNIT_OK;
}

UNIT_FUNCTION(int, fmi2EnterInitializationMode)(void *u) { return unit_advance(u, UNIT_INSTANTIATED, UNIT_INITIALIZING); }

UNIT_FUNCTION(int, fmi2ExitInitializationMode)(void *u) { return unit_advance(u, UNIT_INITIALIZING, UNIT_STEPPING); }

UNIT_FUNCTION(int, fmi2Terminate)(void *u) { return unit_advance(u, UNIT_STEPPING, UNIT_TERMINATED); }

UNIT_FUNCTION(int, fmi2Reset)(void *u) { return unit_start(u), UNIT_OK; }

/* ---- variables ---- */

UNIT_FUNCTION(int, fmi2GetReal)(void *u, const reference at[], size_t count, double values[]) {
    for (size_t i = 0; i < count; i++)
        if (unit_get_real(u, at[i], &values[i]) != UNIT_OK) return UNIT_ERROR;
    return UNIT_OK;
}

UNIT_FUNCTION(int, fmi2SetReal)(void *u, const reference at[], size_t count, const double values[]) {
    for (size_t i = 0; i < count; i++)
        if (unit_set_real(u, at[i], values[i]) != UNIT_OK) return UNIT_ERROR;
    return UNIT_OK;
}

UNIT_FUNCTION(int, fmi2GetInteger)(void *u, const reference at[], size_t count, int values[]) {
    for (size_t i = 0; i < count; i++) {
        const int32_t *const place = unit_integer(u, at[i]);
        if (place == NULL) return UNIT_ERROR;
        values[i] = *place;
    }
    return UNIT_OK;
}

UNIT_FUNCTION(int, fmi2GetBoolean)(void *u, const reference at[], size_t count, int values[]) {
    for (size_t i = 0; i < count; i++) {
        const int32_t *const place = unit_boolean(u, at[i]);
        if (place == NULL) return UNIT_ERROR;
        values[i] = *place;
    }
    return UNIT_OK;
}

UNIT_FUNCTION(int, fmi2SetBoolean)(void *u, const reference at[], size_t count, const int values[]) {
    for (size_t i = 0; i < count; i++) {
        int32_t *const place = unit_boolean(u, at[i]);
        if (place == NULL) return UNIT_ERROR;
        *place = values[i] != 0;
    }
    return UNIT_OK;
}

#define NO_VARIABLES(name, type) \
    UNIT_FUNCTION(int, name)(void *u, const reference at[], size_t count, type values[]) { \
        (void)at, (void)values; \
        return count == 0 ? UNIT_OK : unit_refuse(u, "This unit has no such variables."); \
    }

NO_VARIABLES(fmi2SetInteger, const int)
NO_VARIABLES(fmi2GetString, const char *)
NO_VARIABLES(fmi2SetString, const char *const)

/* ---- steps ---- */

UNIT_FUNCTION(int, fmi2DoStep)(void *u, double time, double step, int no_set_state_before) {
    (void)no_set_state_before;
    return unit_step(u, time, step);
}

UNIT_FUNCTION(int, fmi2CancelStep)(void *u) { return unit_refuse(u, "There is no running step to cancel."); }

UNIT_FUNCTION(int, fmi2GetRealStatus)(void *u, int kind, double *value) {
    if (kind != 2) return UNIT_DISCARD; /* 2: the last successful time */
    *value = ((unit *)u)->memory.time;
    return UNIT_OK;
}

UNIT_FUNCTION(int, fmi2GetBooleanStatus)(void *u, int kind, int *value) {
    (void)u;
    if (kind != 3) return UNIT_DISCARD; /* 3: whether the unit wants to end the simulation */
    *value = 0;
    return UNIT_OK;
}

#define NO_STATUS(name, type) \
    UNIT_FUNCTION(int, name)(void *u, int kind, type *value) { \
        (void)u, (void)kind, (void)value; \
        return UNIT_DISCARD; \
    }

NO_STATUS(fmi2GetStatus, int)
NO_STATUS(fmi2GetIntegerStatus, int)
NO_STATUS(fmi2GetStringStatus, const char *)

UNIT_FUNCTION(int, fmi2SetRealInputDerivatives)(void *u, const reference at[], size_t count, const int orders[],
                                               const double values[]) {
    (void)at, (void)orders, (void)values;
    return count == 0 ? UNIT_OK : unit_refuse(u, "This unit does not interpolate its inputs.");
}

UNIT_FUNCTION(int, fmi2GetRealOutputDerivatives)(void *u, const reference at[], size_t count, const int orders[],
                                                double values[]) {
    (void)at, (void)orders, (void)values;
    return count == 0 ? UNIT_OK : unit_refuse(u, "This unit has no derivatives of its outputs.");
}

UNIT_FUNCTION(int, fmi2GetDirectionalDerivative)(void *u, const reference unknowns[], size_t unknown_count,
                                                const reference knowns[], size_t known_count, const double seed[],
                                                double sensitivity[]) {
    (void)unknowns, (void)unknown_count, (void)knowns, (void)known_count, (void)seed, (void)sensitivity;
    return unit_refuse(u, "This unit has no directional derivatives.");
}

/* ---- the state as a whole ---- */

UNIT_FUNCTION(int, fmi2GetFMUstate)(void *u, void **stored) { return unit_store(u, stored); }

UNIT_FUNCTION(int, fmi2SetFMUstate)(void *u, void *stored) { return unit_restore(u, stored); }

UNIT_FUNCTION(int, fmi2FreeFMUstate)(void *u, void **stored) { return (void)u, unit_free(stored); }

UNIT_FUNCTION(int, fmi2SerializedFMUstateSize)(void *u, void *stored, size_t *size) {
    (void)u, (void)stored;
    *size = sizeof(unit_memory);
    return UNIT_OK;
}

UNIT_FUNCTION(int, fmi2SerializeFMUstate)(void *u, void *stored, char bytes[], size_t size) {
    return unit_serialize(u, stored, bytes, size);
}

UNIT_FUNCTION(int, fmi2DeSerializeFMUstate)(void *u, const char bytes[], size_t size, void **stored) {
    return unit_deserialize(u, bytes, size, stored);
}
