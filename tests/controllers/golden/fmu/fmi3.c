/*
 * SIGN UNVERIFIED: do the sign test of the commissioning sheet before cutting.
 * Model: patent CN1868666, two sensors
 *   Z = -1.871 + 6.0476*dT1 + 2.6667*dT3 [um]
 *   Y = 0.5703 + 4.7292*dT1 - 0.5908*dT3 [um]
 * The correction of an axis is the negative of its displacement.
 * Equations SHA-256 a6dda75b221d0a842068d1621f8510b36cdd362cdb3044be21d7c187f108c47f
 * Written by selector
 *
 * FMI 3.0 co-simulation: a step of communication calls the program once, or as often as period_s says.
 */

/* a * b + c is rounded twice: what the model file means, to the last bit */
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(_MSC_VER)
#pragma fp_contract (off)
#elif defined(__GNUC__)
#pragma GCC optimize ("fp-contract=off")
#endif
/* most functions of the interface are for units of other kinds */
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Types of the standard, so that no other file is needed; its own headers may be included before. */
#ifndef fmi3Functions_h
#ifndef FMI3_Export
#ifdef _WIN32
#define FMI3_Export __declspec(dllexport)
#else
#define FMI3_Export
#endif
#endif
typedef void *fmi3Instance;
typedef void *fmi3InstanceEnvironment;
typedef void *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef float fmi3Float32;
typedef double fmi3Float64;
typedef int8_t fmi3Int8;
typedef uint8_t fmi3UInt8;
typedef int16_t fmi3Int16;
typedef uint16_t fmi3UInt16;
typedef int32_t fmi3Int32;
typedef uint32_t fmi3UInt32;
typedef int64_t fmi3Int64;
typedef uint64_t fmi3UInt64;
typedef bool fmi3Boolean;
typedef const char *fmi3String;
typedef uint8_t fmi3Byte;
typedef const fmi3Byte *fmi3Binary;
typedef bool fmi3Clock;
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum { fmi3Independent } fmi3DependencyKind;
typedef enum { fmi3IntervalNotYetKnown } fmi3IntervalQualifier;
typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment, fmi3Status, fmi3String, fmi3String);
typedef void (*fmi3ClockUpdateCallback)(fmi3InstanceEnvironment);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment, fmi3Float64, fmi3Boolean, fmi3Boolean,
                                               fmi3Boolean, fmi3Boolean, fmi3Boolean *, fmi3Float64 *);
typedef void (*fmi3LockPreemptionCallback)();
typedef void (*fmi3UnlockPreemptionCallback)();
#endif

#include "thermal_correction.c"

#define MOST_CALLS 1000000.0
#define NO_READING 1e+30

struct state {
    thermal_correction m;
    double time_s;
    double period_s;
    double reading[2];
    int is_valid[2];
};

struct unit {
    struct state now;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback say;
};

/* by value reference: where, of which type (r: real, f: flag, c: code), whether it may be set */
static const struct {
    size_t at;
    char type;
    bool may_be_set;
} VARIABLES[] = {
    {offsetof(struct state, time_s), 'r', 0},
    {offsetof(struct state, period_s), 'r', 1},
    {offsetof(struct state, reading[0]), 'r', 1},
    {offsetof(struct state, is_valid[0]), 'f', 1},
    {offsetof(struct state, m.sensor_1), 'c', 0},
    {offsetof(struct state, m.has_memory_1), 'f', 1},
    {offsetof(struct state, m.start_1), 'r', 1},
    {offsetof(struct state, m.has_start_1), 'f', 1},
    {offsetof(struct state, reading[1]), 'r', 1},
    {offsetof(struct state, is_valid[1]), 'f', 1},
    {offsetof(struct state, m.sensor_2), 'c', 0},
    {offsetof(struct state, m.has_memory_2), 'f', 1},
    {offsetof(struct state, m.start_2), 'r', 1},
    {offsetof(struct state, m.has_start_2), 'f', 1},
    {offsetof(struct state, m.is_ready), 'f', 1},
    {offsetof(struct state, m.is_wanted), 'f', 1},
    {offsetof(struct state, m.is_restart), 'f', 1},
    {offsetof(struct state, m.standstill_s), 'r', 1},
    {offsetof(struct state, m.test_um_1), 'r', 1},
    {offsetof(struct state, m.correction_1), 'r', 0},
    {offsetof(struct state, m.k0_1), 'r', 0},
    {offsetof(struct state, m.test_um_2), 'r', 1},
    {offsetof(struct state, m.correction_2), 'r', 0},
    {offsetof(struct state, m.k0_2), 'r', 0},
    {offsetof(struct state, m.mode), 'c', 0},
};

