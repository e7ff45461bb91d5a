"""Calibrated cameras from pictures of boards: printing, detection, intrinsics, extrinsics, placing, uncertainty."""
