// Numbers of this design that the loop around the law needs. pretouch wrote them; change the scenario file instead.
#pragma once

// The control period: whole microseconds, and the nanoseconds beyond them.
#define PRETOUCH_PERIOD_US ${period_us}UL
#define PRETOUCH_PERIOD_NS ${period_ns}UL

// The time between two readings [us], and that from the middle of a measurement until its reading is available [s].
#define PRETOUCH_SENSOR_PERIOD_US ${sensor_period_us}UL
#define PRETOUCH_LATENCY ${latency}f

// 1: readings are distances, which the sensor curve converts.
#define PRETOUCH_MEASURES_DISTANCE $measures_distance

// 0: the readings of this design are not in counts, or their unit is unknown.
#define PRETOUCH_IS_IN_COUNTS $is_in_counts

// Sensors, for SENSOR
#define PRETOUCH_VCNL4040 1
#define PRETOUCH_VCNL4010 2
#define PRETOUCH_APDS9960 3
#define PRETOUCH_VL53L0X 4
#define PRETOUCH_ANALOG_PIN 5
#define PRETOUCH_OWN_SENSOR 6

// Outputs of the reference, for REFERENCE
#define PRETOUCH_LOG_ONLY 1
#define PRETOUCH_STEP_DIRECTION 2
#define PRETOUCH_SERVO 3
#define PRETOUCH_SERIAL 4
#define PRETOUCH_CAN 5
