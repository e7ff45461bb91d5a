import bpy

deform = bpy.context.scene.frametwin.deform

deform.kind = "sag"
deform.automatic = True
deform.peak = 5.0
deform.how = "all"
deform.share = 0.6
deform.batch = 0
deform.height = 40.0
deform.missing = 3
deform.missing_share = 0.5
