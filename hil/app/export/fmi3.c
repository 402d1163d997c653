/* FMI 3.0 Co-Simulation around a core that is included before this file.

   The core declares TOKEN, VARIABLES, INPUT, PARAMETERS_FROM (parameters are the variables from there on), START[], the
   struct Core and
     core_begin(Core *, double *values)                          at rest, outputs set
     core_step(Core *, double *values, double t, double h)       go on from t by h, in s from the start; 0 where it can
   All variables are Float64; value references are their places in `values`, 0 is time. */
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#if defined _WIN32
#define FMI __declspec(dllexport)
#else
#define FMI __attribute__((visibility("default")))
#endif

typedef enum { OK, WARNING, DISCARD, ERROR, FATAL } Status;
typedef enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED } Phase;
typedef void (*Log)(void *, Status, const char *, const char *);

typedef struct {
    Core core;
    double values[VARIABLES];
    double start;
    Phase phase;
} State;

typedef struct {
    State state;
    Log log;
    void *environment;
} Instance;

static Status refuse(Instance *i, const char *sentence) {
    if (i->log) i->log(i->environment, ERROR, "logStatusError", sentence);
    return ERROR;
}

static void rest(State *s) {
    memset(s, 0, sizeof *s);
    memcpy(s->values, START, sizeof s->values);
}

FMI const char *fmi3GetVersion(void) { return "3.0"; }

FMI void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                      bool logging, bool events, bool early, const unsigned intermediate[], size_t n,
                                      void *environment, Log log, void *update) {
    (void)name, (void)resources, (void)visible, (void)logging, (void)events, (void)early, (void)intermediate, (void)n;
    (void)update;
    if (!token || strcmp(token, TOKEN)) {
        if (log) log(environment, ERROR, "logStatusError", "instantiationToken must be that of modelDescription.xml");
        return NULL;
    }
    Instance *i = calloc(1, sizeof *i);
    if (!i) return NULL;
    i->log = log, i->environment = environment;
    rest(&i->state);
    return i;
}

FMI void fmi3FreeInstance(void *instance) { free(instance); }

FMI Status fmi3SetDebugLogging(void *instance, bool on, size_t n, const char *const categories[]) {
    (void)instance, (void)on, (void)n, (void)categories;
    return OK;
}

FMI Status fmi3EnterInitializationMode(void *instance, bool toleranced, double tolerance, double start, bool stops,
                                       double stop) {
    Instance *i = instance;
    (void)toleranced, (void)tolerance, (void)stops, (void)stop;
    if (i->state.phase != INSTANTIATED) return refuse(i, "initialization must follow instantiation or reset");
    i->state.start = i->state.values[0] = start;
    i->state.phase = INITIALIZING;
    return OK;
}

FMI Status fmi3ExitInitializationMode(void *instance) {
    Instance *i = instance;
    if (i->state.phase != INITIALIZING) return refuse(i, "initialization mode must be entered before it is left");
    core_begin(&i->state.core, i->state.values);
    i->state.phase = STEPPING;
    return OK;
}

FMI Status fmi3Terminate(void *instance) {
    ((Instance *)instance)->state.phase = TERMINATED;
    return OK;
}

FMI Status fmi3Reset(void *instance) {
    rest(&((Instance *)instance)->state);
    return OK;
}

FMI Status fmi3GetFloat64(void *instance, const unsigned references[], size_t n, double values[], size_t m) {
    Instance *i = instance;
    if (n != m) return refuse(i, "there must be a value for each value reference");
    if (i->state.phase == INITIALIZING) core_begin(&i->state.core, i->state.values);
    for (size_t k = 0; k < n; k++) {
        if (references[k] >= VARIABLES) return refuse(i, "value references must be those of modelDescription.xml");
        values[k] = i->state.values[references[k]];
    }
    return OK;
}

FMI Status fmi3SetFloat64(void *instance, const unsigned references[], size_t n, const double values[], size_t m) {
    Instance *i = instance;
    if (n != m) return refuse(i, "there must be a value for each value reference");
    for (size_t k = 0; k < n; k++) {
        bool parameter = references[k] >= PARAMETERS_FROM && references[k] < VARIABLES;
        if (references[k] != INPUT && !parameter)
            return refuse(i, "only the input and, before the first step, parameters may be set");
        if (parameter && i->state.phase >= STEPPING) return refuse(i, "parameters must be set before the first step");
        if (!(values[k] - values[k] == 0)) return refuse(i, "values must be finite");
        i->state.values[references[k]] = values[k];
    }
    return OK;
}

