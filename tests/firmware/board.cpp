// Runs a sketch on a simulated board: ADDRESS REGISTER_BYTES LOOPS [REGISTER=VALUE ...], numbers in hexadecimal.
#include "Arduino.h"
#include "Wire.h"
#include <cstdlib>

unsigned long now_us = 0;
Port Serial;
Bus Wire;
static unsigned conversions = 0;

int analogRead(int pin) { return now_us += 112, pin == A0 ? 100 + (int)conversions++ : -1; }

void Bus::write(uint8_t value) {
  if (sent == 0) {
    start = value;
  } else if (to == address) {
    const int at = sent - 1;
    memory[(start + at / register_bytes) & 0xFF][at % register_bytes] = value;
    std::printf("write %02x %02x\n", (start + at / register_bytes) & 0xFF, value);
  }
  sent++;
}

int Bus::endTransmission(bool stop) {
  now_us += 25 * (sent + 1);  // nine clocks a byte at 400 kHz
  repeated = !stop;
  return to == address ? 0 : 2;
}

int Bus::requestFrom(uint8_t target, uint8_t count) {
  now_us += 25 * (count + 1);
  taken = 0;
  if (target != address || !repeated) return 0;  // the sensors need a repeated start
  for (int i = 0; i < count; i++) out[i] = memory[(start + i / register_bytes) & 0xFF][i % register_bytes];
  return count;
}

int Bus::read() { return out[taken++]; }

void setup();
void loop();

int main(int count, char **words) {
  Wire.address = std::strtol(words[1], nullptr, 16);
  Wire.register_bytes = std::atoi(words[2]);
  const int loops = std::atoi(words[3]);
  for (int i = 4; i < count; i++) {
    char *value;
    const long place = std::strtol(words[i], &value, 16), number = std::strtol(value + 1, nullptr, 16);
    Wire.memory[place][0] = number & 0xFF;
    Wire.memory[place][1] = number >> 8;
  }
  setup();
  for (int i = 0; i < loops; i++) loop();
}
