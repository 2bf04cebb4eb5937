// Reads the voltage at an analog pin.
#pragma once

#define PRETOUCH_SENSOR_NAME "analog pin"
#define PRETOUCH_MEASURING_US 0UL
#define PRETOUCH_POLL_US PRETOUCH_SENSOR_PERIOD_US

#ifndef ANALOG_PIN
#define ANALOG_PIN A0
#endif

inline bool pretouch_start_sensor() { return true; }

// A wire that is cut still gives readings: whether the sensor works cannot be seen at the pin.
inline bool pretouch_read_sensor(uint32_t, pretouch_reading &reading) {
  reading.value = analogRead(ANALOG_PIN);
  reading.is_new = true;
  return true;
}
