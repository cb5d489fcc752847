"""Random and hostile datagrams and messages at both processes."""