static void begin(struct state *now)
{
    size_t k;
    memset(now, 0, sizeof *now);
    thermal_correction_init(&now->m);
    for (k = 0; k < 2; k++) {
        now->reading[k] = NO_READING;
        now->is_valid[k] = 1;
    }
}

static void call(struct state *now, double passed_s)
{
    thermal_correction *m = &now->m;
    m->dt_s = passed_s;
    m->reading_1 = now->is_valid[0] ? now->reading[0] : NO_READING;
    m->reading_2 = now->is_valid[1] ? now->reading[1] : NO_READING;
    thermal_correction_step(m);
}

static fmi3Status refused(struct unit *unit, const char *why)
{
    if (unit != NULL && unit->say != NULL) unit->say(unit->environment, fmi3Error, "logStatusError", why);
    return fmi3Error;
}

static fmi3Status not_there(fmi3Instance instance)
{
    return refused(instance, "this unit is for co-simulation without clocks, events and derivatives");
}

static void *variable(struct unit *unit, fmi3ValueReference reference, char type, bool is_set)
{
    if (unit == NULL) return NULL;
    if (reference >= sizeof VARIABLES / sizeof *VARIABLES || VARIABLES[reference].type != type) {
        refused(unit, "no variable of this type has this value reference: see modelDescription.xml");
        return NULL;
    }
    if (is_set && !VARIABLES[reference].may_be_set) {
        refused(unit, "time and outputs cannot be set");
        return NULL;
    }
    return (char *)&unit->now + VARIABLES[reference].at;
}

/* values that the program has; setting is all or nothing */
#define ACCESS(Type, letter, own, in)                                                                             \
    FMI3_Export fmi3Status fmi3Get##Type(fmi3Instance instance, const fmi3ValueReference references[], size_t n,  \
                                         fmi3##Type values[], size_t n_values)                                    \
    {                                                                                                             \
        size_t k;                                                                                                 \
        if (n != n_values) return refused(instance, "as many values as value references are expected");           \
        for (k = 0; k < n; k++) {                                                                                 \
            const own *at = variable(instance, references[k], letter, false);                                     \
            if (at == NULL) return fmi3Error;                                                                     \
            values[k] = in *at;                                                                                   \
        }                                                                                                         \
        return fmi3OK;                                                                                            \
    }                                                                                                             \
    FMI3_Export fmi3Status fmi3Set##Type(fmi3Instance instance, const fmi3ValueReference references[], size_t n,  \
                                         const fmi3##Type values[], size_t n_values)                              \
    {                                                                                                             \
        size_t k;                                                                                                 \
        if (n != n_values) return refused(instance, "as many values as value references are expected");           \
        for (k = 0; k < n; k++)                                                                                   \
            if (variable(instance, references[k], letter, true) == NULL) return fmi3Error;                        \
        for (k = 0; k < n; k++) *(own *)variable(instance, references[k], letter, true) = values[k];              \
        return fmi3OK;                                                                                            \
    }
ACCESS(Float64, 'r', double, )
ACCESS(Int32, 'c', int, )
ACCESS(Boolean, 'f', int, 0 !=)

/* types that no variable has */
#define NONE(Type)                                                                                                \
    FMI3_Export fmi3Status fmi3Get##Type(fmi3Instance instance, const fmi3ValueReference references[], size_t n,  \
                                         fmi3##Type values[], size_t n_values)                                    \
    {                                                                                                             \
        return n == 0 ? fmi3OK : not_there(instance);                                                             \
    }                                                                                                             \
    FMI3_Export fmi3Status fmi3Set##Type(fmi3Instance instance, const fmi3ValueReference references[], size_t n,  \
                                         const fmi3##Type values[], size_t n_values)                              \
    {                                                                                                             \
        return n == 0 ? fmi3OK : not_there(instance);                                                             \
    }
NONE(Float32)
NONE(Int8)
NONE(UInt8)
NONE(Int16)
NONE(UInt16)
NONE(UInt32)
NONE(Int64)
NONE(UInt64)
NONE(String)


FMI3_Export fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                                     size_t sizes[], fmi3Binary values[], size_t n_values)
{
    return n == 0 ? fmi3OK : not_there(instance);
}

FMI3_Export fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                                     const size_t sizes[], const fmi3Binary values[], size_t n_values)
{
    return n == 0 ? fmi3OK : not_there(instance);
}

FMI3_Export const char *fmi3GetVersion(void)
{
    return "3.0";
}

