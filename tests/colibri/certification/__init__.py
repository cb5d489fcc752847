"""Tests of certification: the model, its proofs and their check, and what is certified of profile flight."""
