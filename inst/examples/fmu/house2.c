/* The house by the functions of FMI 2.0 for co-simulation. */
#include "house.h"

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef void Logger(void* environment, const char* name, int status, const char* category, const char* message, ...);
typedef struct {
  Logger* logger;
  void* (*allocate)(size_t, size_t);
  void (*release)(void*);
  void (*step_finished)(void*, int);
  void* environment;
} Callbacks;

enum { OK, WARNING, DISCARD, ERROR, FATAL };

EXPORT const char* fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char* fmi2GetVersion(void) { return "2.0"; }

EXPORT void* fmi2Instantiate(const char* name, int kind, const char* guid, const char* resources,
                             const Callbacks* callbacks, int visible, int logging) {
  (void)visible, (void)logging;
  const int ours = kind == 1 && strcmp(guid, "{house}") == 0 && strncmp(resources, "file:///", 8) == 0;
  House* house = ours ? house_new(resources + 7) : NULL;
  if (house == NULL) {
    callbacks->logger(callbacks->environment, name, ERROR, "logStatusError", "no start in %s", resources);
  }
  return house;
}

EXPORT void fmi2FreeInstance(void* house) { free(house); }
EXPORT int fmi2SetDebugLogging(void* house, int on, size_t n, const char* const* categories) {
  (void)house, (void)on, (void)n, (void)categories;
  return OK;
}
EXPORT int fmi2SetupExperiment(void* house, int has_tolerance, double tolerance, double start, int has_stop,
                               double stop) {
  (void)house, (void)has_tolerance, (void)tolerance;
  return has_stop && stop < start ? ERROR : OK;
}
EXPORT int fmi2EnterInitializationMode(void* house) { (void)house; return OK; }
EXPORT int fmi2ExitInitializationMode(void* house) { (void)house; return OK; }
EXPORT int fmi2Terminate(void* house) { (void)house; return OK; }
EXPORT int fmi2Reset(void* house) { house_reset(house); return OK; }

EXPORT int fmi2SetReal(void* house, const unsigned* reference, size_t n, const double* value) {
  for (size_t i = 0; i < n; ++i) {
    if (reference[i] >= N_VALUES) return ERROR;
    ((House*)house)->value[reference[i]] = value[i];
  }
  return OK;
}

EXPORT int fmi2GetReal(void* house, const unsigned* reference, size_t n, double* value) {
  for (size_t i = 0; i < n; ++i) {
    if (reference[i] >= N_VALUES) return ERROR;
    value[i] = ((House*)house)->value[reference[i]];
  }
  return OK;
}

EXPORT int fmi2SetBoolean(void* house, const unsigned* reference, size_t n, const int* value) {
  if (n != 1 || reference[0] != 0) return ERROR;
  ((House*)house)->heating_allowed = value[0];
  return OK;
}

EXPORT int fmi2DoStep(void* house, double time, double length, int no_return) {
  (void)time, (void)no_return;
  if (length <= 0) return ERROR;
  if (((House*)house)->value[FAULT] == 6) return DISCARD;
  if (((House*)house)->value[FAULT] == 7) {
    free(house); /* nothing may be called after it */
    return FATAL;
  }
  house_step(house, length);
  return OK;
}
