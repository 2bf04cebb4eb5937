// Runs a sketch on a simulated board: ADDRESS REGISTER_BYTES LOOPS [REGISTER=VALUE ...], numbers in hexadecimal.
// With LOOPS 0, standard input says what happens: lines TIME_US WHAT VALUE, until "end". Time begins at START_US.
#include "Arduino.h"
#include "Wire.h"
#include <stdlib.h>
#include <string.h>

unsigned long now_us = 0;
Port Serial, Serial1;
Bus Wire;
static unsigned conversions = 0;

void digitalWrite(int pin, int value) { printf("pin %d %d @%lu\n", pin, value, now_us); }

static int voltage = -1;  // at the pin, in counts; -1 for one more with each conversion
float own_reading = 0;    // of a sensor of the user

int analogRead(int pin) { return now_us += 112, pin != A0 ? -1 : voltage >= 0 ? voltage : 100 + (int)conversions++; }

void Bus::write(uint8_t value) {
  if (sent == 0) {
    start = value;
  } else if (to == address) {
    const int at = sent - 1;
    memory[(start + at / register_bytes) & 0xFF][at % register_bytes] = value;
    printf("write %02x %02x\n", (start + at / register_bytes) & 0xFF, value);
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

// Runs the sketch while events happen at their times after the setup [us].
static void play() {
  const unsigned long start = now_us;
  unsigned long time;
  char what[16];
  double value;
  while (scanf("%lu %15s %lf", &time, what, &value) == 3) {
    while (now_us < start + time) loop();
    if (!strcmp(what, "end")) return;
    if (!strcmp(what, "late")) now_us += (unsigned long)value;
    if (!strcmp(what, "silent")) Wire.address = -1;
    if (!strcmp(what, "analog")) voltage = (int)value;
    if (!strcmp(what, "own")) own_reading = (float)value;
    if (!strncmp(what, "word", 4)) {  // two bytes, the high one first
      const long place = strtol(what + 4, nullptr, 16);
      Wire.memory[place][0] = (uint8_t)((int)value >> 8);
      Wire.memory[place + 1][0] = (uint8_t)(int)value;
    }
  }
}

int main(int count, char **words) {
  Wire.address = strtol(words[1], nullptr, 16);
  Wire.register_bytes = atoi(words[2]);
  const int loops = atoi(words[3]);
  for (int i = 4; i < count; i++) {
    char *value;
    const long place = strtol(words[i], &value, 16), number = strtol(value + 1, nullptr, 16);
    Wire.memory[place][0] = number & 0xFF;
    Wire.memory[place][1] = number >> 8;
  }
  if (getenv("START_US") != nullptr) now_us = strtoul(getenv("START_US"), nullptr, 10);
  setup();
  if (loops == 0) play();
  for (int i = 0; i < loops; i++) loop();
}
