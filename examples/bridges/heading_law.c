/* SPDX-License-Identifier: Apache-2.0 */
/* A heading law as a co-simulation FMU: one step is one tick. N = kp e + ki I + kd (r_d - r), I gains T e at each tick.
 * fmu_controller.py compiles it with -DFMI=2 or -DFMI=3, and adds the functions of the standard that it does not need. */
#include <stdlib.h>

/* Value references, as modelDescription.xml has them. */
enum { HEADING_ERROR, RATE_ERROR, MOMENT, KP, KI, KD, INTEGRAL, NUMBERS };
enum { OK = 0, ERROR = 3 };

static double *make(void) {
    double *x = calloc(NUMBERS, sizeof(double));
    if (x) { x[KP] = 3.0; x[KI] = 0.5; x[KD] = 2.0; }
    return x;
}

static int set(double *x, const unsigned *where, size_t count, const double *values) {
    for (size_t i = 0; i < count; i++) {
        if (where[i] >= NUMBERS) return ERROR;
        x[where[i]] = values[i];
    }
    return OK;
}

static int get(const double *x, const unsigned *where, size_t count, double *values) {
    for (size_t i = 0; i < count; i++) {
        if (where[i] >= NUMBERS) return ERROR;
        values[i] = x[where[i]];
    }
    return OK;
}

static int step(double *x, double length) {
    x[MOMENT] = x[KP] * x[HEADING_ERROR] + x[KI] * x[INTEGRAL] + x[KD] * x[RATE_ERROR];
    x[INTEGRAL] += length * x[HEADING_ERROR];
    return OK;
}

#if FMI == 2
void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *folder, const void *calls, int seen, int log) {
    return make();
}
void fmi2FreeInstance(void *x) { free(x); }
int fmi2SetupExperiment(void *x, int has, double tolerance, double start, int ends, double stop) { return OK; }
int fmi2EnterInitializationMode(void *x) { return OK; }
int fmi2ExitInitializationMode(void *x) { return OK; }
int fmi2Terminate(void *x) { return OK; }
int fmi2SetReal(void *x, const unsigned *where, size_t count, const double *v) { return set(x, where, count, v); }
int fmi2GetReal(void *x, const unsigned *where, size_t count, double *v) { return get(x, where, count, v); }
int fmi2DoStep(void *x, double t, double length, int never_back) { return step(x, length); }
#else
#include <stdbool.h>
void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *folder, bool seen, bool log, bool events,
                                  bool early, const unsigned *needed, size_t count, void *of, void *say, void *update) {
    return make();
}
void fmi3FreeInstance(void *x) { free(x); }
int fmi3EnterInitializationMode(void *x, bool has, double tolerance, double start, bool ends, double stop) { return OK; }
int fmi3ExitInitializationMode(void *x) { return OK; }
int fmi3Terminate(void *x) { return OK; }
int fmi3SetFloat64(void *x, const unsigned *where, size_t count, const double *v, size_t all) { return set(x, where, count, v); }
int fmi3GetFloat64(void *x, const unsigned *where, size_t count, double *v, size_t all) { return get(x, where, count, v); }
int fmi3DoStep(void *x, double t, double length, bool never_back, bool *event, bool *end, bool *early, double *last) {
    *event = *end = *early = false;
    *last = t + length;
    return step(x, length);
}
#endif
