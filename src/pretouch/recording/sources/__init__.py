"""Read a proximity sensor from a serial port, standard input, a ROS 2 topic or an I2C bus."""
