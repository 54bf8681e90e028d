"""The mathematics: arrays in, arrays out. Knows numpy, and no job, request, file or clock."""
