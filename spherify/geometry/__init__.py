"""The mathematics: arrays in, arrays out.

Knows numpy, in its compiled kernels numba and scipy too, in its implicit flows scipy, and no job, request, file or
clock.
"""
