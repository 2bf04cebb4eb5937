// Includes the driver of the chosen sensor. Define SENSOR before.
#pragma once

#include "pretouch_loop.h"

#if SENSOR == PRETOUCH_VCNL4040
#include "pretouch_vcnl4040.h"
#elif SENSOR == PRETOUCH_VCNL4010
#include "pretouch_vcnl4010.h"
#elif SENSOR == PRETOUCH_APDS9960
#include "pretouch_apds9960.h"
#elif SENSOR == PRETOUCH_VL53L0X
#include "pretouch_vl53l0x.h"
#elif SENSOR == PRETOUCH_ANALOG_PIN
#include "pretouch_analog_pin.h"
#elif SENSOR == PRETOUCH_OWN_SENSOR
#define PRETOUCH_SENSOR_NAME "sensor"
#define PRETOUCH_MEASURING_US 0UL
#define PRETOUCH_POLL_US PRETOUCH_SENSOR_PERIOD_US
bool pretouch_start_sensor();                                             // in your sketch
bool pretouch_read_sensor(uint32_t now, pretouch_reading &reading);  // in your sketch
#else
#error SENSOR: choose one of the sensors in pretouch_settings.h
#endif

#if PRETOUCH_MEASURES_DISTANCE && SENSOR != PRETOUCH_VL53L0X && SENSOR != PRETOUCH_OWN_SENSOR
#error SENSOR: the readings of this design are distances, but this sensor measures none
#endif

static_assert(PRETOUCH_SENSOR_PERIOD_US >= PRETOUCH_MEASURING_US,
              "The sensor needs longer for a reading than this design allows: lower the rate in [chain], verify and export");

#ifndef READING_PER_COUNT
#if SENSOR == PRETOUCH_ANALOG_PIN && !PRETOUCH_IS_IN_COUNTS
#error Define READING_PER_COUNT: 1 if the readings of the design are counts of this pin, 3.3f / 4095 for V of 12 bits over 3.3 V
#endif
#define READING_PER_COUNT 1
#endif
