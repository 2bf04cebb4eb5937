// The sensor curve of this design, for sensors that report a distance instead of their output xi.
#pragma once

#include <math.h>

#ifdef __AVR__
#include <avr/pgmspace.h>
#define PRETOUCH_TABLE PROGMEM
#define PRETOUCH_ENTRY(i) pgm_read_float(&pretouch_curve[i])
#else
#define PRETOUCH_TABLE
#define PRETOUCH_ENTRY(i) pretouch_curve[i]
#endif

// $curve: ln xi at equal steps of the distance. Between the steps, ln xi is interpolated with an error
// of at most $curve_error.
static const float pretouch_curve_start = ${curve_start}f;  // smallest distance of the curve [m]
static const float pretouch_curve_step = ${curve_step}f;    // [m]
static const int pretouch_curve_steps = $curve_steps;
static const float pretouch_curve_reach = $curve_reach;  // [m]; there is no curve beyond, thus no object
static const float pretouch_curve[] PRETOUCH_TABLE = {
$curve_values
};

// Returns xi at a distance [m]. It is 0 beyond the curve, where nothing is detected, and constant before its start.
inline float pretouch_output_at(float distance) {
  if (isnan(distance)) return distance;
  const float place = (distance - pretouch_curve_start) / pretouch_curve_step;
  if (place > pretouch_curve_steps) return 0;
  if (!(place > 0)) return expf(PRETOUCH_ENTRY(0));
  const int before = place < pretouch_curve_steps ? (int)place : pretouch_curve_steps - 1;
  const float value = PRETOUCH_ENTRY(before);
  return expf(value + (place - before) * (PRETOUCH_ENTRY(before + 1) - value));
}
