"""The mathematics: arrays in, arrays out.

Knows numpy, in its compiled kernels numba and scipy too, and no job, request, file or clock.
"""