FMI3_Export fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3Boolean events, fmi3Boolean early_return, const fmi3ValueReference intermediate[], size_t n_intermediate,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback say, fmi3IntermediateUpdateCallback update)
{
    struct unit *unit = malloc(sizeof *unit);
    if (unit == NULL) return NULL;
    unit->environment = environment;
    unit->say = say;
    if (token == NULL || strcmp(token, "18bc9df2-c910-5206-87b2-ba83eac4a218") != 0) {
        refused(unit, "binary and modelDescription.xml are of different models: the instantiation token differs");
        free(unit);
        return NULL;
    }
    begin(&unit->now);
    return unit;
}

FMI3_Export fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                                      fmi3Boolean visible, fmi3Boolean logging,
                                                      fmi3InstanceEnvironment environment, fmi3LogMessageCallback say)
{
    return NULL;
}

FMI3_Export fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback say, fmi3ClockUpdateCallback update,
    fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    return NULL;
}

FMI3_Export void fmi3FreeInstance(fmi3Instance instance)
{
    free(instance);
}

FMI3_Export fmi3Status fmi3Reset(fmi3Instance instance)
{
    struct unit *unit = instance;
    if (unit == NULL) return fmi3Error;
    begin(&unit->now);
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean has_tolerance,
                                                   fmi3Float64 tolerance, fmi3Float64 start_s, fmi3Boolean has_stop,
                                                   fmi3Float64 stop_s)
{
    struct unit *unit = instance;
    if (unit == NULL) return fmi3Error;
    unit->now.time_s = start_s;
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 from_s, fmi3Float64 step_s,
                                  fmi3Boolean is_final_state, fmi3Boolean *needs_events, fmi3Boolean *ends,
                                  fmi3Boolean *is_early, fmi3Float64 *reached_s)
{
    struct unit *unit = instance;
    double calls = 1.0, k;
    if (unit == NULL) return fmi3Error;
    *needs_events = *ends = *is_early = false;
    *reached_s = from_s;
    if (unit->now.period_s > 0.0 && step_s > unit->now.period_s) calls = step_s / unit->now.period_s;
    if (!(calls <= MOST_CALLS)) return refused(unit, "a step of more than a million periods: make period_s longer");
    if (calls > (double)(long)calls) calls = (double)((long)calls + 1);
    /* what is no time counts as 0 in the program */
    for (k = 0.0; k < calls; k += 1.0) call(&unit->now, step_s / calls);
    *reached_s = unit->now.time_s = from_s + step_s;
    return fmi3OK;
}

/* the whole state: inputs, memory and outputs */
FMI3_Export fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    struct unit *unit = instance;
    if (unit == NULL) return fmi3Error;
    if (*state == NULL) *state = malloc(sizeof unit->now);
    if (*state == NULL) return refused(unit, "no memory left");
    memcpy(*state, &unit->now, sizeof unit->now);
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state)
{
    struct unit *unit = instance;
    if (unit == NULL || state == NULL) return refused(unit, "no state is given");
    memcpy(&unit->now, state, sizeof unit->now);
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    if (state != NULL) {
        free(*state);
        *state = NULL;
    }
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t *size)
{
    *size = sizeof(struct state);
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    if (state == NULL || size != sizeof(struct state)) return refused(instance, "a state of another size");
    memcpy(bytes, state, size);
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size,
                                               fmi3FMUState *state)
{
    if (size != sizeof(struct state)) return refused(instance, "a state of another size");
    if (*state == NULL) *state = malloc(size);
    if (*state == NULL) return refused(instance, "no memory left");
    memcpy(*state, bytes, size);
    return fmi3OK;
}

#define NOTHING(function, parameters)          \
    FMI3_Export fmi3Status function parameters \
    {                                          \
        return fmi3OK;                         \
    }
NOTHING(fmi3SetDebugLogging, (fmi3Instance instance, fmi3Boolean on, size_t n, const fmi3String categories[]))
NOTHING(fmi3ExitInitializationMode, (fmi3Instance instance))
NOTHING(fmi3Terminate, (fmi3Instance instance))
NOTHING(fmi3EnterConfigurationMode, (fmi3Instance instance))
NOTHING(fmi3ExitConfigurationMode, (fmi3Instance instance))

/* what modelDescription.xml does not offer */
#define NOT_THERE(function, parameters)        \
    FMI3_Export fmi3Status function parameters \
    {                                          \
        return not_there(instance);            \
    }
