"""Motion core: skeletons, clips, kinematics, files. Metres, seconds, Y up, quaternions w,x,y,z. Torch-free."""
