// A servo on the simulated board: it prints the length of each pulse.
#pragma once
#include <stdio.h>

struct Servo {
  void attach(int pin) { printf("servo at pin %d\n", pin); }
  void writeMicroseconds(int us) { printf("pulse %d\n", us); }
};
