"""Identification of the body-rate response: small steps in flight, a fitted lag, a figure."""
