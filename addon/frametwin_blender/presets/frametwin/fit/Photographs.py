import bpy

fit = bpy.context.scene.frametwin.fit

fit.preset = "fast"
fit.mask = "auto"
fit.cameras = "auto"
fit.anchor = "auto"
