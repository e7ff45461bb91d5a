import bpy

rig = bpy.context.scene.frametwin.cameras

rig.kind = "ring"
rig.count = 6
rig.distance = 1.0
rig.low = 0.349066
rig.high = 0.785398
rig.lens = 0.698132
rig.width = 640
rig.height = 480
