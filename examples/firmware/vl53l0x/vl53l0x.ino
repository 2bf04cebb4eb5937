// Prints the signal rate and the distance in mm of an ST VL53L0X on each line, at most 25 times per second.
//
// The data sheet DS11555 (section 3.2) gives the address 0x29 and the identity 0xEE in register 0xC0. It describes no
// other register. The registers of a single measurement and the distance at byte 10 are those that the Linux driver
// vl53l0x-i2c.c uses. The rate of returned photons at byte 6, in steps of 1/128 million per second, is as in the
// interface of ST (VL53L0X_GetRangingMeasurementData). The sensor runs with its settings after power-on.

#include <Wire.h>

const unsigned long BAUD = 115200;
const unsigned long PERIOD_US = 40000;  // one measurement takes about 33 ms
const unsigned long LONGEST_MS = 200;

unsigned long due;

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

void wait_for_sensor() {
  while (!start_sensor()) {
    Serial.println(F("VL53L0X does not answer: check wiring and supply"));
    delay(1000);
  }
  due = micros();
}

bool measure(uint16_t &signal, uint16_t &distance) {
  bool complete = false;
  if (!start_measurement()) return false;
  const unsigned long start = millis();
  while (!complete) {
    if (millis() - start > LONGEST_MS || !read_measurement(complete, signal, distance)) return false;
  }
  return true;
}

void setup() {
  Serial.begin(BAUD);
  Wire.begin();
  Wire.setClock(400000);
  wait_for_sensor();
}

void loop() {
  due += PERIOD_US;
  while ((long)(due - micros()) > 0) {
  }
  uint16_t signal, distance;
  if (measure(signal, distance)) {
    Serial.print(signal);
    Serial.print(',');
    Serial.println(distance);
  } else {
    wait_for_sensor();
  }
}
