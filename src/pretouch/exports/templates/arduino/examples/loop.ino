// The whole loop: reads a sensor, runs the control law, and writes a reference for a drive.
//
// $law
// Written by pretouch $version from $origin.
//
// First run it as it is, without a drive: it prints what it would command. Then choose the output and connect the drive.
// Signs: positions count along the axis of the sensor, positive toward the object. A law that retreats commands negative
// positions and velocities. Positions are relative to where the drive is when this sketch starts.

#include <pretouch_settings.h>

// ---- settings ----

#ifndef SENSOR
#define SENSOR PRETOUCH_$part  // _VCNL4040, _VCNL4010, _APDS9960, _VL53L0X, _ANALOG_PIN or _OWN_SENSOR
#endif

#ifndef REFERENCE
#define REFERENCE PRETOUCH_LOG_ONLY  // _LOG_ONLY, _STEP_DIRECTION, _SERVO, _SERIAL or _CAN
#endif

// For PRETOUCH_ANALOG_PIN: the pin, and what one count of its converter is in the unit of the calibration
#define ANALOG_PIN A0
// #define READING_PER_COUNT 1  // 1 for counts of this converter, 3.3f / 4095 for V of 12 bits over 3.3 V

// The log, whose lines pretouch replay reads
#define BAUD 115200UL
#define READING_DIGITS $reading_digits  // decimals of a reading
#define LOG_WAITS 0       // 1: wait until there is room for a line. Needed if your board always reports room for 0 bytes

// For PRETOUCH_STEP_DIRECTION: negative steps per meter if positive steps lead away from the object
#define STEP_PIN 2
#define DIRECTION_PIN 3
#define STEPS_PER_METER 80000.0f

// For PRETOUCH_SERVO: pulse per meter, or per m/s of a continuously rotating one; negative if it turns the other way
#define SERVO_PIN 9
#define SERVO_CENTER_US 1500
#define SERVO_LEAST_US 1000
#define SERVO_MOST_US 2000
#define SERVO_US_PER_UNIT 5000.0f
#define REFERENCE_IS_VELOCITY 0

// For PRETOUCH_SERIAL and PRETOUCH_CAN: -1 if the drive counts away from the object
#define REFERENCE_SIGN 1
#define REFERENCE_PORT Serial1
#define REFERENCE_BAUD 115200UL
#define CAN_ID 0x100

// ---- end of the settings ----

#include <pretouch_loop.h>
#include <pretouch_reference.h>
#include <pretouch_sensor.h>

PretouchLoop law;
uint32_t read_due, said_at, lines_left_out, references_left_out, unanswered;

#if REFERENCE == PRETOUCH_CAN
// Fill in: send the frame with the CAN controller of your board, and return whether it was sent. Do not wait.
bool send_can_frame(uint32_t id, const uint8_t *bytes, uint8_t length) {
  (void)id, (void)bytes, (void)length;
  return false;
}
#endif

#if SENSOR == PRETOUCH_OWN_SENSOR
// Fill in: set up your sensor, and return whether it answers.
bool pretouch_start_sensor() { return false; }

// Fill in: set value and is_new, and return whether the sensor answers. Do not wait.
bool pretouch_read_sensor(uint32_t now, pretouch_reading &reading) {
  (void)now, (void)reading;
  return false;
}
#endif

// Stops here if a step of the law takes longer than its period.
void check_speed() {
  const uint32_t longest = law.longest_step();
  Serial.print(F("# a step takes up to "));
  Serial.print(longest);
  Serial.print(F(" us of a period of "));
  Serial.print(PRETOUCH_PERIOD_US);
  Serial.println(F(" us"));
  while (longest >= PRETOUCH_PERIOD_US) {
    Serial.println(F("# too slow: set a lower rate in [controller], verify and export again, or use a faster board"));
    delay(1000);
  }
}

void read_sensor(uint32_t now) {
  if ((int32_t)(now - read_due) < 0) return;
  read_due += PRETOUCH_POLL_US;
  if ((int32_t)(now - read_due) >= 0) read_due = now + PRETOUCH_POLL_US;  // the loop was late
  pretouch_reading reading = {0, false, false};
  if (!pretouch_read_sensor(now, reading)) unanswered++;
  reading.value *= READING_PER_COUNT;
  law.take(micros(), reading);
}

// Prints a line of the log for each reading that the law used. If there is no room, the line is left out, so that the
// law does not wait for it.
void print_line() {
  if (!LOG_WAITS && Serial.availableForWrite() < 48) {
    lines_left_out++;
    return;
  }
  Serial.print(law.used_time);
  Serial.print(',');
  Serial.print(law.used_value, READING_DIGITS);
  Serial.print(',');
  Serial.print(lroundf(1e6f * law.output.position));
  Serial.print(',');
  Serial.print(lroundf(1e6f * law.output.velocity));
  Serial.print(',');
  Serial.println((long)law.output.status);
}

void print_count(const __FlashStringHelper *name, uint32_t &count) {
  Serial.print(name);
  Serial.print(count);
  count = 0;
}

// Once per second, says what went wrong since the last time.
void say_what_went_wrong(uint32_t now) {
  if (now - said_at < 1000000UL) return;
  if (!LOG_WAITS && !law.is_stopped && Serial.availableForWrite() < 60) return;
  said_at = now;
  if (law.is_stopped) {
    Serial.print(F("# stopped: no usable reading for "));
    Serial.print(lroundf(1000 * pretouch_design.sensing.timeout));
    Serial.print(F(" ms; the reference holds until a reset"));
    Serial.println(unanswered > 0 ? F("; " PRETOUCH_SENSOR_NAME " does not answer") : F(""));
  }
  if (law.overruns + unanswered + references_left_out + lines_left_out == 0) return;
  print_count(F("# late periods "), law.overruns);
  print_count(F(", unanswered "), unanswered);
  print_count(F(", not written "), references_left_out);
  print_count(F(", not logged "), lines_left_out);
  Serial.println();
}

void setup() {
  Serial.begin(BAUD);
  check_speed();
  while (!pretouch_start_sensor()) {
    Serial.println(F("# " PRETOUCH_SENSOR_NAME " does not answer: check wiring and supply"));
    delay(1000);
  }
  pretouch_start_reference();
  Serial.println(F("time_us,$reading_header,position_um,velocity_um_s,status"));
  Serial.flush();
  read_due = said_at = micros();
  law.start(read_due + PRETOUCH_PERIOD_US / 2);  // so that a reading waits half a period for the law
}

void loop() {
  read_sensor(micros());
  if (law.run(micros())) {
    if (!pretouch_write_reference(law.output)) references_left_out++;
    if (law.has_used_reading) print_line();
    say_what_went_wrong(micros());
  }
  pretouch_move(micros());
}
