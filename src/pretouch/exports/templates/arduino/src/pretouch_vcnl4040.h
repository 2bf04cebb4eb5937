// Reads the Vishay VCNL4040.
//
// Registers: Vishay data sheet 84274, Rev. 1.4. Address 0x60 ("Digital Interface"). All registers have two bytes, the
// low byte first, and are read after a repeated start (figure 12). Registers 0x03, 0x04, 0x08 and 0x0C: table 1.
#pragma once

#include <Wire.h>

#define PRETOUCH_SENSOR_NAME "VCNL4040"
#define PRETOUCH_MEASURING_US 5000UL  // shortest time between two readings
#define PRETOUCH_POLL_US PRETOUCH_SENSOR_PERIOD_US

namespace pretouch_part {

// ---- driver: the same lines as in pretouch's firmware for recording ----

const uint8_t ADDRESS = 0x60;
const uint8_t PS_CONF1_2 = 0x03;  // low byte: duty in bits 7:6, pulse in bits 3:1, off in bit 0; high byte: 16 bits in bit 3
const uint8_t PS_CONF3_MS = 0x04;  // high byte: current of the emitter in bits 2:0, 7 for 200 mA
const uint8_t PS_DATA = 0x08;
const uint8_t ID = 0x0C;  // 0x86 in the low byte

bool write_register(uint8_t code, uint8_t low, uint8_t high) {
  Wire.beginTransmission(ADDRESS);
  Wire.write(code);
  Wire.write(low);
  Wire.write(high);
  return Wire.endTransmission() == 0;
}

bool read_register(uint8_t code, uint16_t &value) {
  Wire.beginTransmission(ADDRESS);
  Wire.write(code);
  if (Wire.endTransmission(false) != 0) return false;  // false: a repeated start follows
  if (Wire.requestFrom(ADDRESS, (uint8_t)2) != 2) return false;
  const uint8_t low = Wire.read();
  value = ((uint16_t)Wire.read() << 8) | low;
  return true;
}

bool start_sensor() {
  uint16_t id = 0;
  return read_register(ID, id) && (id & 0xFF) == 0x86 && write_register(PS_CONF1_2, 0x00, 0x08) &&
         write_register(PS_CONF3_MS, 0x00, 0x07);
}

// ---- end of the driver ----

}  // namespace pretouch_part

inline bool pretouch_start_sensor() {
  Wire.begin();
  Wire.setClock(400000);
  return pretouch_part::start_sensor();
}

inline bool pretouch_read_value(uint16_t &value) {
  return pretouch_part::read_register(pretouch_part::PS_DATA, value);
}

inline bool pretouch_read_sensor(uint32_t, pretouch_reading &reading) {
  uint16_t value = 0;
  if (!pretouch_read_value(value)) return false;
  reading.value = value;
  reading.is_new = true;
  return true;
}
