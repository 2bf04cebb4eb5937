// Prints the proximity of a Broadcom APDS-9960, one number from 0 to 255 per line, 100 times per second.
//
// Registers: Broadcom data sheet AV02-4191EN, "Register Set". Address 0x39. ENABLE 0x80, PPULSE 0x8E, CONTROL 0x8F, ID
// 0x92, PDATA 0x9C.

#include <Wire.h>

const unsigned long BAUD = 115200;
const unsigned long PERIOD_US = 10000;

unsigned long due;

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

void wait_for_sensor() {
  while (!start_sensor()) {
    Serial.println(F("APDS-9960 does not answer: check wiring and supply"));
    delay(1000);
  }
  due = micros();
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
  uint8_t value;
  if (read_register(PDATA, value)) {
    Serial.println(value);
  } else {
    wait_for_sensor();
  }
}
