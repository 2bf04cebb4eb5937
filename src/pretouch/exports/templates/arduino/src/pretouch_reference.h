// Writes the reference of the law to a drive. Define REFERENCE and its settings before.
#pragma once

#include "pretouch_loop.h"

#if REFERENCE == PRETOUCH_LOG_ONLY

inline void pretouch_start_reference() {}
inline bool pretouch_write_reference(const pretouch_output &) { return true; }
inline void pretouch_move(uint32_t) {}

#elif REFERENCE == PRETOUCH_STEP_DIRECTION

// Follows the position with pulses, which are spread over the control period. A pulse waits while a sensor is read.
static long pretouch_steps, pretouch_steps_wanted;
static uint32_t pretouch_step_interval, pretouch_last_step;

inline void pretouch_start_reference() {
  pinMode(STEP_PIN, OUTPUT);
  pinMode(DIRECTION_PIN, OUTPUT);
  pretouch_steps = pretouch_steps_wanted = 0;
}

inline bool pretouch_write_reference(const pretouch_output &output) {
  pretouch_steps_wanted = lroundf(STEPS_PER_METER * output.position);
  const long count = labs(pretouch_steps_wanted - pretouch_steps);
  pretouch_step_interval = count > 0 ? PRETOUCH_PERIOD_US / count : 0;
  return true;
}

inline void pretouch_move(uint32_t now) {
  if (pretouch_steps == pretouch_steps_wanted || now - pretouch_last_step < pretouch_step_interval) return;
  const bool is_forward = pretouch_steps_wanted > pretouch_steps;
  digitalWrite(DIRECTION_PIN, is_forward ? HIGH : LOW);
  digitalWrite(STEP_PIN, HIGH);
  delayMicroseconds(2);
  digitalWrite(STEP_PIN, LOW);
  pretouch_steps += is_forward ? 1 : -1;
  pretouch_last_step = now;
}

#elif REFERENCE == PRETOUCH_SERVO

#include <Servo.h>

static Servo pretouch_servo;

inline bool pretouch_write_reference(const pretouch_output &output) {
  const float wanted = REFERENCE_IS_VELOCITY ? output.velocity : output.position;
  const float pulse = SERVO_CENTER_US + SERVO_US_PER_UNIT * wanted;
  pretouch_servo.writeMicroseconds((int)lroundf(fminf(fmaxf(pulse, SERVO_LEAST_US), SERVO_MOST_US)));
  return SERVO_LEAST_US <= pulse && pulse <= SERVO_MOST_US;
}

inline void pretouch_start_reference() {
  pretouch_servo.attach(SERVO_PIN);
  pretouch_servo.writeMicroseconds(SERVO_CENTER_US);
}
inline void pretouch_move(uint32_t) {}

#elif REFERENCE == PRETOUCH_SERIAL || REFERENCE == PRETOUCH_CAN

inline void pretouch_move(uint32_t) {}

#if REFERENCE == PRETOUCH_SERIAL

inline void pretouch_start_reference() { REFERENCE_PORT.begin(REFERENCE_BAUD); }

// Writes a line: position [um] and velocity [um/s]. A line for which there is no room is left out.
inline bool pretouch_write_reference(const pretouch_output &output) {
  if (REFERENCE_PORT.availableForWrite() < 24) return false;
  REFERENCE_PORT.print(lroundf(REFERENCE_SIGN * 1e6f * output.position));
  REFERENCE_PORT.print(',');
  REFERENCE_PORT.println(lroundf(REFERENCE_SIGN * 1e6f * output.velocity));
  return true;
}

#else

bool send_can_frame(uint32_t id, const uint8_t *bytes, uint8_t length);  // in your sketch

inline void pretouch_start_reference() {}

// Sends 8 bytes: position [um] and velocity [um/s], each as an integer of 32 bits with its low byte first.
inline bool pretouch_write_reference(const pretouch_output &output) {
  const uint32_t values[2] = {(uint32_t)lroundf(REFERENCE_SIGN * 1e6f * output.position),
                              (uint32_t)lroundf(REFERENCE_SIGN * 1e6f * output.velocity)};
  uint8_t bytes[8];
  for (uint8_t i = 0; i < 8; i++) bytes[i] = (uint8_t)(values[i / 4] >> (8 * (i % 4)));
  return send_can_frame(CAN_ID, bytes, 8);
}

#endif

#else
#error REFERENCE: choose one of the outputs in pretouch_settings.h
#endif
