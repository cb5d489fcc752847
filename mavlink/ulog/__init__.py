"""ULog, the log format of PX4: its messages, the topics that this vehicle has, control samples and truth as topics."""
