// What our sketches use of Arduino, for a simulated board on which time passes with every call.
#pragma once
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

extern unsigned long now_us;

inline unsigned long micros() { return now_us += 4; }  // the resolution of an Arduino Uno
inline unsigned long millis() { return micros() / 1000; }
inline void delayMicroseconds(unsigned us) { now_us += us; }
inline void delay(unsigned long ms) {  // a sketch that waits for its sensor ends after a minute
  static unsigned long waited = 0;
  now_us += 1000 * ms;
  if ((waited += ms) >= 60000) exit(3);
}
class __FlashStringHelper;
#define F(text) ((const __FlashStringHelper *)(text))
#define A0 14
#define LOW 0
#define HIGH 1
#define OUTPUT 1
int analogRead(int pin);
inline void pinMode(int, int) {}
void digitalWrite(int pin, int value);

// The serial port: it sends BYTE_US per byte, and waits while its buffer is full. Each line ends with its time.
struct Port {
  unsigned long empty_at = 0, byte_us = 87;  // 115200 baud
  void begin(unsigned long baud) {
    byte_us = 10000000 / baud;
    printf("%lu baud\n", baud);
  }
  int availableForWrite() const { return 63 - (int)(now_us < empty_at ? (empty_at - now_us) / byte_us : 0); }
  void flush() { now_us = now_us < empty_at ? empty_at : now_us; }
  void sent(int bytes) {
    if (empty_at < now_us) empty_at = now_us;
    empty_at += bytes * byte_us;
    if (empty_at > now_us + 63 * byte_us) now_us = empty_at - 63 * byte_us;
  }
  void print(const __FlashStringHelper *text) { sent(printf("%s", (const char *)text)); }
  void print(char c) { sent(printf("%c", c)); }
  void print(int number) { sent(printf("%d", number)); }
  void print(long number) { sent(printf("%ld", number)); }
  void print(unsigned number) { sent(printf("%u", number)); }
  void print(unsigned long number) { sent(printf("%lu", number)); }
  void print(double number, int digits) { sent(printf("%.*f", digits, number)); }
  void println() { sent(2), printf(" @%lu\n", now_us); }
  template <typename Value>
  void println(Value value) {
    print(value);
    println();
  }
};
extern Port Serial, Serial1;
