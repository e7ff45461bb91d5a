"""In which order a frame is printed, with which tool axis, without collisions and without loose struts."""
