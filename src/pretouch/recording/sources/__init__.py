"""Read a sensor over serial, standard input, ROS 2 or I2C."""
