"""Sparse factorisation, Lanczos iteration, threads of dense algebra."""
