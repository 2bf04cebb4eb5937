// Prints the voltage at pin A0, one number of the converter per line, 1000 times per second.
//
// The number is 0 to 1023 on an Arduino Uno. Connect the output of the sensor to A0, and its ground to GND.

const unsigned long BAUD = 115200;
const unsigned long PERIOD_US = 1000;

unsigned long due;

void setup() {
  Serial.begin(BAUD);
  due = micros();
}

void loop() {
  due += PERIOD_US;
  while ((long)(due - micros()) > 0) {
  }
  Serial.println(analogRead(A0));
}
