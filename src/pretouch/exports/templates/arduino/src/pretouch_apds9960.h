// Reads the Broadcom APDS-9960.
//
// Registers: Broadcom data sheet AV02-4191EN, "Register Set". Address 0x39. ENABLE 0x80, PPULSE 0x8E, CONTROL 0x8F, ID
// 0x92, PDATA 0x9C.
#pragma once

#include <Wire.h>

#define PRETOUCH_SENSOR_NAME "APDS-9960"
#define PRETOUCH_MEASURING_US 10000UL  // shortest time between two readings
#define PRETOUCH_POLL_US PRETOUCH_SENSOR_PERIOD_US

namespace pretouch_part {

// ---- driver: the same lines as in pretouch's firmware for recording ----

const uint8_t ADDRESS = 0x39;
const uint8_t ENABLE_REGISTER = 0x80;  // bit 0: power, bit 2: proximity
const uint8_t PPULSE = 0x8E;  // length of a pulse in bits 7:6, 1 for 8 us; number of pulses - 1 in bits 5:0
const uint8_t CONTROL_REGISTER = 0x8F;  // current in bits 7:6, 0 for 100 mA; proximity gain in bits 3:2, 1 for a factor of 2
const uint8_t ID = 0x92;  // 0xAB
const uint8_t PDATA = 0x9C;

bool write_register(uint8_t code, uint8_t value) {
  Wire.beginTransmission(ADDRESS);
  Wire.write(code);
  Wire.write(value);
  return Wire.endTransmission() == 0;
}

bool read_register(uint8_t code, uint8_t &value) {
  Wire.beginTransmission(ADDRESS);
  Wire.write(code);
  if (Wire.endTransmission(false) != 0) return false;
  if (Wire.requestFrom(ADDRESS, (uint8_t)1) != 1) return false;
  value = Wire.read();
  return true;
}

bool start_sensor() {
  uint8_t id = 0;
  return read_register(ID, id) && id == 0xAB && write_register(ENABLE_REGISTER, 0) && write_register(PPULSE, (1 << 6) | 7) &&
         write_register(CONTROL_REGISTER, 1 << 2) && write_register(ENABLE_REGISTER, (1 << 0) | (1 << 2));
}

// ---- end of the driver ----

}  // namespace pretouch_part

inline bool pretouch_start_sensor() {
  Wire.begin();
  Wire.setClock(400000);
  return pretouch_part::start_sensor();
}

inline bool pretouch_read_value(uint16_t &value) {
  uint8_t byte;
  if (!pretouch_part::read_register(pretouch_part::PDATA, byte)) return false;
  value = byte;
  return true;
}

inline bool pretouch_read_sensor(uint32_t, pretouch_reading &reading) {
  uint16_t value = 0;
  if (!pretouch_read_value(value)) return false;
  reading.value = value;
  reading.is_new = true;
  return true;
}
