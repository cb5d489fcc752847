"""From a state to a setpoint: the state predicted, a law asked, its moments turned into body rates."""
