/* The control law as a co-simulation unit of FMI 3.0. The declarations follow the standard; unit.h has the content. */
#include "unit.h"

#include <stdbool.h>

typedef uint32_t reference;

typedef void logger(void *environment, int status, const char *category, const char *message);

static void unit_log_error(const unit *u, const char *text) {
    ((logger *)u->log)(u->environment, UNIT_ERROR, "logStatusError", text);
}

UNIT_FUNCTION(const char *, fmi3GetVersion)(void) { return "3.0"; }

UNIT_FUNCTION(int, fmi3SetDebugLogging)(void *u, bool on, size_t count, const char *const categories[]) {
    (void)u, (void)on, (void)count, (void)categories; /* errors are always logged, and there are no other messages */
    return UNIT_OK;
}

/* ---- life of an instance ---- */

UNIT_FUNCTION(void *, fmi3InstantiateCoSimulation)(const char *name, const char *token, const char *resources, bool visible,
                                                 bool logging, bool event_mode, bool early_return,
                                                 const reference intermediate[], size_t intermediate_count,
                                                 void *environment, logger *log, void (*update)(void)) {
    (void)resources, (void)visible, (void)logging, (void)event_mode, (void)early_return;
    (void)intermediate, (void)intermediate_count, (void)update;
    return unit_create(name, token, environment, (void (*)(void))log);
}

UNIT_FUNCTION(void, fmi3FreeInstance)(void *u) { free(u); }

UNIT_FUNCTION(int, fmi3EnterInitializationMode)(void *u, bool with_tolerance, double tolerance, double start,
                                               bool with_stop, double stop) {
    (void)with_tolerance, (void)tolerance, (void)with_stop, (void)stop;
    ((unit *)u)->memory.time = start;
    return unit_advance(u, UNIT_INSTANTIATED, UNIT_INITIALIZING);
}

UNIT_FUNCTION(int, fmi3ExitInitializationMode)(void *u) { return unit_advance(u, UNIT_INITIALIZING, UNIT_STEPPING); }

UNIT_FUNCTION(int, fmi3Terminate)(void *u) { return unit_advance(u, UNIT_STEPPING, UNIT_TERMINATED); }

UNIT_FUNCTION(int, fmi3Reset)(void *u) { return unit_start(u), UNIT_OK; }

/* ---- variables ---- */

UNIT_FUNCTION(int, fmi3GetFloat64)(void *u, const reference at[], size_t count, double values[], size_t value_count) {
    if (count != value_count) return unit_refuse(u, "Every variable of this unit has one value.");
    for (size_t i = 0; i < count; i++)
        if (unit_get_real(u, at[i], &values[i]) != UNIT_OK) return UNIT_ERROR;
    return UNIT_OK;
}

UNIT_FUNCTION(int, fmi3SetFloat64)(void *u, const reference at[], size_t count, const double values[],
                                  size_t value_count) {
    if (count != value_count) return unit_refuse(u, "Every variable of this unit has one value.");
    for (size_t i = 0; i < count; i++)
        if (unit_set_real(u, at[i], values[i]) != UNIT_OK) return UNIT_ERROR;
    return UNIT_OK;
}

UNIT_FUNCTION(int, fmi3GetInt32)(void *u, const reference at[], size_t count, int32_t values[], size_t value_count) {
    if (count != value_count) return unit_refuse(u, "Every variable of this unit has one value.");
    for (size_t i = 0; i < count; i++) {
        const int32_t *const place = unit_integer(u, at[i]);
        if (place == NULL) return UNIT_ERROR;
        values[i] = *place;
    }
    return UNIT_OK;
}

UNIT_FUNCTION(int, fmi3GetBoolean)(void *u, const reference at[], size_t count, bool values[], size_t value_count) {
    if (count != value_count) return unit_refuse(u, "Every variable of this unit has one value.");
    for (size_t i = 0; i < count; i++) {
        const int32_t *const place = unit_boolean(u, at[i]);
        if (place == NULL) return UNIT_ERROR;
        values[i] = *place != 0;
    }
    return UNIT_OK;
}

UNIT_FUNCTION(int, fmi3SetBoolean)(void *u, const reference at[], size_t count, const bool values[], size_t value_count) {
    if (count != value_count) return unit_refuse(u, "Every variable of this unit has one value.");
    for (size_t i = 0; i < count; i++) {
        int32_t *const place = unit_boolean(u, at[i]);
        if (place == NULL) return UNIT_ERROR;
        *place = values[i];
    }
    return UNIT_OK;
}

