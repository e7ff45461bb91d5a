import bpy

rig = bpy.context.scene.frametwin.cameras

rig.kind = "ring"
rig.count = 8
rig.distance = 1.1
rig.low = 0.349066
rig.high = 0.785398
rig.lens = 0.750492
rig.width = 1920
rig.height = 1080
