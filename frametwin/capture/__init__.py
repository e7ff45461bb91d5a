"""Captures: plan, cameras and pictures of a print in one folder; scenes to render, and the pictures' files."""

from frametwin.capture.capture import Capture, View, read_capture, write_capture
from frametwin.capture.picture import Picture
from frametwin.capture.transforms import read_cameras

__all__ = ["Capture", "Picture", "View", "read_cameras", "read_capture", "write_capture"]
