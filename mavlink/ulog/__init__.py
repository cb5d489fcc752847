"""ULog, PX4's log format: messages, topics, rows of a flight."""
