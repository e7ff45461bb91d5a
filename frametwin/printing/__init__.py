"""Adaptive printing: the order of struts, the closed loop with the twin, its simulator, what the robot is told."""
