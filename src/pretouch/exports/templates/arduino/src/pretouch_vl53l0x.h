// Reads the ST VL53L0X.
//
// The data sheet DS11555 (section 3.2) gives the address 0x29 and the identity 0xEE in register 0xC0. It describes no
// other register. The registers of a single measurement and the distance at byte 10 are those that the Linux driver
// vl53l0x-i2c.c uses. The rate of returned photons at byte 6, in steps of 1/128 million per second, is as in the
// interface of ST (VL53L0X_GetRangingMeasurementData). The sensor runs with its settings after power-on.
#pragma once

#include <Wire.h>

#define PRETOUCH_SENSOR_NAME "VL53L0X"
#define PRETOUCH_MEASURING_US 40000UL  // shortest time between two readings
#define PRETOUCH_POLL_US 2000UL
#define PRETOUCH_SHORTEST_MEASUREMENT_US 30000UL

namespace pretouch_part {

// ---- driver: the same lines as in pretouch's firmware for recording ----

const uint8_t ADDRESS = 0x29;
const uint8_t SYSRANGE_START = 0x00;
const uint8_t SYSTEM_INTERRUPT_CLEAR = 0x0B;
const uint8_t RESULT_RANGE_STATUS = 0x14;  // 12 bytes; bit 0 of the first: a measurement is complete
const uint8_t MODEL = 0xC0;

bool write_register(uint8_t code, uint8_t value) {
  Wire.beginTransmission(ADDRESS);
  Wire.write(code);
  Wire.write(value);
  return Wire.endTransmission() == 0;
}

bool read_registers(uint8_t code, uint8_t *values, uint8_t count) {
  Wire.beginTransmission(ADDRESS);
  Wire.write(code);
  if (Wire.endTransmission(false) != 0) return false;
  if (Wire.requestFrom(ADDRESS, count) != count) return false;
  for (uint8_t i = 0; i < count; i++) values[i] = Wire.read();
  return true;
}

bool start_sensor() {
  uint8_t model = 0;
  return read_registers(MODEL, &model, 1) && model == 0xEE;
}

bool start_measurement() { return write_register(SYSRANGE_START, 0x01); }

bool read_measurement(bool &complete, uint16_t &signal, uint16_t &distance) {
  uint8_t bytes[12];
  if (!read_registers(RESULT_RANGE_STATUS, bytes, 12)) return false;
  complete = (bytes[0] & 1) != 0;
  signal = ((uint16_t)bytes[6] << 8) | bytes[7];
  distance = ((uint16_t)bytes[10] << 8) | bytes[11];
  return !complete || write_register(SYSTEM_INTERRUPT_CLEAR, 0x01);
}

// ---- end of the driver ----

}  // namespace pretouch_part

inline bool pretouch_start_sensor() {
  Wire.begin();
  Wire.setClock(400000);
  return pretouch_part::start_sensor();
}

// Starts a measurement once per period, and asks every PRETOUCH_POLL_US whether it is complete: nothing waits for it.
inline bool pretouch_read_sensor(uint32_t now, pretouch_reading &reading) {
  static bool is_measuring = false;
  static uint32_t started = now - PRETOUCH_SENSOR_PERIOD_US;
  reading.is_new = false;
  if (!is_measuring) {
    if (now - started < PRETOUCH_SENSOR_PERIOD_US) return true;
    started = now;
    return is_measuring = pretouch_part::start_measurement();
  }
  if (now - started < PRETOUCH_SHORTEST_MEASUREMENT_US) return true;
  bool complete = false;
  uint16_t signal = 0, distance = 0;
  if (!pretouch_part::read_measurement(complete, signal, distance)) return is_measuring = false;
  if (!complete) return true;
  is_measuring = false;
  reading.is_new = true;
#if PRETOUCH_MEASURES_DISTANCE
  reading.value = distance;  // [mm]
  reading.is_no_object = distance >= 8190;  // 8190 and 8191 without a target
  reading.is_new = distance != 65535;  // the measurement failed
#else
  reading.value = signal;
#endif
  return true;
}
