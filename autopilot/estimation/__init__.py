"""State estimation from sensors.

The filter is an error-state Kalman filter (J. Solà, arXiv:1711.02508) in ENU/FLU. Its nominal state x (23,) is position
(m), velocity (m/s), attitude (wxyz), gyroscope bias (rad/s), accelerometer bias (m/s²), GPS drift (m), barometer offset
(m) and the vehicle's own magnetic field (gauss); its covariance P (22, 22) has a rotation vector for the attitude.

GPS measures the past. Therefore the filter runs behind by the delay of GPS: inertial samples, magnetic field and
pressure wait in a ring buffer, and each fix is fused at its time of measurement, so that the update is exact and the
covariance consistent. The current state is the filter's state integrated through the waiting samples. PX4's EKF2 does
the same with an output observer instead of the second integration, which is exact and costs a few microseconds.

A frame passes `sensing` (plausibility, bridging), `delay_buffer`, `eskf_predict` and `eskf_update` (one file for each
sensor in `measurements`), and `output_smoothing`, because corrections must not shake the control loop.
`accelerometer_bias` and `gyroscope_bias` detect sudden biases after a fix. `sensing.alignment` and `sensing.free_fall`
start the filter at rest or in a fall.
"""
