"""What every other adapter asks of a scene: units, collections, and where an object lies."""
