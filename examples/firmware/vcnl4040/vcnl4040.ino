// Prints the proximity of a Vishay VCNL4040, one number per line, 200 times per second.
//
// Registers: Vishay data sheet 84274, Rev. 1.4. Address 0x60 ("Digital Interface"). All registers have two bytes, the
// low byte first, and are read after a repeated start (figure 12). Registers 0x03, 0x04, 0x08 and 0x0C: table 1.

#include <Wire.h>

const unsigned long BAUD = 115200;
const unsigned long PERIOD_US = 5000;  // the shortest measuring period, with the duty 1/40 and a pulse of 1 T

unsigned long due;

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

void wait_for_sensor() {
  while (!start_sensor()) {
    Serial.println(F("VCNL4040 does not answer: check wiring and supply"));
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
  uint16_t value;
  if (read_register(PS_DATA, value)) {
    Serial.println(value);
  } else {
    wait_for_sensor();
  }
}
