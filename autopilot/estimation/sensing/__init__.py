"""Raw sensors judged and read: plausibility, inertial samples, clock resets, alignment at rest or in free fall."""
