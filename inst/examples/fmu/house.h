/* A house of three nodes, the air, the walls and a heater, for FMUs of both versions of the standard.
 *
 *   C_air    dT_air/dt    = (T_wall - T_air) / R_in + (T_heater - T_air) / R_heater + (1 / R_air + leak) (Te - T_air)
 *                           + aperture Gv
 *   C_wall   dT_wall/dt   = (T_air - T_wall) / R_in + (Te - T_wall) / R_out
 *   C_heater dT_heater/dt = (T_air - T_heater) / R_heater + P
 *
 * Times in s, temperatures in degC, C in J/K, R in K/W, `leak` in W/K, `aperture` in m2, Gv in W/m2, P in W. Steps of
 * the classical Runge-Kutta method, of 30 s at most. */

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The number of a variable is its value reference. */
enum { C_AIR, C_WALL, C_HEATER, R_IN, R_OUT, R_HEATER, R_AIR, LEAK, APERTURE, FAULT, TE, GV, P, T_AIR, T_WALL,
       T_HEATER, N_VALUES };

typedef struct {
  double value[N_VALUES];
  double start;          /* the temperature in resources/start.txt */
  int heating_allowed;   /* a Boolean parameter */
} House;

static void house_reset(House* house) {
  const double value[N_VALUES] = {2e6, 3e7, 1e5, 0.005, 0.01, 0.01, 0.02, 0.0, 2.0, 0.0, 10.0, 0.0, 0.0};
  memcpy(house->value, value, sizeof value);
  house->value[T_AIR] = house->value[T_WALL] = house->value[T_HEATER] = house->start;
  house->heating_allowed = 1;
}

/* A house whose start is in a file of the folder `resources`; NULL if it cannot be read. */
static House* house_new(const char* resources) {
  char path[4096];
  House* house = calloc(1, sizeof *house);
  snprintf(path, sizeof path, "%s/start.txt", resources);
  FILE* file = fopen(path, "r");
  if (house == NULL || file == NULL || fscanf(file, "%lf", &house->start) != 1) {
    if (file != NULL) fclose(file);
    free(house);
    return NULL;
  }
  fclose(file);
  house_reset(house);
  return house;
}

static void house_slopes(const House* house, const double* t, double* slope) {
  const double* v = house->value;
  const double heat = house->heating_allowed ? v[P] : 0.0;
  const double to_wall = (t[0] - t[1]) / v[R_IN], to_heater = (t[0] - t[2]) / v[R_HEATER];
  slope[0] = ((1.0 / v[R_AIR] + v[LEAK]) * (v[TE] - t[0]) + v[APERTURE] * v[GV] - to_wall - to_heater) / v[C_AIR];
  slope[1] = (to_wall + (v[TE] - t[1]) / v[R_OUT]) / v[C_WALL];
  slope[2] = (to_heater + heat) / v[C_HEATER];
}

/* As far as 20 MB, and goes on without end. */
static void house_fill_disk(void) {
  FILE* file = fopen("filled.txt", "w");
  for (int i = 0; file != NULL && i < 2000000; ++i) fputs("012345678\n", file);
  if (file != NULL) fflush(file);
  for (;;) {}
}

/* What a faulty FMU does, by the value of `fault`: it crashes (1), never returns (2), leaves (3), writes where nothing
 * is (4), has no number (5), fills the disk (8), prints what its caller waits for (9), or does that and leaves (9.5). */
static void house_fault(House* house) {
  switch ((int)house->value[FAULT]) {
    case 1: abort();
    case 2: for (;;) {}
    case 3: exit(3);
    case 4: *(volatile int*)8 = 1; break;
    case 5: house->value[T_AIR] = strtod("nan", NULL); break;
    case 8: house_fill_disk(); break;
    case 9:
      puts("answered\nanswered 1");
      fflush(stdout);
      if (house->value[FAULT] > 9) exit(3);
  }
}

static void house_step(House* house, double length) {
  const int steps = 1 + (int)(length / 30.0);
  const double h = length / steps;
  double* t = house->value + T_AIR;
  house_fault(house);
  for (int i = 0; i < steps; ++i) {
    double k[4][3], at[3];
    for (int stage = 0; stage < 4; ++stage) {
      const double part = stage == 0 ? 0.0 : stage == 3 ? h : h / 2;
      for (int j = 0; j < 3; ++j) at[j] = t[j] + (stage == 0 ? 0.0 : part * k[stage - 1][j]);
      house_slopes(house, at, k[stage]);
    }
    for (int j = 0; j < 3; ++j) t[j] += h / 6 * (k[0][j] + 2 * k[1][j] + 2 * k[2][j] + k[3][j]);
  }
}
