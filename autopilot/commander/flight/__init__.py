"""Parts of the pilot: contact with the ground, the reference, and readiness; each can be built alone."""
