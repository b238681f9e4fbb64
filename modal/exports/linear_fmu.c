/* The linear model in model.h for model exchange and co-simulation (FMI 2.0).

   In co-simulation, over a step with the input held, z(t + STEP) = PHI z + GAMMA u exactly.  What is left of a communication step that is
   no multiple of STEP is bridged by Taylor's series of the exponential in pieces of length at most 1 / REACH, which is
   exact to rounding too.  A model that is discrete from the start (CONTINUOUS 0) refuses such a rest, and is for
   co-simulation alone: it has no derivatives. */

#include <stdlib.h>
#include <string.h>

#include "model.h"

/* ------------------------------------------------------------------ the interface, as far as it is needed here */

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

#ifdef FMI2_FUNCTION_PREFIX
#define JOINED_(a, b) a##b
#define JOINED(a, b) JOINED_(a, b)
#define FMI(name) JOINED(FMI2_FUNCTION_PREFIX, name)
#else
#define FMI(name) name
#endif

typedef enum { OK, WARNING, DISCARD, ERROR, FATAL, PENDING } Status;
typedef enum { MODEL_EXCHANGE, CO_SIMULATION } Kind;
typedef unsigned int Reference;
typedef int Boolean;
typedef const char *String;

typedef struct {
    void (*logger)(void *environment, String instance, Status status, String category, String message, ...);
    void *(*allocate)(size_t count, size_t size);
    void (*release)(void *memory);
    void (*finished)(void *environment, Status status);
    void *environment;
} Callbacks;

/* ---------------------------------------------------------------------------------------------------- the model */

typedef struct {
    double u[INPUTS + 1];
    double z[STATES + 1];
    double start[STATES + 1];
    int running;
} Memory;

typedef struct {
    Memory memory;
    const Callbacks *callbacks;
    char name[64];
} Slave;

static double output(const Memory *at, int row)
{
    double sum = 0.0;
    int k;
    for (k = 0; k < STATES; k++) sum += C[row][k] * at->z[k];
    for (k = 0; k < INPUTS; k++) sum += D[row][k] * at->u[k];
    return sum;
}

#if CONTINUOUS
static double derivative(const Memory *at, int row)
{
    double sum = 0.0;
    int k;
    for (k = 0; k < STATES; k++) sum += A[row][k] * at->z[k];
    for (k = 0; k < INPUTS; k++) sum += B[row][k] * at->u[k];
    return sum;
}
#endif

static void step(Memory *at)
{
    double next[STATES + 1];
    int i, k;
    for (i = 0; i < STATES; i++) {
        next[i] = 0.0;
        for (k = 0; k < STATES; k++) next[i] += PHI[i][k] * at->z[k];
        for (k = 0; k < INPUTS; k++) next[i] += GAMMA[i][k] * at->u[k];
    }
    for (i = 0; i < STATES; i++) at->z[i] = next[i];
}

#if CONTINUOUS
#define TERMS 22

/* z += h (A z + B u) + h^2/2 A (A z + B u) + ... */
static void piece(Memory *at, double h)
{
    double term[STATES + 1], next[STATES + 1];
    int i, k, order;
    for (i = 0; i < STATES; i++) {
        term[i] = 0.0;
        for (k = 0; k < STATES; k++) term[i] += h * A[i][k] * at->z[k];
        for (k = 0; k < INPUTS; k++) term[i] += h * B[i][k] * at->u[k];
    }
    for (order = 2; order <= TERMS; order++) {
        for (i = 0; i < STATES; i++) {
            at->z[i] += term[i];
            next[i] = 0.0;
            for (k = 0; k < STATES; k++) next[i] += h / order * A[i][k] * term[k];
        }
        for (i = 0; i < STATES; i++) term[i] = next[i];
    }
}

static int bridge(Memory *at, double time)
{
    int pieces = 1 + (int) (REACH * (time < 0.0 ? -time : time)), i;
    for (i = 0; i < pieces; i++) piece(at, time / pieces);
    return 1;
}
#else
static int bridge(Memory *at, double time)
{
    (void) at;
    (void) time;
    return 0;
}
#endif

/* How much of a step may be missing: a discrete model's times carry the rounding of a late start. */
#define SLACK (CONTINUOUS ? 1e-9 : 1e-3)

static int advance(Memory *at, double time)
{
    long long whole = (long long) (time / STEP + 0.5);
    double rest = time - (double) whole * STEP;
    if (rest < -SLACK * STEP) rest = time - (double) --whole * STEP;
    while (whole-- > 0) step(at);
    return rest < SLACK * STEP || bridge(at, rest);
}

static Status refused(const Slave *slave, String message)
{
    const Callbacks *to = slave->callbacks;
    if (to->logger) to->logger(to->environment, slave->name, ERROR, "logStatusError", "%s", message);
    return ERROR;
}

/* ------------------------------------------------------------------------------------------------ life and death */

EXPORT String FMI(fmi2GetTypesPlatform)(void) { return "default"; }
EXPORT String FMI(fmi2GetVersion)(void) { return "2.0"; }

EXPORT Status FMI(fmi2SetDebugLogging)(void *c, Boolean on, size_t n, const String categories[]) { return OK; }

