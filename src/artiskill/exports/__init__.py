"""Objects as files of other programs: MJCF, URDF, glTF."""
