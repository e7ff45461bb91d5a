"""Adaptive printing: the order of the struts, the closed loop with the twin, its simulator, and what the robot is told."""
