"""From pictures to a twin: the fast fit, and the paper's by anchored Gaussians with a deformation field."""
