"""Parts of the pilot: ground contact, reference generator, readiness."""
