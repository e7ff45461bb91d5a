import bpy

fit = bpy.context.scene.frametwin.fit

fit.preset = "fast"
fit.mask = "auto"
fit.cameras = "exact"
fit.anchor = "auto"
