import bpy

rig = bpy.context.scene.frametwin.cameras

rig.kind = "dome"
rig.count = 16
rig.distance = 1.0
rig.low = 0.174533
rig.high = 1.22173
rig.lens = 0.698132
rig.width = 1600
rig.height = 1200
