"""The last line of defence: what is caught in flight, and what flies on in place of a part that raised."""
