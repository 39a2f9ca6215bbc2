/* The house by the functions of FMI 3.0 for co-simulation. */
#include <stdint.h>

#include "house.h"

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef void LogMessage(void* environment, int status, const char* category, const char* message);

enum { OK, WARNING, DISCARD, ERROR, FATAL };

EXPORT const char* fmi3GetVersion(void) { return "3.0"; }

EXPORT void* fmi3InstantiateCoSimulation(const char* name, const char* token, const char* resources, bool visible,
                                         bool logging, bool event_mode, bool early_return, const uint32_t* required,
                                         size_t n_required, void* environment, LogMessage* log, void* update) {
  (void)name, (void)visible, (void)logging, (void)event_mode, (void)early_return, (void)required, (void)n_required;
  (void)update;
  House* house = strcmp(token, "{house}") == 0 ? house_new(resources) : NULL;
  if (house == NULL) log(environment, ERROR, "error", "no start in the resources");
  return house;
}

EXPORT void fmi3FreeInstance(void* house) { free(house); }
EXPORT int fmi3EnterInitializationMode(void* house, bool has_tolerance, double tolerance, double start, bool has_stop,
                                       double stop) {
  (void)house, (void)has_tolerance, (void)tolerance;
  return has_stop && stop < start ? ERROR : OK;
}
EXPORT int fmi3ExitInitializationMode(void* house) { (void)house; return OK; }
EXPORT int fmi3Terminate(void* house) { (void)house; return OK; }
EXPORT int fmi3Reset(void* house) { house_reset(house); return OK; }

EXPORT int fmi3SetFloat64(void* house, const uint32_t* reference, size_t n, const double* value, size_t n_values) {
  if (n != n_values) return ERROR;
  for (size_t i = 0; i < n; ++i) {
    if (reference[i] >= N_VALUES) return ERROR;
    ((House*)house)->value[reference[i]] = value[i];
  }
  return OK;
}

EXPORT int fmi3GetFloat64(void* house, const uint32_t* reference, size_t n, double* value, size_t n_values) {
  if (n != n_values) return ERROR;
  for (size_t i = 0; i < n; ++i) {
    if (reference[i] >= N_VALUES) return ERROR;
    value[i] = ((House*)house)->value[reference[i]];
  }
  return OK;
}

EXPORT int fmi3SetBoolean(void* house, const uint32_t* reference, size_t n, const bool* value, size_t n_values) {
  if (n != 1 || n_values != 1 || reference[0] != N_VALUES) return ERROR;
  ((House*)house)->heating_allowed = value[0];
  return OK;
}

EXPORT int fmi3DoStep(void* house, double time, double length, bool no_return, bool* event, bool* ends, bool* early,
                      double* reached) {
  (void)no_return;
  *event = *ends = *early = false;
  *reached = time + length;
  if (length <= 0) return ERROR;
  if (((House*)house)->value[FAULT] == 6) *ends = true;
  if (((House*)house)->value[FAULT] == 7) {
    free(house); /* nothing may be called after it */
    return FATAL;
  }
  house_step(house, length);
  return OK;
}