EXPORT void *FMI(fmi2Instantiate)(String name, Kind kind, String guid, String resources, const Callbacks *callbacks,
                                  Boolean visible, Boolean logging)
{
    Slave *slave;
    if (!callbacks || !name || !guid || (kind == MODEL_EXCHANGE && !CONTINUOUS)) return NULL;
    slave = calloc(1, sizeof *slave);
    if (!slave) return NULL;
    slave->callbacks = callbacks;
    memcpy(slave->name, name, strlen(name) < sizeof slave->name ? strlen(name) : sizeof slave->name - 1);
    if (strcmp(guid, MODEL_GUID) == 0) return slave;
    refused(slave, "the GUID is that of another model");
    free(slave);
    return NULL;
}

EXPORT void FMI(fmi2FreeInstance)(void *c) { free(c); }

EXPORT Status FMI(fmi2SetupExperiment)(void *c, Boolean has_tolerance, double tolerance, double start, Boolean has_stop,
                                       double stop)
{
    return OK;
}

EXPORT Status FMI(fmi2EnterInitializationMode)(void *c) { return OK; }

EXPORT Status FMI(fmi2ExitInitializationMode)(void *c)
{
    ((Slave *) c)->memory.running = 1;
    return OK;
}

EXPORT Status FMI(fmi2Terminate)(void *c) { return OK; }

EXPORT Status FMI(fmi2Reset)(void *c)
{
    memset(&((Slave *) c)->memory, 0, sizeof(Memory));
    return OK;
}

/* ------------------------- values: inputs first, then states, outputs, where states start, and their derivatives */

#define FIRST_STATE INPUTS
#define FIRST_OUTPUT (INPUTS + STATES)
#define FIRST_START (FIRST_OUTPUT + OUTPUTS)
#define FIRST_DERIVATIVE (FIRST_START + STATES)
#define VARIABLES (FIRST_DERIVATIVE + (CONTINUOUS ? STATES : 0))

EXPORT Status FMI(fmi2GetReal)(void *c, const Reference reference[], size_t n, double value[])
{
    const Slave *slave = c;
    size_t i;
    for (i = 0; i < n; i++) {
        Reference r = reference[i];
        if (r >= VARIABLES) return refused(slave, "no variable has this value reference");
        if (r < FIRST_STATE) value[i] = slave->memory.u[r];
        else if (r < FIRST_OUTPUT) value[i] = slave->memory.z[r - FIRST_STATE];
        else if (r < FIRST_START) value[i] = output(&slave->memory, (int) (r - FIRST_OUTPUT));
        else if (r < FIRST_DERIVATIVE) value[i] = slave->memory.start[r - FIRST_START];
#if CONTINUOUS
        else value[i] = derivative(&slave->memory, (int) (r - FIRST_DERIVATIVE));
#endif
    }
    return OK;
}

EXPORT Status FMI(fmi2SetReal)(void *c, const Reference reference[], size_t n, const double value[])
{
    Slave *slave = c;
    size_t i;
    for (i = 0; i < n; i++) {
        Reference r = reference[i];
        if (r >= INPUTS && (r < FIRST_START || r >= FIRST_DERIVATIVE))
            return refused(slave, "only inputs and the start of states can be set");
        if (r >= INPUTS && slave->memory.running) return refused(slave, "a start can be set before the first step only");
        if (r < INPUTS) slave->memory.u[r] = value[i];
        else slave->memory.z[r - FIRST_START] = slave->memory.start[r - FIRST_START] = value[i];
    }
    return OK;
}

#define NONE(name, type) \
    EXPORT Status FMI(name)(void *c, const Reference reference[], size_t n, type value[]) { return n ? ERROR : OK; }
NONE(fmi2GetInteger, int)
NONE(fmi2SetInteger, const int)
NONE(fmi2GetBoolean, Boolean)
NONE(fmi2SetBoolean, const Boolean)
NONE(fmi2GetString, String)
NONE(fmi2SetString, const String)

/* ------------------------------------------------------------------------------------------------------ stepping */

EXPORT Status FMI(fmi2DoStep)(void *c, double now, double size, Boolean no_return)
{
    Slave *slave = c;
    if (!(size >= 0.0 && size < 1e9 * STEP)) return refused(slave, "the communication step is negative or too long");
    if (!advance(&slave->memory, size)) return refused(slave, "the communication step is no multiple of the model's");
    return OK;
}

EXPORT Status FMI(fmi2CancelStep)(void *c) { return ERROR; }

#define NO_STATUS(name, type) \
    EXPORT Status FMI(name)(void *c, int kind, type *value) { return DISCARD; }
NO_STATUS(fmi2GetStatus, Status)
NO_STATUS(fmi2GetRealStatus, double)
NO_STATUS(fmi2GetIntegerStatus, int)
NO_STATUS(fmi2GetBooleanStatus, Boolean)
NO_STATUS(fmi2GetStringStatus, String)

EXPORT Status FMI(fmi2SetRealInputDerivatives)(void *c, const Reference r[], size_t n, const int order[],
                                               const double value[])
{
    return n ? ERROR : OK;
}

