// An I2C bus with one simulated sensor, whose registers have one byte, or two bytes with the low byte first.
#pragma once
#include <stdint.h>

struct Bus {
  int address = 0, register_bytes = 1, taken = 0, to = 0, sent = 0, start = 0;
  bool repeated = false;
  uint8_t memory[256][2] = {}, out[32] = {};
  void begin() {}
  void setClock(unsigned long) {}
  void beginTransmission(int target) { to = target, sent = 0; }
  void write(uint8_t value);
  int endTransmission(bool stop = true);
  int requestFrom(uint8_t target, uint8_t count);
  int read();
};
extern Bus Wire;
