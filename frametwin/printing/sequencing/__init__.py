"""In which order a frame is printed, with which tool axis, without collisions and on joints that are well supported."""
