"""What companion and vehicle say to each other, each a state machine: clock, states, reports, commands, parameters."""
