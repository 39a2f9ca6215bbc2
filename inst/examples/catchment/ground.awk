# The water that reaches the ground [mm/d]: all the rain, on its day. snow.awk is the other form of this file.
{ water = rain }
