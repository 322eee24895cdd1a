"""Virtual instruments that measure cloth: standard tests, and what they print."""