FMI Status fmi3DoStep(void *instance, double t, double h, bool forget, bool *event, bool *terminate, bool *early,
                      double *reached) {
    Instance *i = instance;
    (void)forget;
    *event = *terminate = *early = false;
    *reached = t;
    if (i->state.phase != STEPPING) return refuse(i, "steps must come after initialization and before termination");
    if (!(h > 0)) return refuse(i, "communicationStepSize must be positive");
    if (core_step(&i->state.core, i->state.values, t - i->state.start, h))
        return refuse(i, "communicationStepSize must be a step of the model or more");
    *reached = i->state.values[0] = t + h;
    return OK;
}

FMI Status fmi3GetFMUState(void *instance, void **kept) {
    if (!*kept) *kept = malloc(sizeof(State));
    if (!*kept) return refuse(instance, "there is no memory for another state");
    memcpy(*kept, &((Instance *)instance)->state, sizeof(State));
    return OK;
}

FMI Status fmi3SetFMUState(void *instance, void *kept) {
    memcpy(&((Instance *)instance)->state, kept, sizeof(State));
    return OK;
}

FMI Status fmi3FreeFMUState(void *instance, void **kept) {
    (void)instance;
    free(*kept);
    *kept = NULL;
    return OK;
}

FMI Status fmi3SerializedFMUStateSize(void *instance, void *kept, size_t *size) {
    (void)instance, (void)kept;
    *size = sizeof(State);
    return OK;
}

FMI Status fmi3SerializeFMUState(void *instance, void *kept, unsigned char bytes[], size_t size) {
    if (size < sizeof(State)) return refuse(instance, "serializedState must hold fmi3SerializedFMUStateSize bytes");
    memcpy(bytes, kept, sizeof(State));
    return OK;
}

FMI Status fmi3DeserializeFMUState(void *instance, const unsigned char bytes[], size_t size, void **kept) {
    if (size != sizeof(State)) return refuse(instance, "serializedState must be one of this model");
    if (!*kept) *kept = malloc(sizeof(State));
    if (!*kept) return refuse(instance, "there is no memory for another state");
    memcpy(*kept, bytes, sizeof(State));
    return OK;
}

/* What the standard wants to be there and the model does not have. */
#define ABSENT(name) \
    FMI Status fmi3##name(void *instance) { return refuse(instance, "fmi3" #name " is not part of this model"); }
#define ABSENT_TYPE(type) ABSENT(Get##type) ABSENT(Set##type)
ABSENT_TYPE(Float32) ABSENT_TYPE(Int8) ABSENT_TYPE(UInt8) ABSENT_TYPE(Int16) ABSENT_TYPE(UInt16) ABSENT_TYPE(Int32)
ABSENT_TYPE(UInt32) ABSENT_TYPE(Int64) ABSENT_TYPE(UInt64) ABSENT_TYPE(Boolean) ABSENT_TYPE(String)
ABSENT_TYPE(Binary) ABSENT_TYPE(Clock) ABSENT_TYPE(IntervalDecimal) ABSENT_TYPE(IntervalFraction)
ABSENT_TYPE(ShiftDecimal) ABSENT_TYPE(ShiftFraction) ABSENT_TYPE(ContinuousStates)
ABSENT(GetNumberOfVariableDependencies) ABSENT(GetVariableDependencies) ABSENT(GetDirectionalDerivative)
ABSENT(GetAdjointDerivative) ABSENT(EnterConfigurationMode) ABSENT(ExitConfigurationMode)
ABSENT(EvaluateDiscreteStates) ABSENT(UpdateDiscreteStates) ABSENT(EnterEventMode) ABSENT(EnterStepMode)
ABSENT(EnterContinuousTimeMode) ABSENT(CompletedIntegratorStep) ABSENT(SetTime) ABSENT(GetContinuousStateDerivatives)
ABSENT(GetEventIndicators) ABSENT(GetNominalsOfContinuousStates) ABSENT(GetNumberOfEventIndicators)
ABSENT(GetNumberOfContinuousStates) ABSENT(GetOutputDerivatives) ABSENT(ActivateModelPartition)
FMI void *fmi3InstantiateModelExchange(void) { return NULL; }
FMI void *fmi3InstantiateScheduledExecution(void) { return NULL; }
