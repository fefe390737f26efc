"""The smallest scenario with impacts: two balls in one valley, as TOML."""

SCENARIO = """
gravity = 9.81
[trace]
start_slope = "-90 deg"
arcs = [{shape = "valley", radius = 1.0, end_slope = "90 deg"}]
[[balls]]
radius = 0.1
mass = 2.0
arc = 1
angle = -1.0
[[balls]]
radius = 0.1
mass = 1.0
arc = 1
angle = 0.5
[collision]
k = 0.9
[stop]
collisions = 3
"""
