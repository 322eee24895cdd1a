"""A woven cloth in numbers: yarns, spacings, crimp and figures."""
