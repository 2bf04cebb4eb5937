// What the sketches of examples/firmware/ use of Arduino, for a simulated board on which time passes with every call.
#pragma once
#include <cstdint>
#include <cstdio>
#include <cstdlib>

extern unsigned long now_us;

inline unsigned long micros() { return now_us += 4; }  // the resolution of an Arduino Uno
inline unsigned long millis() { return micros() / 1000; }
inline void delay(unsigned long ms) {  // a sketch that waits for its sensor ends after a minute
  if ((now_us += 1000 * ms) > 60000000) std::exit(3);
}
#define F(text) text
#define A0 14
int analogRead(int pin);

struct Port {
  void begin(unsigned long baud) { std::printf("%lu baud\n", baud); }
  void print(char c) { std::printf("%c", c); }
  void print(int number) { std::printf("%d", number); }
  void print(unsigned number) { std::printf("%u", number); }
  void println(const char *text) { std::printf("%s @%lu\n", text, now_us); }
  void println(unsigned number) { std::printf("%u @%lu\n", number, now_us); }
};
extern Port Serial;
