"""Property tests that give the same verdict every time, on however slow a machine."""

from hypothesis import settings

settings.register_profile("same-verdict", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("same-verdict")