EXPORT Status FMI(fmi2GetRealOutputDerivatives)(void *c, const Reference r[], size_t n, const int order[],
                                                double value[])
{
    return n ? ERROR : OK;
}

/* The entry of A, B, C or D by which a derivative or an output depends on a state or an input; *fits where it does. */
static double entry(Reference unknown, Reference known, int *fits)
{
    int row, is_output = unknown >= FIRST_OUTPUT && unknown < FIRST_START;
    *fits = known < FIRST_OUTPUT && unknown < VARIABLES && (is_output || unknown >= FIRST_DERIVATIVE);
    if (!*fits) return 0.0;
    row = (int) (unknown - (is_output ? FIRST_OUTPUT : FIRST_DERIVATIVE));
#if CONTINUOUS
    if (!is_output) return known < INPUTS ? B[row][known] : A[row][known - FIRST_STATE];
#endif
    return known < INPUTS ? D[row][known] : C[row][known - FIRST_STATE];
}

EXPORT Status FMI(fmi2GetDirectionalDerivative)(void *c, const Reference unknown[], size_t n, const Reference known[],
                                                size_t m, const double change[], double value[])
{
    size_t i, k;
    int fits;
    for (i = 0; i < n; i++) {
        value[i] = 0.0;
        for (k = 0; k < m; k++) {
            value[i] += entry(unknown[i], known[k], &fits) * change[k];
            if (!fits) return refused(c, "derivatives are of outputs and rates by inputs and states");
        }
    }
    return OK;
}

/* ------------------------------------------------------------------------------------------------ model exchange */

typedef struct {
    Boolean again, ends, nominals_changed, states_changed, next_is_defined;
    double next;
} Events;

EXPORT Status FMI(fmi2EnterEventMode)(void *c) { return OK; }

EXPORT Status FMI(fmi2NewDiscreteStates)(void *c, Events *events)
{
    memset(events, 0, sizeof *events);
    return OK;
}

EXPORT Status FMI(fmi2EnterContinuousTimeMode)(void *c) { return OK; }

EXPORT Status FMI(fmi2CompletedIntegratorStep)(void *c, Boolean keeps, Boolean *enter_event_mode, Boolean *terminate)
{
    *enter_event_mode = *terminate = 0;
    return OK;
}

EXPORT Status FMI(fmi2SetTime)(void *c, double time) { return OK; }

EXPORT Status FMI(fmi2GetEventIndicators)(void *c, double value[], size_t n) { return n ? ERROR : OK; }

EXPORT Status FMI(fmi2SetContinuousStates)(void *c, const double value[], size_t n)
{
    if (n != STATES) return refused(c, "there are as many values as states");
    memcpy(((Slave *) c)->memory.z, value, n * sizeof *value);
    return OK;
}

EXPORT Status FMI(fmi2GetContinuousStates)(void *c, double value[], size_t n)
{
    if (n != STATES) return refused(c, "there are as many values as states");
    memcpy(value, ((Slave *) c)->memory.z, n * sizeof *value);
    return OK;
}

EXPORT Status FMI(fmi2GetNominalsOfContinuousStates)(void *c, double value[], size_t n)
{
    while (n--) value[n] = 1.0;
    return OK;
}

EXPORT Status FMI(fmi2GetDerivatives)(void *c, double value[], size_t n)
{
#if CONTINUOUS
    if (n == STATES) {
        while (n--) value[n] = derivative(&((Slave *) c)->memory, (int) n);
        return OK;
    }
#endif
    return refused(c, CONTINUOUS ? "there are as many derivatives as states" : "a sampled model has no derivatives");
}

/* ------------------------------------------------------------------------------------------ keeping and going back */

EXPORT Status FMI(fmi2GetFMUstate)(void *c, void **kept)
{
    if (!*kept) *kept = malloc(sizeof(Memory));
    if (!*kept) return ERROR;
    memcpy(*kept, &((Slave *) c)->memory, sizeof(Memory));
    return OK;
}

EXPORT Status FMI(fmi2SetFMUstate)(void *c, void *kept)
{
    memcpy(&((Slave *) c)->memory, kept, sizeof(Memory));
    return OK;
}

EXPORT Status FMI(fmi2FreeFMUstate)(void *c, void **kept)
{
    free(*kept);
    *kept = NULL;
    return OK;
}

EXPORT Status FMI(fmi2SerializedFMUstateSize)(void *c, void *kept, size_t *size)
{
    *size = sizeof(Memory);
    return OK;
}

EXPORT Status FMI(fmi2SerializeFMUstate)(void *c, void *kept, char bytes[], size_t size)
{
    if (size < sizeof(Memory)) return ERROR;
    memcpy(bytes, kept, sizeof(Memory));
    return OK;
}

EXPORT Status FMI(fmi2DeSerializeFMUstate)(void *c, const char bytes[], size_t size, void **kept)
{
    if (size != sizeof(Memory)) return ERROR;
    *kept = malloc(sizeof(Memory));
    if (!*kept) return ERROR;
    memcpy(*kept, bytes, sizeof(Memory));
    return OK;
}
