"""Differentiable pictures of kernels: compiled splatters and the plain references they must agree with."""
