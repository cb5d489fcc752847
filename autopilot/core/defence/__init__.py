"""The last line of defence: catches exceptions in flight, and replaces the parts that raised them."""
