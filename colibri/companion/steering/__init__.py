"""From a state to a setpoint: predict the state, run the law, convert its moments to body rates."""
