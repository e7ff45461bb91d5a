"""Captures: plan, cameras and pictures of a print in one folder; scenes to render, and the pictures' files."""

from frametwin.capture.capture import Capture, View, read_cameras, read_capture, write_capture

__all__ = ["Capture", "View", "read_cameras", "read_capture", "write_capture"]
