// Prints the proximity of a Vishay VCNL4010, one number per line, 250 times per second.
//
// Registers: Vishay data sheet 83462, Rev. 1.6. Address 0x13. Registers 0 (0x80, command), 1 (0x81, identity), 2 (0x82,
// proximity rate), 3 (0x83, current of the emitter), 7 and 8 (0x87 and 0x88, result, the high byte first).

#include <Wire.h>

const unsigned long BAUD = 115200;
const unsigned long PERIOD_US = 4000;

unsigned long due;

const uint8_t ADDRESS = 0x13;
const uint8_t COMMAND = 0x80;  // bit 0: measure by itself, bit 1: proximity, bit 5: a result is ready
const uint8_t IDENTITY = 0x81;  // 0x21: product 2, revision 1
const uint8_t PROXIMITY_RATE = 0x82;  // 7 for 250 per second; changed only while the sensor does not measure
const uint8_t CURRENT = 0x83;  // in steps of 10 mA, at most 20
const uint8_t RESULT = 0x87;

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
  uint8_t identity = 0;
  return read_registers(IDENTITY, &identity, 1) && identity == 0x21 && write_register(COMMAND, 0) &&
         write_register(PROXIMITY_RATE, 7) && write_register(CURRENT, 20) && write_register(COMMAND, 0x03);
}

void wait_for_sensor() {
  while (!start_sensor()) {
    Serial.println(F("VCNL4010 does not answer: check wiring and supply"));
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
  uint8_t bytes[2];
  if (read_registers(RESULT, bytes, 2)) {
    Serial.println(((uint16_t)bytes[0] << 8) | bytes[1]);
  } else {
    wait_for_sensor();
  }
}
