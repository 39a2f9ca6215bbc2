/* An FMU of both versions with a variable of every type. `sum` adds what all versions have, the text by its bytes and
 * the flag as 1000; `sizes` adds the types of FMI 3.0 alone. With MARK its library writes a file when it is loaded. */
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { REAL, SUM, SIZES };                                  /* references of reals */
enum { WHOLE, CHOICE, COUNT };                              /* of Integers and Enumerations of FMI 2.0 */
enum { FLAG = 30, TEXT = 40 };
enum { OK, WARNING, DISCARD, ERROR };

typedef struct {
  double real, sizes;
  double whole[3];
  bool flag;
  size_t bytes;
} Types;

#ifdef MARK
__attribute__((constructor)) static void loaded(void) {
  FILE* file = fopen(MARK, "w");
  if (file != NULL) fclose(file);
}
#endif

static double total(const Types* t) {
  return t->real + t->whole[0] + t->whole[1] + t->whole[2] + (t->flag ? 1000 : 0) + (double)t->bytes;
}

/* ---- FMI 2.0 */

const char* fmi2GetVersion(void) { return "2.0"; }
void* fmi2Instantiate(const char* name, int kind, const char* guid, const char* resources, const void* callbacks,
                      int visible, int logging) {
  (void)name, (void)kind, (void)guid, (void)resources, (void)callbacks, (void)visible, (void)logging;
  return calloc(1, sizeof(Types));
}
void fmi2FreeInstance(void* t) { free(t); }
int fmi2SetupExperiment(void* t, int a, double b, double c, int d, double e) {
  return (void)t, (void)a, (void)b, (void)c, (void)d, (void)e, OK;
}
int fmi2EnterInitializationMode(void* t) { return (void)t, OK; }
int fmi2ExitInitializationMode(void* t) { return (void)t, OK; }
int fmi2Terminate(void* t) { return (void)t, OK; }
int fmi2DoStep(void* t, double a, double b, int c) { return (void)t, (void)a, (void)b, (void)c, OK; }
int fmi2SetReal(void* t, const unsigned* r, size_t n, const double* x) {
  if (n != 1 || r[0] != REAL) return ERROR;
  ((Types*)t)->real = x[0];
  return OK;
}
int fmi2SetInteger(void* t, const unsigned* r, size_t n, const int* x) {
  if (n != 1 || r[0] > COUNT) return ERROR;
  ((Types*)t)->whole[r[0]] = x[0];
  return OK;
}
int fmi2SetBoolean(void* t, const unsigned* r, size_t n, const int* x) {
  if (n != 1 || r[0] != FLAG || (x[0] != 0 && x[0] != 1)) return ERROR;
  ((Types*)t)->flag = x[0];
  return OK;
}
int fmi2SetString(void* t, const unsigned* r, size_t n, const char* const* x) {
  if (n != 1 || r[0] != TEXT) return ERROR;
  ((Types*)t)->bytes = strlen(x[0]);
  return OK;
}
int fmi2GetReal(void* t, const unsigned* r, size_t n, double* x) {
  if (n != 1 || r[0] != SUM) return ERROR;
  x[0] = total(t);
  return OK;
}
int fmi2GetInteger(void* t, const unsigned* r, size_t n, int* x) {
  if (n != 1 || r[0] > COUNT) return ERROR;
  x[0] = (int)((Types*)t)->whole[r[0]];
  return OK;
}

/* ---- FMI 3.0: references of the other types do not matter. */

const char* fmi3GetVersion(void) { return "3.0"; }
void* fmi3InstantiateCoSimulation(const char* name, const char* token, const char* resources, bool visible,
                                  bool logging, bool event_mode, bool early_return, const uint32_t* required,
                                  size_t n_required, void* environment, void* log, void* update) {
  (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)event_mode, (void)early_return;
  (void)required, (void)n_required, (void)environment, (void)log, (void)update;
  return calloc(1, sizeof(Types));
}
void fmi3FreeInstance(void* t) { free(t); }
int fmi3EnterInitializationMode(void* t, bool a, double b, double c, bool d, double e) {
  return (void)t, (void)a, (void)b, (void)c, (void)d, (void)e, OK;
}
int fmi3ExitInitializationMode(void* t) { return (void)t, OK; }
int fmi3Terminate(void* t) { return (void)t, OK; }
int fmi3DoStep(void* t, double a, double b, bool c, bool* event, bool* ends, bool* early, double* reached) {
  (void)t, (void)c;
  *event = *ends = *early = false;
  *reached = a + b;
  return OK;
}

#define ADD(name, type)                                                                                  \
  int fmi3Set##name(void* t, const uint32_t* r, size_t n, const type* x, size_t m) {                     \
    (void)r;                                                                                             \
    if (n != 1 || m != 1) return ERROR;                                                                  \
    ((Types*)t)->sizes += (double)x[0];                                                                  \
    return OK;                                                                                           \
  }
ADD(Float32, float)
ADD(Int8, int8_t)
ADD(UInt8, uint8_t)
ADD(Int16, int16_t)
ADD(UInt16, uint16_t)
ADD(UInt32, uint32_t)
ADD(UInt64, uint64_t)

int fmi3SetFloat64(void* t, const uint32_t* r, size_t n, const double* x, size_t m) {
  return m == 1 ? fmi2SetReal(t, r, n, x) : ERROR;
}
int fmi3SetInt32(void* t, const uint32_t* r, size_t n, const int32_t* x, size_t m) {
  return m == 1 ? fmi2SetInteger(t, r, n, x) : ERROR;
}
int fmi3SetInt64(void* t, const uint32_t* r, size_t n, const int64_t* x, size_t m) {
  if (n != 1 || m != 1) return ERROR;
  if (r[0] == CHOICE) ((Types*)t)->whole[CHOICE] = (double)x[0];
  else ((Types*)t)->sizes += (double)x[0];
  return OK;
}
int fmi3SetBoolean(void* t, const uint32_t* r, size_t n, const bool* x, size_t m) {
  if (n != 1 || m != 1 || r[0] != FLAG) return ERROR;
  ((Types*)t)->flag = x[0];
  return OK;
}
int fmi3SetString(void* t, const uint32_t* r, size_t n, const char* const* x, size_t m) {
  return m == 1 ? fmi2SetString(t, r, n, x) : ERROR;
}
int fmi3GetFloat64(void* t, const uint32_t* r, size_t n, double* x, size_t m) {
  if (n != 1 || m != 1) return ERROR;
  x[0] = r[0] == SIZES ? ((Types*)t)->sizes : total(t);
  return OK;
}
int fmi3GetInt32(void* t, const uint32_t* r, size_t n, int32_t* x, size_t m) {
  return m == 1 ? fmi2GetInteger(t, r, n, x) : ERROR;
}
