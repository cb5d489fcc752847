"""State estimation from sensors.

The filter is an error-state Kalman filter (J. Solà, arXiv:1711.02508) in ENU/FLU. Its nominal state x (23,) is position
(m), velocity (m/s), attitude (wxyz), gyroscope bias (rad/s), accelerometer bias (m/s²), GPS drift (m), barometer offset
(m) and the vehicle's own magnetic field (gauss). Its covariance P (22, 22) has a rotation vector for the attitude.

It runs behind by the delay of GPS: other measurements wait in a ring buffer, and each fix is fused at its time of
measurement, so that the covariance is consistent. The current state is integrated through the waiting samples. PX4's
EKF2 has an output observer instead of this second integration, which is exact and costs microseconds.

A frame passes `sensing`, `delay_buffer`, `eskf_predict`, `eskf_update` (by `measurements`) and `output_smoothing`.
After each fix, `accelerometer_bias` and `inertial_watch` look for sudden biases. `sensing.alignment` and
`sensing.free_fall` start the filter.
"""
