"""Measurements as ratios in one run; see the README in this folder."""
