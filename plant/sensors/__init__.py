"""What each sensor makes of the truth, with its errors and its faults."""