#define NO_VARIABLES(name, type) \
    UNIT_FUNCTION(int, fmi3Get##name)(void *u, const reference at[], size_t count, type values[], size_t value_count) { \
        (void)at, (void)values, (void)value_count; \
        return count == 0 ? UNIT_OK : unit_refuse(u, "This unit has no variables of the type " #name "."); \
    } \
    UNIT_FUNCTION(int, fmi3Set##name)(void *u, const reference at[], size_t count, type const values[], \
                                     size_t value_count) { \
        (void)at, (void)values, (void)value_count; \
        return count == 0 ? UNIT_OK : unit_refuse(u, "This unit sets no variables of the type " #name "."); \
    }

NO_VARIABLES(Float32, float)
NO_VARIABLES(Int8, int8_t)
NO_VARIABLES(UInt8, uint8_t)
NO_VARIABLES(Int16, int16_t)
NO_VARIABLES(UInt16, uint16_t)
NO_VARIABLES(UInt32, uint32_t)
NO_VARIABLES(Int64, int64_t)
NO_VARIABLES(UInt64, uint64_t)
NO_VARIABLES(String, const char *)

UNIT_FUNCTION(int, fmi3SetInt32)(void *u, const reference at[], size_t count, const int32_t values[], size_t value_count) {
    (void)at, (void)values, (void)value_count;
    return count == 0 ? UNIT_OK : unit_refuse(u, "This unit sets no variables of the type Int32.");
}

/* ---- steps ---- */

UNIT_FUNCTION(int, fmi3DoStep)(void *u, double time, double step, bool no_set_state_before, bool *event_needed,
                              bool *terminate, bool *early_return, double *last_time) {
    (void)no_set_state_before;
    const int status = unit_step(u, time, step);
    *event_needed = *terminate = *early_return = false;
    *last_time = ((unit *)u)->memory.time;
    return status;
}

/* ---- the state as a whole ---- */

UNIT_FUNCTION(int, fmi3GetFMUState)(void *u, void **stored) { return unit_store(u, stored); }

UNIT_FUNCTION(int, fmi3SetFMUState)(void *u, void *stored) { return unit_restore(u, stored); }

UNIT_FUNCTION(int, fmi3FreeFMUState)(void *u, void **stored) { return (void)u, unit_free(stored); }

UNIT_FUNCTION(int, fmi3SerializedFMUStateSize)(void *u, void *stored, size_t *size) {
    (void)u, (void)stored;
    *size = sizeof(unit_memory);
    return UNIT_OK;
}

UNIT_FUNCTION(int, fmi3SerializeFMUState)(void *u, void *stored, uint8_t bytes[], size_t size) {
    return unit_serialize(u, stored, bytes, size);
}

UNIT_FUNCTION(int, fmi3DeserializeFMUState)(void *u, const uint8_t bytes[], size_t size, void **stored) {
    return unit_deserialize(u, bytes, size, stored);
}

/* ---- what this unit does not offer ----
 * Importers look up all functions, but modelDescription.xml forbids them to call these. Their other arguments are not
 * declared, because no calling convention of C needs them. */

UNIT_FUNCTION(void *, fmi3InstantiateModelExchange)(void) { return NULL; }

UNIT_FUNCTION(void *, fmi3InstantiateScheduledExecution)(void) { return NULL; }

#define NOT_OFFERED(name) \
    UNIT_FUNCTION(int, name)(void *u) { return unit_refuse(u, "This unit does not offer " #name "."); }

NOT_OFFERED(fmi3ActivateModelPartition)
NOT_OFFERED(fmi3CompletedIntegratorStep)
NOT_OFFERED(fmi3EnterConfigurationMode)
NOT_OFFERED(fmi3EnterContinuousTimeMode)
NOT_OFFERED(fmi3EnterEventMode)
NOT_OFFERED(fmi3EnterStepMode)
NOT_OFFERED(fmi3EvaluateDiscreteStates)
NOT_OFFERED(fmi3ExitConfigurationMode)
NOT_OFFERED(fmi3GetAdjointDerivative)
NOT_OFFERED(fmi3GetBinary)
NOT_OFFERED(fmi3GetClock)
NOT_OFFERED(fmi3GetContinuousStateDerivatives)
NOT_OFFERED(fmi3GetContinuousStates)
NOT_OFFERED(fmi3GetDirectionalDerivative)
NOT_OFFERED(fmi3GetEventIndicators)
NOT_OFFERED(fmi3GetIntervalDecimal)
NOT_OFFERED(fmi3GetIntervalFraction)
NOT_OFFERED(fmi3GetNominalsOfContinuousStates)
NOT_OFFERED(fmi3GetNumberOfContinuousStates)
NOT_OFFERED(fmi3GetNumberOfEventIndicators)
NOT_OFFERED(fmi3GetNumberOfVariableDependencies)
NOT_OFFERED(fmi3GetOutputDerivatives)
NOT_OFFERED(fmi3GetShiftDecimal)
NOT_OFFERED(fmi3GetShiftFraction)
NOT_OFFERED(fmi3GetVariableDependencies)
NOT_OFFERED(fmi3SetBinary)
NOT_OFFERED(fmi3SetClock)
NOT_OFFERED(fmi3SetContinuousStates)
NOT_OFFERED(fmi3SetIntervalDecimal)
NOT_OFFERED(fmi3SetIntervalFraction)
NOT_OFFERED(fmi3SetShiftDecimal)
NOT_OFFERED(fmi3SetShiftFraction)
NOT_OFFERED(fmi3SetTime)
NOT_OFFERED(fmi3UpdateDiscreteStates)