NOT_THERE(fmi3EnterEventMode, (fmi3Instance instance))
NOT_THERE(fmi3EnterStepMode, (fmi3Instance instance))
NOT_THERE(fmi3EnterContinuousTimeMode, (fmi3Instance instance))
NOT_THERE(fmi3EvaluateDiscreteStates, (fmi3Instance instance))
NOT_THERE(fmi3GetClock, (fmi3Instance instance, const fmi3ValueReference r[], size_t n, fmi3Clock v[]))
NOT_THERE(fmi3SetClock, (fmi3Instance instance, const fmi3ValueReference r[], size_t n, const fmi3Clock v[]))
NOT_THERE(fmi3GetNumberOfVariableDependencies, (fmi3Instance instance, fmi3ValueReference r, size_t *n))
NOT_THERE(fmi3GetVariableDependencies,
          (fmi3Instance instance, fmi3ValueReference r, size_t of[], fmi3ValueReference on[], size_t of_on[],
           fmi3DependencyKind kinds[], size_t n))
NOT_THERE(fmi3GetDirectionalDerivative,
          (fmi3Instance instance, const fmi3ValueReference of[], size_t n_of, const fmi3ValueReference by[],
           size_t n_by, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 found[], size_t n_found))
NOT_THERE(fmi3GetAdjointDerivative,
          (fmi3Instance instance, const fmi3ValueReference of[], size_t n_of, const fmi3ValueReference by[],
           size_t n_by, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 found[], size_t n_found))
NOT_THERE(fmi3GetIntervalDecimal, (fmi3Instance instance, const fmi3ValueReference r[], size_t n, fmi3Float64 v[],
                                   fmi3IntervalQualifier q[]))
NOT_THERE(fmi3GetIntervalFraction, (fmi3Instance instance, const fmi3ValueReference r[], size_t n, fmi3UInt64 v[],
                                    fmi3UInt64 of[], fmi3IntervalQualifier q[]))
NOT_THERE(fmi3GetShiftDecimal, (fmi3Instance instance, const fmi3ValueReference r[], size_t n, fmi3Float64 v[]))
NOT_THERE(fmi3GetShiftFraction,
          (fmi3Instance instance, const fmi3ValueReference r[], size_t n, fmi3UInt64 v[], fmi3UInt64 of[]))
NOT_THERE(fmi3SetIntervalDecimal,
          (fmi3Instance instance, const fmi3ValueReference r[], size_t n, const fmi3Float64 v[]))
NOT_THERE(fmi3SetIntervalFraction,
          (fmi3Instance instance, const fmi3ValueReference r[], size_t n, const fmi3UInt64 v[], const fmi3UInt64 of[]))
NOT_THERE(fmi3SetShiftDecimal, (fmi3Instance instance, const fmi3ValueReference r[], size_t n, const fmi3Float64 v[]))
NOT_THERE(fmi3SetShiftFraction,
          (fmi3Instance instance, const fmi3ValueReference r[], size_t n, const fmi3UInt64 v[], const fmi3UInt64 of[]))
NOT_THERE(fmi3UpdateDiscreteStates,
          (fmi3Instance instance, fmi3Boolean *again, fmi3Boolean *ends, fmi3Boolean *nominals, fmi3Boolean *values,
           fmi3Boolean *has_next, fmi3Float64 *next_s))
NOT_THERE(fmi3CompletedIntegratorStep,
          (fmi3Instance instance, fmi3Boolean is_final, fmi3Boolean *events, fmi3Boolean *ends))
NOT_THERE(fmi3SetTime, (fmi3Instance instance, fmi3Float64 time_s))
NOT_THERE(fmi3SetContinuousStates, (fmi3Instance instance, const fmi3Float64 v[], size_t n))
NOT_THERE(fmi3GetContinuousStateDerivatives, (fmi3Instance instance, fmi3Float64 v[], size_t n))
NOT_THERE(fmi3GetEventIndicators, (fmi3Instance instance, fmi3Float64 v[], size_t n))
NOT_THERE(fmi3GetContinuousStates, (fmi3Instance instance, fmi3Float64 v[], size_t n))
NOT_THERE(fmi3GetNominalsOfContinuousStates, (fmi3Instance instance, fmi3Float64 v[], size_t n))
NOT_THERE(fmi3GetNumberOfEventIndicators, (fmi3Instance instance, size_t *n))
NOT_THERE(fmi3GetNumberOfContinuousStates, (fmi3Instance instance, size_t *n))
NOT_THERE(fmi3GetOutputDerivatives, (fmi3Instance instance, const fmi3ValueReference r[], size_t n,
                                     const fmi3Int32 orders[], fmi3Float64 v[], size_t n_v))
NOT_THERE(fmi3ActivateModelPartition, (fmi3Instance instance, fmi3ValueReference clock, fmi3Float64 time_s))
