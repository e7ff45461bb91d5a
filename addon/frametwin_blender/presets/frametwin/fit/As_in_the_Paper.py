import bpy

fit = bpy.context.scene.frametwin.fit

fit.preset = "paper"
fit.mask = "paper"
fit.cameras = "exact"
fit.anchor = "auto"
