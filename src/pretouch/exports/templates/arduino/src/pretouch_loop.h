// Times the control law of pretouch_design.h: runs it once per period, hands over readings with their age, makes up for
// periods that were missed, and holds the reference when readings stop.
//
// Call `start` once and `run` as often as possible. Nothing here waits, allocates memory or needs an interrupt.
#pragma once

#include <Arduino.h>
#include <math.h>
#include <string.h>

#include "pretouch_design.h"
#include "pretouch_settings.h"

struct pretouch_reading {
  float value;        // raw output of the sensor, or its distance [mm] if the design has a sensor of distances
  bool is_new;        // whether the sensor had another reading
  bool is_no_object;  // the sensor reports that it sees no object; the value does not count
};

#if PRETOUCH_MEASURES_DISTANCE
#include "pretouch_curve.h"
#endif

class PretouchLoop {
 public:
  pretouch_sample sample;  // set contact_force and reference_position, _velocity and _acceleration here if you have them
  pretouch_output output;  // the reference of this period
  uint32_t overruns = 0;   // periods that began too late; the law computed them without a reading
  bool is_stopped = false;  // readings stopped: the reference holds
  bool has_used_reading = false;  // whether the law used a reading in this period
  float used_value = 0;           // that reading
  uint32_t used_time = 0;         // and when it became available [us]

  PretouchLoop() { clear(); }

  // Starts the law at rest; its first period begins at a time [us].
  void start(uint32_t time) {
    clear();
    due_ = time;
  }

  // Takes a reading that has just become available. The law uses it in the first period that begins after it.
  void take(uint32_t now, const pretouch_reading &reading) {
    if (!reading.is_new) return;
    // A period has begun that was not run yet, and takes the reading before: this one waits behind it.
    const bool is_behind = waiting_.reading.is_new && (int32_t)(now - due_) > 0;
    const Arrival arrival = {reading, now};
    (is_behind ? next_ : waiting_) = arrival;
  }

  // Runs the law if a period is due, and returns whether it did. Of several periods that are due, the last one takes the
  // reading; those before it run without one, so the law keeps the time by which readings are dated.
  bool run(uint32_t now) {
    if ((int32_t)(now - due_) < 0) return false;
    uint32_t missed = 0;
    uint32_t begin = advance();
    for (; (int32_t)(now - due_) >= 0; begin = advance()) missed++;
    overruns += missed;
    const uint32_t most = (uint32_t)(pretouch_design.sensing.timeout / pretouch_design.sensing.period) + 1;
    for (uint32_t i = missed < most ? missed : most; i > 0; i--) step(0);  // after the timeout, the sensor is lost
    if (next_.has_arrived(begin)) waiting_ = next_, next_.reading.is_new = false;
    has_used_reading = waiting_.has_arrived(begin);
    if (has_used_reading) {
      hand_over(begin);
    } else {
      step(0);
    }
    if (!waiting_.reading.is_new) waiting_ = next_, next_.reading.is_new = false;
    return true;
  }

  // Returns the longest time of a step on this board [us], from an approach and a retreat of 64 steps each.
  uint32_t longest_step() {
    uint32_t longest = 0;
    clear();
    for (int i = 0; i < 128; i++) {
      const float level = 1 + 0.05f * (i < 64 ? i : 128 - i);
      sample.reading = pretouch_design.sensing.offset + level * pretouch_design.sensing.floor;
      sample.age = 0;
      const uint32_t before = micros();
      step(1);
      const uint32_t spent = micros() - before;
      if (spent > longest) longest = spent;
    }
    clear();
    return longest;
  }

 private:
  pretouch_design_state state_;
  struct Arrival {
    pretouch_reading reading;
    uint32_t time;  // [us]
    bool has_arrived(uint32_t begin) const { return reading.is_new && (int32_t)(begin - time) >= 0; }
  };
  Arrival waiting_, next_;
  uint32_t due_ = 0, nanoseconds_ = 0;

  void clear() {
    memset(&sample, 0, sizeof sample);
    memset(&output, 0, sizeof output);
    waiting_.reading.is_new = next_.reading.is_new = false;
    overruns = 0;
    is_stopped = has_used_reading = false;
    pretouch_design_start(&state_);
  }

  // Moves on to the next period, and returns when the present one begins [us].
  uint32_t advance() {
    const uint32_t begin = due_;
    nanoseconds_ += PRETOUCH_PERIOD_NS;
    due_ += PRETOUCH_PERIOD_US + nanoseconds_ / 1000;
    nanoseconds_ %= 1000;
    return begin;
  }

  void hand_over(uint32_t begin) {
    used_value = waiting_.reading.value;
    used_time = waiting_.time;
    waiting_.reading.is_new = false;
    sample.age = PRETOUCH_LATENCY + 1e-6f * (float)(begin - waiting_.time);
    bool is_no_object = waiting_.reading.is_no_object;
#if PRETOUCH_MEASURES_DISTANCE
    const float distance = 1e-3f * waiting_.reading.value;
    is_no_object = is_no_object || distance > pretouch_curve_reach;
    sample.reading = (is_no_object ? 0 : pretouch_output_at(distance)) + pretouch_design.sensing.offset;
#else
    sample.reading = waiting_.reading.value;
#endif
    step(is_no_object ? PRETOUCH_NO_OBJECT : PRETOUCH_READING);  // after "no object", the law starts anew
  }

  void step(int32_t fresh) {
    if (is_stopped) {
      hold();
      return;
    }
    sample.fresh = fresh;
    pretouch_design_step(&state_, &sample, &output);
    is_stopped = (output.status & PRETOUCH_LOST) != 0;
  }

  // Stops the reference with the largest acceleration of the design, at once if it has no such limit.
  void hold() {
    const float period = pretouch_design.sensing.period;
    const float change = fminf(fabsf(output.velocity), period * pretouch_design.drive.limits.acceleration);
    const float before = output.velocity;
    output.velocity -= copysignf(change, before);
    output.acceleration = -copysignf(change, before) / period;
    output.position += period * (before + output.velocity) / 2;
    output.virtual_force = 0;
  }
};
